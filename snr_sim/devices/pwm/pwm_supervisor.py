"""Supervisor of outputs that hold their last pulse: a small process that owns them, and the code inside it.

    robot's program  --leases over a pipe-->  supervisor  --> PCA9685, PWM pins
    (SupervisedPwm)  <--applied pulses-------

It goes to neutral when a lease expires and when the pipe closes, which happens however the robot's program ends. If the
supervisor is killed, its guard does the same (`pwm_guard.py`). Nothing protects against the end of both, of the kernel
or of the power: for real water, the outputs need an enable pin on a hardware timer. It is in `devices` because for the
program it is one more device; `supervision` is about roles.
"""

from __future__ import annotations

import importlib
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection

from snr_sim.core.process import spawned
from snr_sim.devices.pwm.pwm_guard import Guard
from snr_sim.devices.wire.lease_messages import Answer, Arm, Close, Disarm, Lease, Message, Open, encode, receive
from snr_sim.prelude.device import PwmOut
from snr_sim.prelude.errors import DeviceError, SnrError

IDLE_S = 1.0
HOLD_S = 0.5  # of neutral after the program has ended, before outputs are released


class Supervisor:
    """Executes orders and checks the lease. Owns no pipe, so a test needs none.

    Args:
        now_s: the clock of lease stamps.
        guarded: starts a guard for open outputs.
    """

    def __init__(self, now_s: Callable[[], float], guarded: Callable[[PwmOut], Guard] | None = None) -> None:
        self._now_s, self._guarded = now_s, guarded
        self._out: PwmOut | None = None
        self._guard: Guard | None = None
        self._until_s = 0.0
        self._seq = 0
        self._made: list[float] = []
        self._reasons: list[str] = []
        self.has_closed = False

    def obey(self, order: Message) -> Answer:
        """Execute an order; the answer contains the error if it fails."""
        self.look()
        try:
            self._do(order)
        except SnrError as error:
            return self._answer(error.message, error.fix)
        finally:
            self._show_life()
        return self._answer()

    def look(self) -> float:
        """Go to neutral if the lease has expired; return the time until it does."""
        if self._out is None or not self._is_armed:
            return IDLE_S
        left_s = self._until_s - self._now_s()
        if left_s > 0.0:
            return min(left_s, IDLE_S)
        self._out.deactivate("the lease ran out: the robot's program sent nothing in time")
        self._show_life()
        return IDLE_S

    @property
    def _is_armed(self) -> bool:
        return self._out is not None and self._out.health().state in ("activating", "active")

    def _show_life(self) -> None:
        if self._guard is not None:
            self._guard.sign(self._is_armed)

    def end(self, hold: Callable[[float], None]) -> None:
        """Go to neutral, hold it for a while, and release the outputs."""
        if self._out is not None:
            self._out.deactivate("the robot's program has ended")
            self._show_life()
            if not self.has_closed:
                hold(HOLD_S)
            if self._guard is not None:
                self._guard.dismiss()  # while this process still owns the outputs
                self._guard = None
            self._out.close()

    def _do(self, order: Message) -> None:
        if isinstance(order, Open):
            module, _, function = order.opener.partition(":")
            self._out = getattr(importlib.import_module(module), function)(*order.args)
            self._out.configure()
            if self._guarded is not None and self._guard is None:
                self._guard = self._guarded(self._out)
        elif isinstance(order, Close):
            self.has_closed = True
        elif self._out is None:
            raise DeviceError("These outputs are not open.", fix="configure() them first.")
        elif isinstance(order, Arm):
            self._out.activate()
            self._until_s = self._now_s() + IDLE_S  # until the first lease
        elif isinstance(order, Disarm):
            self._out.deactivate(order.reason)
        elif isinstance(order, Lease):
            self._lease(self._out, order)

    def _lease(self, out: PwmOut, lease: Lease) -> None:
        applied = out.write_us(lease.pulses_us, lease.stamp_s, lease.lease_s)
        self._seq, self._made, self._reasons = lease.seq, applied.pulses_us, applied.why
        self._until_s = min(lease.stamp_s, self._now_s()) + lease.lease_s  # of the newest command, not the latest

    def _answer(self, message: str = "", fix: str = "") -> Answer:
        if self._out is None:
            return Answer(self._seq, "error", message, [], [], {}, fix)
        health = self._out.health()
        state = "error" if message else health.state
        return Answer(self._seq, state, message or health.why, self._made, self._reasons, health.counts, fix)


def run(line: Connection) -> int:
    """Run the process: execute orders until its line closes."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(0))  # goes to neutral during exit
    spawned.hear_signals()
    supervisor = Supervisor(time.monotonic, lambda out: Guard(out, [line.fileno()]))
    why = "the robot's program has gone without closing them"
    try:
        _serve(line, supervisor)
    except DeviceError as error:
        why = error.message
    except (EOFError, OSError):
        pass  # the other end has closed
    finally:
        supervisor.end(time.sleep)  # before the answer is sent: the other process may be gone
    if not supervisor.has_closed:
        with suppress(OSError):
            print(f"Outputs have gone to neutral: {why}.", file=sys.stderr)
    return 0


def _serve(line: Connection, supervisor: Supervisor) -> None:
    while not supervisor.has_closed:
        if line.poll(supervisor.look()):
            line.send_bytes(encode(supervisor.obey(receive(line))))
