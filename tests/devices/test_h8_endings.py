"""H8: however a program ends, unless it is killed, its outputs are neutral within one frame.

Times exclude those in which the program waited for a core: a busy computer is not a failure.
"""

import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytestmark = pytest.mark.wall_clock

FRAME_S = 0.02
LEASE_S = 0.2
WAIT_S = 60.0
PROGRAM = Path(__file__).with_name("ending_robot.py")
Line = tuple[float, float, str]  # time, total wait for a core until then, and text


class Robot:
    """A program that prints its outputs."""

    def __init__(self, how: str) -> None:
        command = [sys.executable, str(PROGRAM), how]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, bufsize=0)
        self.lines: list[Line] = []

    def read_until(self, word: str) -> Line:
        while not self.lines or self.lines[-1][2] != word:
            assert self.read_line(), f"it ended without '{word}': {self.lines[-5:]}"
        return self.lines[-1]

    def read_line(self) -> bool:
        assert self.process.stdout is not None
        assert select.select([self.process.stdout], [], [], WAIT_S)[0], "it said nothing"
        words = self.process.stdout.readline().decode().split()
        if words:
            self.lines.append((int(words[0]) * 1e-9, int(words[1]) * 1e-9, words[2]))
        return bool(words)

    def read_all(self) -> None:
        while self.read_line():
            pass

    def still_after_s(self, since: Line) -> float:
        """Return the time until the outputs are neutral for the rest of the run."""
        last_push = max(i for i, line in enumerate(self.lines) if line[2] == "pushing")
        still = next(line for line in self.lines[last_push:] if line[2] == "still")
        return still[0] - since[0] - (still[1] - since[1])


@pytest.fixture
def start() -> Iterator[Callable[[str], Robot]]:
    started: list[Robot] = []

    def start(how: str) -> Robot:
        started.append(Robot(how))
        return started[-1]

    yield start
    for robot in started:
        robot.process.kill()
        robot.process.communicate()


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_h8_signal_leaves_neutral_within_one_frame(start: Callable[[str], Robot], number: signal.Signals) -> None:
    robot = start("signal")
    _, held_up_s, _ = robot.read_until("pushing")
    robot.process.send_signal(number)
    sent_s = time.monotonic()  # after it was sent: this process, too, may have to wait for a core
    robot.read_all()
    assert robot.process.wait(WAIT_S) is not None
    assert robot.still_after_s((sent_s, held_up_s, "")) <= FRAME_S


@pytest.mark.slow
@pytest.mark.parametrize(("how", "status"), [("raise", 1), ("exit", 1)])
def test_h8_handler_error_or_exit_leaves_neutral_within_one_frame(
    start: Callable[[str], Robot], how: str, status: int
) -> None:
    robot = start(how)
    began = robot.read_until("now")
    robot.read_all()
    assert robot.process.wait(WAIT_S) == status
    assert robot.still_after_s(began) <= FRAME_S


@pytest.mark.slow
def test_h8_second_ctrl_c_with_hanging_handler_leaves_neutral(start: Callable[[str], Robot]) -> None:
    robot = start("hang")
    began = robot.read_until("now")
    for _ in range(2):
        robot.process.send_signal(signal.SIGINT)
        time.sleep(0.01)
    robot.read_all()
    robot.process.wait(WAIT_S)
    assert robot.still_after_s(began) <= LEASE_S + FRAME_S


@pytest.mark.slow
def test_h11_hanging_handler_leaves_neutral_after_lease(
    start: Callable[[str], Robot],
) -> None:
    robot = start("hang")
    began = robot.read_until("now")
    robot.read_until("still")
    assert robot.process.poll() is None, "it hangs, and no signal has ended it"
    assert robot.still_after_s(began) <= LEASE_S + 2 * FRAME_S


@pytest.mark.slow
@pytest.mark.parametrize("how", ["drop", "cycle", "leave"])
def test_h8_unreferenced_outputs_go_to_neutral(start: Callable[[str], Robot], how: str) -> None:
    robot = start(how)
    began = robot.read_until("now")
    robot.read_until("still")
    limit_s = 1.0 if how == "leave" else FRAME_S
    assert robot.still_after_s(began) <= limit_s
