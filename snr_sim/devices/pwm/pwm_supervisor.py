"""Supervisor of outputs that hold their last pulse: a small process that owns them, and its watchdog.

    robot's program  --leases over a pipe-->  supervisor  --> PCA9685, PWM pins <--.
    (SupervisedPwm)  <--applied pulses-------     '--heartbeats--> watchdog -------' neutral, once

It goes to neutral when a lease expires and when the pipe closes, which happens however the robot's program ends. If the
supervisor is killed or hangs, its watchdog acts, a second process. Nothing protects against the end of both, of the
kernel or of the power: for real water, the outputs need an enable pin on a hardware timer. It is in `devices` because
for the program it is one more device; `supervision` is about roles.
"""

from __future__ import annotations

import importlib
import os
import select
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection

from snr_sim.core.process import spawned
from snr_sim.core.standard_streams import print_line
from snr_sim.devices.wire import lease_messages as wire
from snr_sim.prelude.device import LEASE_S, PwmOut
from snr_sim.prelude.errors import DeviceError, SnrError

IDLE_S = 1.0
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


class OutputSupervisor:
    """Executes orders and checks the lease by the clock of its stamps. Owns no pipe, so a test needs none."""

    def __init__(
        self, now_s: Callable[[], float], start_watchdog: Callable[[PwmOut], OutputWatchdog] | None = None
    ) -> None:
        self._now_s, self._start_watchdog = now_s, start_watchdog
        self._out: PwmOut | None = None
        self._watchdog: OutputWatchdog | None = None
        self._until_s = 0.0
        self._seq = 0
        self._applied_us: list[float] = []
        self._reasons: list[str] = []
        self.has_closed: bool = False

    def execute(self, order: wire.Message) -> wire.LeaseStatus:
        """Execute an order; the answer contains the error if it fails."""
        self.poll()
        try:
            self._execute(order)
        except SnrError as error:
            return self._status(error.message, error.fix)
        finally:
            self._feed_watchdog()
        return self._status()

    def poll(self) -> float:
        """Go to neutral if the lease has expired; return the time until it does."""
        if self._out is None or not self._is_armed:
            return IDLE_S
        left_s = self._until_s - self._now_s()
        if left_s > 0.0:
            return min(left_s, IDLE_S)
        self._out.deactivate("the lease ran out: the robot's program sent nothing in time")
        self._feed_watchdog()
        return IDLE_S

    @property
    def _is_armed(self) -> bool:
        return self._out is not None and self._out.health().state in ("activating", "active")

    def _feed_watchdog(self) -> None:
        if self._watchdog is not None:
            self._watchdog.feed(self._is_armed)

    def end(self, hold: Callable[[float], None]) -> None:
        """Go to neutral, hold it for a while, and release the outputs."""
        if self._out is not None:
            self._out.deactivate("the robot's program has ended")
            self._feed_watchdog()
            if not self.has_closed:
                hold(HOLD_S)
            if self._watchdog is not None:
                self._watchdog.stop()  # while this process still owns the outputs
                self._watchdog = None
            self._out.close()

    def _execute(self, order: wire.Message) -> None:
        if isinstance(order, wire.OpenOutputs):
            module, _, function = order.opener.partition(":")
            self._out = getattr(importlib.import_module(module), function)(*order.args)
            self._out.configure()
            if self._start_watchdog is not None and self._watchdog is None:
                self._watchdog = self._start_watchdog(self._out)
        elif isinstance(order, wire.CloseOutputs):
            self.has_closed = True
        elif self._out is None:
            raise DeviceError("These outputs are not open.", fix="call configure() first.")
        elif isinstance(order, wire.ArmOutputs):
            self._out.activate()
            self._until_s = self._now_s() + IDLE_S  # until the first lease
        elif isinstance(order, wire.DisarmOutputs):
            self._out.deactivate(order.reason)
        elif isinstance(order, wire.Lease):
            self._lease(self._out, order)

    def _lease(self, out: PwmOut, lease: wire.Lease) -> None:
        applied = out.write_us(lease.pulses_us, lease.stamp_s, lease.lease_s)
        self._seq, self._applied_us, self._reasons = lease.seq, applied.pulses_us, applied.reason
        self._until_s = min(lease.stamp_s, self._now_s()) + lease.lease_s  # of the newest command, not the latest

    def _status(self, message: str = "", fix: str = "") -> wire.LeaseStatus:
        if self._out is None:
            return wire.LeaseStatus(self._seq, "error", message, [], [], {}, fix)
        health = self._out.health()
        state = "error" if message else health.state
        return wire.LeaseStatus(
            self._seq, state, message or health.reason, self._applied_us, self._reasons, health.counts, fix
        )


def run(line: Connection) -> int:
    """Run the process: execute orders until its line closes."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(0))  # goes to neutral during exit
    spawned.unblock_signals()
    supervisor = OutputSupervisor(time.monotonic, lambda out: OutputWatchdog(out, [line.fileno()]))
    reason = "the robot's program has gone without closing them"
    try:
        while not supervisor.has_closed:
            if line.poll(supervisor.poll()):
                line.send_bytes(wire.CODEC.encode(supervisor.execute(wire.CODEC.receive(line))))
    except DeviceError as error:
        reason = error.message
    except (EOFError, OSError):
        pass  # the other end has closed
    finally:
        supervisor.end(time.sleep)  # before the answer is sent: the other process may be gone
    if not supervisor.has_closed:
        print_line(sys.stderr, f"Outputs have gone to neutral: {reason}.")
    return 0
