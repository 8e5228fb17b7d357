"""Supervisor of outputs that hold their last pulse: a small process that owns them, and its watchdog.

    robot's program  --leases over a pipe-->  supervisor  --> PCA9685, PWM pins <--.
    (SupervisedPwm)  <--applied pulses-------     '--heartbeats--> watchdog -------' neutral, once

It goes to neutral when a lease expires and when the pipe closes, which happens however the robot's program ends. If the
supervisor is killed or hangs, its watchdog acts, a second process. Nothing protects against the end of both, of the
kernel or of the power: for real water, the outputs need an enable pin on a hardware timer.
"""

from __future__ import annotations

import os
import select
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from snr_sim.devices.output_supervisor import IDLE_S, OutputSupervisor, serve
from snr_sim.devices.wire import lease_messages as wire
from snr_sim.prelude.device import LEASE_S, PwmOut

HOLD_S = 0.5  # of neutral after the program has ended, before outputs are released
HANG_TIMEOUT_S = LEASE_S + 0.1  # an armed supervisor sends a heartbeat when a lease arrives and when it expires
_ARMED, _NOT_ARMED, _STOPPED = b"a", b"n", b"d"


class OutputWatchdog:
    """The second process, as its supervisor sees it. Starts at once; the supervisor must have one thread only.

    It is forked when the outputs are open, so everything is imported and open already, and it starts in a millisecond
    instead of a third of a second for a new Python. It has its own process group. If both are killed at once, the last
    pulse stays until the next supervisor has started.

    Args:
        out: open outputs that keep their last pulse.
        inherited_fds: open files of the supervisor that it must close, such as the line to the robot's program.
    """

    def __init__(self, out: PwmOut, inherited_fds: Sequence[int] = ()) -> None:
        read, self._write = os.pipe()
        self.pid: int = os.fork()
        if self.pid == 0:
            try:
                for fd in (self._write, *inherited_fds):
                    os.close(fd)
                _watch(read, out)
            finally:
                os._exit(0)  # skips the exit handlers of the supervisor
        os.close(read)
        os.set_blocking(self._write, False)

    def feed(self, is_armed: bool) -> None:
        """Send a heartbeat."""
        with suppress(OSError):  # it was killed or does not run: no process reads it
            os.write(self._write, _ARMED if is_armed else _NOT_ARMED)

    def stop(self) -> None:
        """End it without changing the outputs: another process may own them next."""
        with suppress(OSError):
            os.write(self._write, _STOPPED)
        os.close(self._write)
        with suppress(ChildProcessError):
            os.waitpid(self.pid, 0)


def _watch(heartbeat_fd: int, out: PwmOut) -> None:
    os.setsid()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # it ends with its supervisor
    newest = _NOT_ARMED
    while True:
        if not select.select([heartbeat_fd], [], [], HANG_TIMEOUT_S if newest == _ARMED else None)[0]:
            out.deactivate("the supervisor hangs")
            newest = _NOT_ARMED  # outputs are neutral; wait for the next heartbeat
            continue
        received = os.read(heartbeat_fd, 65536)
        if not received:
            out.deactivate("the supervisor was killed")
            return
        if _STOPPED in received:
            return
        newest = received[-1:]


class PwmSupervisor(OutputSupervisor[PwmOut]):
    """Applies pulses, and disarms the outputs when a lease ends."""

    def __init__(
        self, now_s: Callable[[], float], start_watchdog: Callable[[PwmOut], OutputWatchdog] | None = None
    ) -> None:
        super().__init__(now_s)
        self._start_watchdog = start_watchdog
        self._watchdog: OutputWatchdog | None = None

    def follow(self, out: PwmOut, lease: wire.Lease) -> tuple[list[Any], list[str]]:
        """Write the pulses."""
        applied = out.write_us(lease.command, lease.stamp_s, lease.lease_s)
        return applied.pulses_us, applied.reason

    def step(self, out: PwmOut) -> float:
        """Go to neutral if the lease has expired; return the time until it does."""
        if not self._is_armed:
            return IDLE_S
        left_s = self.until_s - self.now_s()
        if left_s > 0.0:
            return min(left_s, IDLE_S)
        out.deactivate("the lease ran out: the robot's program sent nothing in time")
        self.on_change()
        return IDLE_S

    @property
    def _is_armed(self) -> bool:
        return self.out is not None and self.out.health().state in ("activating", "active")

    def on_open(self, out: PwmOut) -> None:
        """Start the watchdog."""
        if self._start_watchdog is not None and self._watchdog is None:
            self._watchdog = self._start_watchdog(out)

    def on_change(self) -> None:
        """Send the watchdog a heartbeat."""
        if self._watchdog is not None:
            self._watchdog.feed(self._is_armed)

    def on_end(self, out: PwmOut, hold: Callable[[float], None]) -> None:
        """Hold neutral if the program has gone, and stop the watchdog."""
        if not self.has_closed:
            hold(HOLD_S)
        if self._watchdog is not None:
            self._watchdog.stop()  # while this process still owns the outputs
            self._watchdog = None


def run(line: Connection) -> int:
    """Run the process."""
    return serve(line, PwmSupervisor(time.monotonic, lambda out: OutputWatchdog(out, [line.fileno()])))
