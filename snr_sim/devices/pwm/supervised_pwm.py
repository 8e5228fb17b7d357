"""Outputs behind the supervisor, as the robot's program sees them: a PwmOut that fails safe when this program dies."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from snr_sim.devices.pwm.passive_pwm import PassivePwm
from snr_sim.devices.pwm.pwm_backend import PwmBackend
from snr_sim.devices.supervisor_client import SupervisorClient
from snr_sim.devices.wire import lease_messages as wire
from snr_sim.prelude.signals import NOT_ACTIVE, SLEWING


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
        self._client = SupervisorClient(self.title, open_line, monotonic_s)
        self._has_held = False

    def counts(self) -> dict[str, int]:
        """Return the counters of the outputs."""
        return self._client.status.counts

    def on_configure(self) -> None:
        """Start a supervisor, which opens the outputs. Its error is raised here."""
        self._client.end()
        try:
            self._client.open(self._opener, [*self._args, self._has_held])
        except BaseException:
            self._client.end()
            raise
        self._has_held = True

    def on_activate(self) -> None:
        """Order the supervisor to arm."""
        client = self._client
        client.order(wire.ArmOutputs())
        self.state, self.reason = client.status.state, client.status.reason
        client.received_s = client.monotonic_s()

    def on_deactivate(self, reason: str) -> None:
        """Order the supervisor to go to neutral."""
        if self._client.line is not None:
            self._client.order(wire.DisarmOutputs(reason))

    def on_close(self) -> None:
        """Order the supervisor to release the outputs and end."""
        self._client.end()

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        """Send a lease; return the pulses of the newest answer, which may belong to the lease before."""
        status = self._client.lease(pulses_us, self.now_s() - stamp_s, lease_s)
        if status.state == "inactive":
            self.state, self.reason = status.state, status.reason
            reasons.append(NOT_ACTIVE)
            return self.still_us
        if self.state == "activating" and status.state == "active" and self.is_neutral_requested:
            self.state, self.reason = "active", ""
        if self._client.requested != pulses_us:
            reasons.append(SLEWING)
        reasons += [one for one in status.reasons if one not in reasons and one != NOT_ACTIVE]
        return status.applied or self.still_us
