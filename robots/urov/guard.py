"""The guard decides whose word counts: the pilot's, nobody's, or the vehicle's own.

    idle      nothing pushes: disarmed, an emergency stop that nobody has cleared, or outputs that have let go of the
              thrusters by themselves: then somebody must disarm before arming again
    pilot     as the controls say
    neutral   nothing pushes: the newest controls are older than a quarter of a second
    hold      the link has been lost for two seconds: stays at the depth and heading it had when they were
    surface   it has been lost for longer, water comes in, or the battery is low: goes up

The age of controls is counted from when they were made, by the vehicle's own clock.
"""

from __future__ import annotations

from dataclasses import dataclass

from snr_sim.plants.plausible import IS_ABOVE, Limit, check_number, shown
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.signals import PowerReading

from .controls import Controls

MILLISECONDS = {"milliseconds": 1e-3}
# fmt: off
LIMITS = {
    "stale_s": Limit(0.0, 5.0, "s", "0.25 is usual, and until then the vehicle goes on as it was told", MILLISECONDS,
                     IS_ABOVE),
    "lost_s": Limit(0.0, 60.0, "s", "2 is usual, and until then nothing holds the vehicle", MILLISECONDS, IS_ABOVE),
    "hold_s": Limit(0.0, 3600.0, "s", "10 is usual, and a battery lasts an hour or two", MILLISECONDS),
    "low_v": Limit(0.0, 60.0, "V", "13 is usual with 4 cells", {"millivolts": 1e-3}),
    "low_s": Limit(0.0, 600.0, "s", "10 is usual, and a low battery does not last long", MILLISECONDS),
    "sag_ohm": Limit(0.0, 1.0, "ohm", "0.03 is usual", {"milliohms": 1e-3}),
}
# fmt: on


@dataclass(frozen=True)
class GuardLimits:
    """What the guard goes by.

    Args:
        stale_s: age of the newest controls from which nothing pushes.
        lost_s: age from which the link counts as lost.
        hold_s: how long the vehicle holds its depth before it goes up.
        surfaces_on_leak: whether water in the hull sends it up.
        low_v: of the battery at rest; lower than that for `low_s`, and it is low until the next start. 13 V is 3.25 V
            a cell, some 7 % of the charge; at 12 V the pack's maker wants it charged. 0 asks nothing.
        low_s: as ArduPilot waits (BATT_LOW_TIMER).
        sag_ohm: makes the voltage at rest out of that under load. What this does not know of (a pack that is old or
            cold) a burst of thrust would take for a low battery, and that is what `low_s` is for.
        surfaces_on_low: whether a low battery sends it up; else it is only told.

    Raises:
        ParameterError: a number cannot be; the message names it and says what is usual.
    """

    stale_s: float = 0.25
    lost_s: float = 2.0
    hold_s: float = 10.0
    surfaces_on_leak: bool = True
    low_v: float = 13.0
    low_s: float = 10.0
    sag_ohm: float = 0.03
    surfaces_on_low: bool = True

    def __post_init__(self) -> None:
        for name, limit in LIMITS.items():
            check_number(f"The guard's {name}", getattr(self, name), limit)
        for name in ("surfaces_on_leak", "surfaces_on_low"):
            if not isinstance(getattr(self, name), bool):
                raise ParameterError(f"The guard's {name} is {shown(getattr(self, name))}.", fix="True or False.")
        if self.lost_s < self.stale_s:
            raise ParameterError(
                f"The guard's lost_s is {self.lost_s:g}, less than its stale_s, {self.stale_s:g}.",
                fix="a link counts as lost some time after nothing pushes any more: 2 s after 0.25 s, as they were.",
            )


class Guard:
    """Keeps what it has heard.

    Args:
        limits: what it goes by.
    """

    def __init__(self, limits: GuardLimits) -> None:
        self.limits = limits
        self.controls = Controls()
        self.heard_s: float | None = None
        self.is_stopped = False
        self.let_go = ""  # why the outputs have let go by themselves; until somebody disarms
        self.is_wet = False
        self.is_low = False
        self._low_since_s: float | None = None

    def hear(self, controls: Controls, made_s: float) -> None:
        """Takes controls, made at a moment of the vehicle's clock. A stop counts in any order.

        Of two others, the one with the higher number is newer; but after a silence any number counts, for a program at
        the surface that was started again begins with 1.
        """
        self.is_stopped = self.is_stopped or controls.is_stop
        is_overtaken = self.heard_s is not None and controls.number <= self.controls.number
        if is_overtaken and made_s - (self.heard_s or 0.0) <= self.limits.stale_s:
            return
        self.controls, self.heard_s = controls, made_s
        if not controls.is_armed:
            self.let_go = ""
        if controls.clears_stop and not (controls.is_stop or controls.is_armed):
            self.is_stopped = False

    def measure(self, power: PowerReading) -> None:
        """Takes what the power module measured, and so notices a battery that has been low for long enough."""
        limits = self.limits
        if power.voltage_v + power.current_a * limits.sag_ohm >= limits.low_v:
            self._low_since_s = None
            return
        if self._low_since_s is None:
            self._low_since_s = power.stamp_s
        self.is_low = self.is_low or power.stamp_s - self._low_since_s >= limits.low_s - 1e-9

    def age_s(self, now_s: float) -> float | None:
        """Returns how old the newest controls are; None if there are none."""
        return None if self.heard_s is None else now_s - self.heard_s

    def rules(self, now_s: float) -> str:
        """Returns whose word counts now, by the names above."""
        age_s = self.age_s(now_s)
        limits = self.limits
        if age_s is None or self.is_stopped or self.let_go or not self.controls.is_armed:
            return "idle"
        if (self.is_wet and limits.surfaces_on_leak) or (self.is_low and limits.surfaces_on_low):
            return "surface"
        if age_s <= limits.stale_s:
            return "pilot"
        if age_s < limits.lost_s:
            return "neutral"
        return "hold" if age_s < limits.lost_s + limits.hold_s else "surface"
