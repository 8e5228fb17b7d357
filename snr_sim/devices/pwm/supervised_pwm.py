"""Outputs behind the supervisor, as the robot's program sees them: a PwmOut that fails safe when this program dies."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from snr_sim.devices.pwm.passive_pwm import PassivePwm
from snr_sim.devices.pwm.pwm_backend import PwmBackend
from snr_sim.devices.wire import lease_messages as wire
from snr_sim.prelude.device import LEASE_S
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.signals import NOT_ACTIVE, SLEWING

OPEN_S = 20.0  # until a new Python on a small computer has opened them
ANSWER_S = 1.0


class SupervisedPwm(PwmBackend):
    """Outputs that a separate process owns. Implements `PwmOut`.

    Args:
        like: the same outputs, not opened: source of their channels, limits and steps.
        now_s: the clock of command stamps.
        opener: "module:function", called in the supervisor; returns the outputs.
        args: its arguments, JSON. One more follows: whether a supervisor of this program held the outputs before.
        open_line: starts a supervisor.
        monotonic_s: the clock that all processes of this computer share.
    """

    has_independent_failsafe = True
    state: str
    reason: str

    def __init__(
        self,
        like: PassivePwm,
        now_s: Callable[[], float],
        opener: str,
        args: Sequence[Any],
        open_line: Callable[[], wire.SupervisorPort] = wire.SupervisorPort,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(now_s, like.channels, like.limits_us, like.resolution_us)
        self.still_us: list[float] = like.still_us
        self.title: str = f"{like.title}, behind its supervisor,"
        self._opener, self._args = opener, list(args)
        self._open_line, self._monotonic_s = open_line, monotonic_s
        self._line: wire.SupervisorPort | None = None
        self._has_held = False
        self._seq = 0
        self._requested_us: list[float] = []
        self._requested_by_seq: dict[int, list[float]] = {}
        self._status = wire.LeaseStatus(0, "unconfigured", "", [], [], {})
        self._received_s = 0.0

    def counts(self) -> dict[str, int]:
        """Return the counters of the outputs."""
        return self._status.counts

    def on_configure(self) -> None:
        """Start a supervisor, which opens the outputs. Its error is raised here."""
        self._end_supervisor()
        self._line = self._open_line()
        self._requested_by_seq.clear()
        try:
            self._order(wire.OpenOutputs(self._opener, [*self._args, self._has_held]), OPEN_S)
        except BaseException:
            self._end_supervisor()
            raise
        self._has_held = True

    def on_activate(self) -> None:
        """Order the supervisor to arm."""
        self._order(wire.ArmOutputs(), ANSWER_S)
        self.state, self.reason = self._status.state, self._status.reason
        self._received_s = self._monotonic_s()

    def on_deactivate(self, reason: str) -> None:
        """Order the supervisor to go to neutral."""
        if self._line is not None:
            self._order(wire.DisarmOutputs(reason), ANSWER_S)

    def on_close(self) -> None:
        """Order the supervisor to release the outputs and end."""
        self._end_supervisor()

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        """Send a lease; return the pulses of the newest answer, which may belong to the lease before."""
        self._receive()
        now_s = self._monotonic_s()
        if self._requested_by_seq and now_s > self._received_s + ANSWER_S:
            raise DeviceError(
                f"{self.title} has not answered for {ANSWER_S:g} s.",
                fix="check with `top` whether the computer is overloaded.",
            )
        self._seq += 1
        # An old command has expired to neutral, and no newer state is possible.
        age_s = self.now_s() - stamp_s if lease_s > 0.0 else 0.0
        left_s = age_s + lease_s if lease_s > 0.0 else LEASE_S
        self._require_open().write(wire.Lease(self._seq, pulses_us, now_s - age_s, left_s))
        self._requested_by_seq[self._seq] = pulses_us
        self._receive()
        status = self._status
        if status.state == "error":
            raise DeviceError(status.reason, fix=status.fix)
        if status.state == "inactive":
            self.state, self.reason = status.state, status.reason
            reasons.append(NOT_ACTIVE)
            return self.still_us
        if self.state == "activating" and status.state == "active" and self.is_neutral_requested:
            self.state, self.reason = "active", ""
        if self._requested_us != pulses_us:
            reasons.append(SLEWING)
        reasons += [one for one in status.reasons if one not in reasons and one != NOT_ACTIVE]
        return status.pulses_us or self.still_us

    def _order(self, order: wire.Message, timeout_s: float) -> None:
        line = self._require_open()
        self._receive()
        before = len(self._requested_by_seq)
        line.write(order)
        until_s = time.monotonic() + timeout_s
        answers = before + 1
        while answers and line.wait(max(0.0, until_s - time.monotonic())):
            answers -= self._receive()
        if answers > 0:
            raise DeviceError(
                f"{self.title} has not answered for {timeout_s:g} s.",
                fix="check with `top` whether the computer is overloaded.",
            )
        if self._status.state == "error":
            raise DeviceError(self._status.reason, fix=self._status.fix)

    def _receive(self) -> int:
        """Read the answers that have arrived; return their number."""
        count = 0
        for message in self._require_open().read():
            if isinstance(message, wire.LeaseStatus):
                count += 1
                self._status = message
                self._received_s = self._monotonic_s()
                self._requested_us = self._requested_by_seq.get(message.seq, self._requested_us)
                for seq in [seq for seq in self._requested_by_seq if seq <= message.seq]:
                    del self._requested_by_seq[seq]
        return count

    def _end_supervisor(self) -> None:
        line, self._line = self._line, None
        if line is None:
            return
        with suppress(DeviceError):  # a supervisor that has died
            line.write(wire.CloseOutputs())
        line.close()

    def _require_open(self) -> wire.SupervisorPort:
        if self._line is None:
            raise DeviceError(f"{self.title} is not open.", fix="call configure() first.")
        return self._line
