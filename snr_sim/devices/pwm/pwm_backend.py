"""Servo outputs: their base rejects invalid pulses, clamps, checks a command's age, and never raises.

Below it those without hardware: of a simulated vehicle, of none, and a real bench's that drive a simulated vehicle.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence, Set
from typing import Any

from snr_sim.prelude.device import LEASE_S
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import (
    CLAMPED,
    LOST,
    NO_PULSE,
    NOT_ACTIVE,
    STOPPED,
    TOO_OLD,
    WRONG_COUNT,
    AppliedPulses,
    PwmCommand,
)

STOP_US = 1500.0
FUTURE_S = 0.02  # a stamp may be this far ahead of the clock, as clocks are read one after the other
LIMITS_US: tuple[float, float] = (1100.0, 1900.0)  # of the project's speed controllers


class PwmBackend(LifeCycle):
    """Outputs of servo pulses. Implements `PwmOut`; a backend implements `put` and its steps of the life cycle.

    Args:
        now_s: the clock of command stamps.
        channels: how many outputs.
        limits_us: shortest and longest pulse.
        resolution_us: step of the pulses; 0 if they are exact.

    Attributes:
        is_neutral_requested: whether the newest command was complete, fresh and neutral: arming requires one.
        is_stopped: an emergency stop is set.
        disarm_reasons: reasons that stay in each answer until the outputs are armed again: RESET, STOPPED.
        follower: called with the applied pulses whenever they may have changed.
    """

    has_independent_failsafe: bool = False
    follower: Callable[[list[float]], object] | None = None

    def __init__(
        self,
        now_s: Callable[[], float],
        channels: int,
        limits_us: tuple[float, float] = LIMITS_US,
        resolution_us: float = 0.0,
    ) -> None:
        self.now_s: Callable[[], float] = now_s
        self.channels: int = channels
        self.limits_us: tuple[float, float] = limits_us
        self.resolution_us: float = resolution_us
        self.still_us: list[float] = [STOP_US] * channels
        self.applied: AppliedPulses = AppliedPulses(self.still_us, 0.0, [NOT_ACTIVE])
        self.is_neutral_requested: bool = False
        self.is_stopped: bool = False
        self.disarm_reasons: list[str] = []

    def __del__(self) -> None:
        """Go to neutral when the last reference is dropped: no code is left that could."""
        if self.state in self._open_states:
            self.close()

    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        """Request pulses; return the applied ones. Never raises."""
        self.applied = self._apply(pulses_us, stamp_s, lease_s)
        self._notify_follower(self.applied.pulses_us)
        return self.applied

    def _apply(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float) -> AppliedPulses:
        reasons: list[str] = [STOPPED] if self.is_stopped else []
        target_us = self._pulses_of(pulses_us, reasons)
        left_s = self._remaining_lease_s(stamp_s, lease_s)
        if left_s <= 0.0:
            target_us, stamp_s = self.still_us, self._command_time_s(stamp_s)
            reasons.append(TOO_OLD)
        self.is_neutral_requested = not reasons and all(
            abs(one - STOP_US) <= self.resolution_us / 2 for one in target_us
        )
        reasons += [word for word in self.disarm_reasons if word not in reasons]
        if self.state == "activating":
            target_us = self.still_us
        if self.state not in ("activating", "active"):
            reasons.append(LOST if self.state == "error" else NOT_ACTIVE)
            return AppliedPulses(self.still_us, stamp_s, reasons)
        try:
            made = self.put(target_us, stamp_s, left_s, reasons)
        except DeviceError as error:
            self.fail(str(error))
            made = self.still_us
            reasons += [LOST, *(word for word in self.disarm_reasons if word not in reasons)]
        if self.state == "activating":
            reasons.append(NOT_ACTIVE)
        return AppliedPulses(made, stamp_s, reasons)

    def _notify_follower(self, pulses_us: list[float]) -> None:
        if self.follower is not None:
            self.follower(pulses_us)

    def _remaining_lease_s(self, stamp_s: float, lease_s: float) -> float:
        """Return the remaining time of a lease; 0 if it has expired, or its stamp is in the future or not a time."""
        try:
            now_s = self.now_s()
            lease_s = min(float(lease_s), LEASE_S)
            left_s = float(stamp_s) + lease_s - now_s
        except (TypeError, ValueError, OverflowError):
            return 0.0
        return min(left_s, lease_s) if 0.0 < left_s <= lease_s + FUTURE_S else 0.0

    def _command_time_s(self, stamp_s: float) -> float:
        """Return when a command was computed; the current time if its stamp is not a time or in the future."""
        now_s = self.now_s()
        return float(stamp_s) if isinstance(stamp_s, (int, float)) and -math.inf < stamp_s <= now_s else now_s

    def deactivate(self, reason: str) -> None:
        """Go to neutral, and update the follower. Never raises."""
        super().deactivate(reason)
        self._notify_follower([STOP_US] * self.channels)

    def stop(self) -> None:
        """Emergency stop: neutral, and arming is refused until `clear_stop`. Never raises."""
        self.is_stopped = True
        self.deactivate("emergency stop")
        self._try(self.on_stop)

    def clear_stop(self) -> None:
        """End an emergency stop; outputs stay neutral until they are activated. Never raises."""
        self.is_stopped = False
        self._try(self.on_clear_stop)

    def _try(self, step: Callable[[], None]) -> None:
        try:
            step()
        except DeviceError as error:
            self.fail(str(error))

    def activate(self) -> None:
        """Arm; see `PwmOut`. An emergency stop that is set is one more error."""
        if self.is_stopped:
            raise DeviceError(f"{self.title} has its emergency stop set.", fix="make it safe, then clear the stop.")
        super().activate()

    def on_stop(self) -> None:
        """Set the emergency stop in outputs that can hold it themselves."""

    def on_clear_stop(self) -> None:
        """Clear it there."""

    def _pulses_of(self, pulses_us: Sequence[float], reasons: list[str]) -> list[float]:
        """Return the pulses to send; neutral if they are not valid."""
        low, high = self.limits_us
        try:
            if isinstance(pulses_us, (str, bytes, Mapping, Set)):  # these have no order of channels
                reasons.append(NO_PULSE)
                return self.still_us
            if len(pulses_us) != self.channels:
                reasons.append(WRONG_COUNT)
                return self.still_us
            pulses = [float(one) for one in pulses_us if not isinstance(one, (str, bytes, bool))]
        except (TypeError, ValueError, OverflowError):
            pulses = []
        if len(pulses) != self.channels or not all(map(math.isfinite, pulses)):
            reasons.append(NO_PULSE)
            return self.still_us
        clamped = [low if one < low else high if one > high else one for one in pulses]
        if clamped != pulses:
            reasons.append(CLAMPED)
        step = self.resolution_us
        return [min(high, max(low, round(one / step) * step)) for one in clamped] if step else clamped

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        """Send pulses, which are inside all limits, and return the applied ones as far as is known here.

        Args:
            pulses_us: one for each channel.
            stamp_s: of the command.
            lease_s: remaining time of its lease.
            reasons: append a reason for each difference to the command.

        Raises:
            DeviceError: the wire is gone.
        """
        raise NotImplementedError(
            f"{type(self).__name__} needs a method put(self, pulses_us, stamp_s, lease_s, reasons)"
        )


class ImmediateArming(PwmBackend):
    """Outputs that are armed by the first neutral command."""

    state: str
    reason: str

    def on_activate(self) -> None:
        """Wait for a neutral command."""
        self.state, self.reason = "activating", "armed by a command for neutral"

    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        """Request pulses; the first neutral command arms."""
        applied = super().write_us(pulses_us, stamp_s, lease_s)
        if self.state == "activating" and self.is_neutral_requested:
            self.state, self.reason = "active", ""
        return applied


class SimPwm(ImmediateArming):
    """Drives an input of a plant that accepts `PwmCommand`s. Its pulses are exact.

    `now_s`, the clock of command stamps, must equal the plant's time.
    """

    has_independent_failsafe = True

    def __init__(
        self,
        plant: Plant,
        now_s: Callable[[], float],
        channels: int,
        input_name: str = "pwm",
        limits_us: tuple[float, float] = LIMITS_US,
    ) -> None:
        super().__init__(now_s, channels, limits_us)
        self.title: str = f"The simulated output '{input_name}'"
        self._plant, self._input = plant, input_name

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        """Write the pulses to the plant, valid until the lease expires."""
        self._plant.write(self._input, PwmCommand(pulses_us, until_s=self._plant.time_s + lease_s))
        return pulses_us

    def on_configure(self) -> None:
        """Send neutral, so that speed controllers start."""
        self._plant.write(self._input, PwmCommand())

    def on_deactivate(self, reason: str) -> None:
        """Send neutral."""
        self._plant.write(self._input, PwmCommand())


def drive_plant(
    out: PwmBackend, plant: Plant, input_name: str = "pwm", command_of: Callable[[list[float]], Any] = PwmCommand
) -> PwmBackend:
    """Drive a simulated vehicle with the applied pulses of real outputs on a bench; return the outputs.

    `command_of` makes the command of the plant's input from the pulses [us].
    """
    out.follower = lambda pulses_us: plant.write(input_name, command_of(pulses_us))
    return out


class LoopbackPwm(ImmediateArming):
    """Applies exactly the requested pulses; only its return value shows them."""

    has_independent_failsafe = True
    title = "The loopback outputs"

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        """Return the pulses unchanged."""
        return pulses_us
