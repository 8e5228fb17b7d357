"""The guard of a supervisor of outputs: neutral when heartbeats end or are late, and never otherwise."""

import mmap
import os
import signal
import time
from collections.abc import Iterator

import pytest

from snr_sim.devices.pwm.pwm_guard import Guard
from snr_sim.testing.fakes import FakeSensor  # a device, of which only the life cycle is used here

GENEROUS_S = 60.0
# A supervisor has one thread; the process of these tests may have more, of which Python 3.12 warns.
pytestmark = pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")


class Out(FakeSensor[None]):
    """Outputs that only count how often they go to neutral: in memory that a fork shares."""

    def __init__(self) -> None:
        super().__init__([])
        self.count = mmap.mmap(-1, 1)
        self.state = "inactive"

    def on_deactivate(self, reason: str) -> None:
        self.count[0] += 1

    def wait_for(self, count: int) -> None:
        until_s = time.monotonic() + GENEROUS_S
        while self.count[0] < count:
            assert time.monotonic() < until_s, "the guard does nothing"
            time.sleep(0.001)


@pytest.fixture
def out() -> Iterator[Out]:
    out = Out()
    yield out
    out.count.close()


def guard_of(out: Out) -> Guard:
    return Guard(out)  # type: ignore[arg-type]


@pytest.mark.slow
def test_of_a_supervisor_that_arms_nothing_no_signs_are_missed_and_dismissed_it_does_nothing(out: Out) -> None:
    guard = guard_of(out)
    guard.sign(False)
    guard.dismiss()
    assert out.count[0] == 0


@pytest.mark.slow
def test_dismissed_it_does_nothing_though_outputs_were_armed(out: Out) -> None:
    guard = guard_of(out)
    guard.sign(True)
    guard.dismiss()
    assert out.count[0] == 0


@pytest.mark.slow
def test_when_signs_of_life_are_late_it_goes_to_neutral_once_until_there_are_new_ones(out: Out) -> None:
    guard = guard_of(out)
    for silence in (1, 2):
        guard.sign(True)
        out.wait_for(silence)
    guard.dismiss()
    assert out.count[0] == 2


@pytest.mark.slow
def test_when_its_supervisor_is_gone_it_goes_to_neutral_and_ends_whether_armed_or_not(out: Out) -> None:
    """The supervisor is a separate process, which ends like a killed one: without a message."""
    pid = os.fork()
    if pid == 0:
        guard_of(out)
        os._exit(0)
    os.waitpid(pid, 0)
    out.wait_for(1)


@pytest.mark.slow
def test_signals_that_end_a_program_do_not_end_it(out: Out) -> None:
    guard = guard_of(out)
    guard.sign(True)
    out.wait_for(1)  # it has started
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        os.kill(guard.pid, number)
    guard.sign(True)
    out.wait_for(2)
    guard.dismiss()


@pytest.mark.slow
def test_a_guard_that_is_gone_is_no_error(out: Out) -> None:
    guard = guard_of(out)
    os.kill(guard.pid, signal.SIGKILL)
    os.waitpid(guard.pid, 0)
    guard.sign(True)
    guard.dismiss()
