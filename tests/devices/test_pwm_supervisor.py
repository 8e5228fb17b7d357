"""The guard of a supervisor of outputs: neutral when heartbeats end or are late, and never otherwise."""

import mmap
import os
import signal
import time
from collections.abc import Iterator

import pytest

from snr_sim.devices.pwm.pwm_supervisor import OutputWatchdog
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


def guard_of(out: Out) -> OutputWatchdog:
    return OutputWatchdog(out)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("is_armed", [True, False])
def test_output_watchdog_stopped_by_supervisor_keeps_outputs(out: Out, is_armed: bool) -> None:
    watchdog = guard_of(out)
    watchdog.feed(is_armed)
    watchdog.stop()
    assert out.count[0] == 0


@pytest.mark.slow
def test_output_watchdog_late_heartbeat_sets_neutral_once(out: Out) -> None:
    watchdog = guard_of(out)
    for silence in (1, 2):
        watchdog.feed(True)
        out.wait_for(silence)
    watchdog.stop()
    assert out.count[0] == 2


@pytest.mark.slow
def test_output_watchdog_without_supervisor_sets_neutral_and_exits(out: Out) -> None:
    """The supervisor is a separate process, which ends like a killed one: without a message."""
    pid = os.fork()
    if pid == 0:
        guard_of(out)
        os._exit(0)
    os.waitpid(pid, 0)
    out.wait_for(1)


@pytest.mark.slow
def test_output_watchdog_ignores_termination_signals(out: Out) -> None:
    watchdog = guard_of(out)
    watchdog.feed(True)
    out.wait_for(1)  # it has started
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        os.kill(watchdog.pid, number)
    watchdog.feed(True)
    out.wait_for(2)
    watchdog.stop()


@pytest.mark.slow
def test_output_watchdog_that_was_killed_raises_nothing(out: Out) -> None:
    watchdog = guard_of(out)
    os.kill(watchdog.pid, signal.SIGKILL)
    os.waitpid(watchdog.pid, 0)
    watchdog.feed(True)
    watchdog.stop()
