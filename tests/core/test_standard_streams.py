"""Programs that were started without some of their standard streams, and threads that they left behind."""

import errno
import io
import random
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import Config, PrinterEndpointFactory, SynchronousRunner, TaskType, TestRunner, tasks
from snr_sim.core.output_recording import record_output
from snr_sim.core.standard_streams import print_line
from snr_sim.core.standstill import notes_on_threads
from snr_sim.teleop import DisplayFactory
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

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


class FailingStream(io.StringIO):
    """A stream on a full disk, or of a pipe or terminal that has gone: calls fail now and then."""

    FAILURES = (OSError(errno.ENOSPC, "No space left on device"), BrokenPipeError(), OSError(errno.EIO, "gone"))

    def __init__(self, seed: int) -> None:
        super().__init__()
        self.chance = random.Random(seed)
        self.failed = 0

    def _fail(self) -> None:
        if self.chance.random() < 0.5:
            self.failed += 1
            raise self.chance.choice(self.FAILURES)

    def write(self, text: str) -> int:
        self._fail()
        return super().write(text)

    def flush(self) -> None:
        self._fail()


@given(st.integers(0, 2**32))
def test_no_failing_stream_ends_a_node_that_prints(seed: int) -> None:
    out, err = FailingStream(seed), FailingStream(seed + 1)
    ticks = FunctionLoopFactory(lambda loop: (print("tick", flush=True), loop.store_data("x", 1)), "ticks", 20.0)
    display = DisplayFactory(lambda data, pages: [], ["vehicle"], "link", rate_hz=20.0)
    printer = PrinterEndpointFactory([TaskType.process_data])
    runner = TestRunner(Config(factories={"test": [ticks, display, printer]}), until_s=1.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdout", out)
        patch.setattr(sys, "stderr", err)
        patch.setattr("snr_sim.teleop.display.LINE_PERIOD_S", 0.0)
        with record_output([runner.node]):
            runner.run()
    assert runner.node.datastore.stored >= 20
    assert out.failed
    assert err.failed


def test_lines_of_a_stream_that_fails_now_and_then_are_whole() -> None:
    stream = FailingStream(3)
    for _ in range(100):
        print_line(stream, "a line")
    lines = stream.getvalue().splitlines()
    assert 20 < len(lines) < 80
    assert set(lines) == {"a line"}


@given(st.text())
def test_printed_line_has_no_control_characters(text: str) -> None:
    stream = io.StringIO()
    print_line(stream, text)
    shown = stream.getvalue().encode().decode()
    assert all(char.isprintable() or char in " \n\t\u200c\u200d" or char.isspace() for char in shown)
    assert not set(shown) & set("\x1b\x07\r\x9b\u2028\u202e")
