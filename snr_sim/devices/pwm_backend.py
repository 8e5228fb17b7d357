"""What all outputs of servo pulses do alike: refuse what is no pulse, clamp, count a command's age, and never raise."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from snr_sim.prelude.device import LEASE_S
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.signals import CLAMPED, LOST, NO_PULSE, NOT_ACTIVE, TOO_OLD, WRONG_COUNT, AppliedPulses

STOP_US = 1500.0
LIMITS_US = (1100.0, 1900.0)  # of the speed controllers in this kit


class PwmBackend(LifeCycle):
    """Outputs of servo pulses. Keeps the promise of PwmOut; a backend writes `put`, and its steps of the life cycle.

    Args:
        now_s: the clock that commands are stamped by.
        channels: how many outputs.
        limits_us: shortest and longest pulse.
        resolution_us: of pulses; 0 if they are exact.

    Attributes:
        asks_neutral: whether the newest command was a whole one, not too old, and neutral: only then may be armed.
    """

    fails_safe_alone = False

    def __init__(
        self,
        now_s: Callable[[], float],
        channels: int,
        limits_us: tuple[float, float] = LIMITS_US,
        resolution_us: float = 0.0,
    ) -> None:
        self.now_s = now_s
        self.channels = channels
        self.limits_us = limits_us
        self.resolution_us = resolution_us
        self.still_us = [STOP_US] * channels
        self.applied = AppliedPulses(self.still_us, 0.0, [NOT_ACTIVE])
        self.asks_neutral = False

    def __del__(self) -> None:
        """Goes to neutral if whoever had it has dropped it: nobody is left who could."""
        if self.state in self._holding:
            self.close()

    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        """Asks for pulses; returns what is made of them. Never raises."""
        why: list[str] = []
        wanted = self._pulses_of(pulses_us, why)
        left_s = stamp_s + lease_s - self.now_s()
        if not 0.0 < left_s < math.inf:  # also of a stamp that is no time
            wanted, left_s = self.still_us, 0.0
            why.append(TOO_OLD)
        self.asks_neutral = not why and all(abs(one - STOP_US) <= self.resolution_us / 2 for one in wanted)
        if self.state == "activating":
            wanted = self.still_us
        if self.state not in ("activating", "active"):
            why.append(LOST if self.state == "error" else NOT_ACTIVE)
            self.applied = AppliedPulses(self.still_us, stamp_s, why)
            return self.applied
        try:
            made = self.put(wanted, stamp_s, min(left_s, lease_s), why)
        except DeviceError as error:
            self.fail(str(error))
            made = self.still_us
            why.append(LOST)
        if self.state == "activating":
            why.append(NOT_ACTIVE)
        self.applied = AppliedPulses(made, stamp_s, why)
        return self.applied

    def _pulses_of(self, pulses_us: Sequence[float], why: list[str]) -> list[float]:
        """Returns the pulses as they may be sent, neutral if they are none."""
        low, high = self.limits_us
        try:
            if len(pulses_us) != self.channels or isinstance(pulses_us, (str, bytes)):
                why.append(WRONG_COUNT)
                return self.still_us
            pulses = [float(one) for one in pulses_us if not isinstance(one, (str, bytes, bool))]
        except (TypeError, ValueError, OverflowError):
            pulses = []
        if len(pulses) != self.channels or not all(map(math.isfinite, pulses)):
            why.append(NO_PULSE)
            return self.still_us
        clamped = [low if one < low else high if one > high else one for one in pulses]
        if clamped != pulses:
            why.append(CLAMPED)
        step = self.resolution_us
        return [min(high, max(low, round(one / step) * step)) for one in clamped] if step else clamped

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, why: list[str]) -> list[float]:
        """Sends pulses, which are inside all limits, and returns what is made as far as is known here.

        Args:
            pulses_us: one for each channel.
            stamp_s: of the command.
            lease_s: what is left of its lease.
            why: add reasons for anything that is made otherwise.

        Raises:
            DeviceError: the wire is gone.
        """
        raise NotImplementedError(f"{type(self).__name__} needs a method put(self, pulses_us, stamp_s, lease_s, why)")
