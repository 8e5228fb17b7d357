"""What a robot on the wall clock prints while its terminal or pipe takes nothing."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from snr_sim.core.unblocked_output import MAX_CHARS, UnblockedStream, unblocked_output

pytestmark = pytest.mark.slow

ROBOT = """
import sys
from pathlib import Path
from snr_sim import Config, SynchronousRunner, tasks
from snr_sim.testing.function_components import FunctionLoopFactory

def tick(loop):
    print("x" * 20_000)
    print("y" * 20_000, file=sys.stderr)
    done.append(loop.get_time_s())
    if loop.get_time_s() > 1.0:
        loop.parent.enqueue_input(tasks.terminate("done"), "test")

done = []
runner = SynchronousRunner("r", Config(factories={"r": [FunctionLoopFactory(tick, "ticks", 100.0)]}))
runner.run()
Path(sys.argv[1]).write_text(str(len(done)))
"""


def start(report: Path, out: Any) -> subprocess.Popen[bytes]:
    program = report.with_name("robot.py")
    program.write_text(ROBOT, encoding="utf-8")
    return subprocess.Popen([sys.executable, str(program), str(report)], stdout=out, stderr=out)


@pytest.mark.parametrize("is_terminal", [False, True])
def test_robot_continues_when_its_output_is_not_read(tmp_path: Path, is_terminal: bool) -> None:
    reading, writing = os.openpty() if is_terminal else os.pipe()
    process = start(tmp_path / "report", writing)
    os.close(writing)
    try:
        process.wait(30)
        assert int((tmp_path / "report").read_text()) > 20
    finally:
        process.kill()
        process.wait()
        os.close(reading)


def test_dropped_lines_are_whole_and_counted() -> None:
    reading, writing = os.pipe()
    line, count = "z" * 999, 2 * MAX_CHARS // 1000
    with os.fdopen(writing, "w") as stream, pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdout", stream)
        with unblocked_output():
            assert isinstance(sys.stdout, UnblockedStream)
            for _ in range(count):
                print(line)
            received = os.read(reading, MAX_CHARS)  # now it is read again
            while len(received) < MAX_CHARS * 3 // 4:
                received += os.read(reading, MAX_CHARS)
            print("later")
            while b"later\n" not in received:
                received += os.read(reading, MAX_CHARS)
    os.close(reading)
    lines = received.decode().splitlines()
    whole = [one for one in lines if one == line]
    (note,) = set(lines) - {line, "later"}
    assert note == f"({count - len(whole)} lines are missing here: the output was blocked.)"
    assert count // 3 < len(whole) < count
