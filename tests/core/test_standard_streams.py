"""Programs that were started without some of their standard streams, and threads that they left behind."""

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from snr_sim import Config, SynchronousRunner, TaskType, tasks
from snr_sim.core.left_threads import notes_on_threads
from snr_sim.testing.function_components import FunctionEndpointFactory

OPENED = """
import os, sys
from snr_sim.core.standard_streams import open_closed_streams
open_closed_streams()
print("unread")
print("unread", file=sys.stderr)
os.write(1, b"unread")
with open("report", "w") as file:
    file.write(f"{file.fileno() > 2} {sys.stdin.read()!r}")
"""


@pytest.mark.slow
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_closed_standard_stream_is_neither_none_nor_the_next_file_that_is_opened(tmp_path: Path, closed: str) -> None:
    command = f'"$0" -c "$1" {closed}'
    subprocess.run(["sh", "-c", command, sys.executable, OPENED], cwd=tmp_path, stdin=subprocess.DEVNULL, check=True)
    assert (tmp_path / "report").read_text() == "True ''"


@pytest.mark.slow
def test_leftover_thread_is_reported_with_its_line(capsys: pytest.CaptureFixture[str]) -> None:
    may_end = threading.Event()

    def begin(part: object) -> None:
        threading.Thread(target=may_end.wait, args=(60,), name="library").start()
        threading.Thread(target=lambda: may_end.wait(60), name="poll").start()
        threading.Thread(target=lambda: may_end.wait(60), name="daemon", daemon=True).start()

    end = FunctionEndpointFactory(
        {TaskType.event: lambda task, task_id: tasks.terminate("done")},
        begin=lambda part: (begin(part), part.schedule(tasks.event("end"))),
    )
    SynchronousRunner("r", Config(factories={"r": [end]})).run()
    may_end.set()
    library, poll = capsys.readouterr().err.splitlines()
    assert library.startswith("note: Thread 'library' still runs, and keeps the program alive until it returns.")
    assert poll.startswith("note: Thread 'poll' (tests/core/test_standard_streams.py, line ")
    assert 'threading.Thread(target=lambda: may_end.wait(60), name="poll").start()) still runs' in poll


@pytest.mark.slow
def test_an_idle_thread_of_a_pool_is_not_named_and_one_at_work_is() -> None:
    before = threading.enumerate()
    may_end = threading.Event()
    with ThreadPoolExecutor(1) as pool:
        pool.submit(int).result()
        assert notes_on_threads(before) == []
        work = pool.submit(lambda: may_end.wait(60))
        while not work.running():
            pass
        assert "test_standard_streams.py, line" in "".join(notes_on_threads(before))
        may_end.set()
