"""Failsafe monitor: decides which commands are in effect, the pilot's, none, or the vehicle's own.

    idle      nothing pushes: disarmed, an emergency stop that is not yet cleared, or outputs that have disarmed the
              thrusters by themselves
    pilot     the controls apply
    neutral   nothing pushes: the newest controls are older than a quarter of a second, or a failsafe requires it
    hold      a failsafe requires it: stays at the depth and heading of the last controls that were in effect
    surface   a failsafe requires it: goes up

The table of `failsafes.py` contains the causes and their actions; `update_cause` sets and clears them. The age of
controls is counted from when they were made, by the vehicle's own clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from snr_sim.errors import ParameterError
from snr_sim.plants import IS_ABOVE, Limit, check_record
from snr_sim.signals import PowerReading
from snr_sim.teleop import NewestControls

from .controls import Controls
from .failsafes import MILLISECONDS, OUTPUTS, Failsafes

IDLE_S = 0.2  # outputs that disarmed themselves get disarm commands for this long before they are armed again
# fmt: off
LIMITS = {
    "stale_s": Limit(0.0, 5.0, "s", "0.25 is usual, and until then the last command stays in effect", MILLISECONDS,
                     IS_ABOVE),
    "lost_s": Limit(0.0, 60.0, "s", "2 is usual, and until then nothing holds the vehicle", MILLISECONDS, IS_ABOVE),
    "hold_s": Limit(0.0, 3600.0, "s", "10 is usual, and a battery lasts an hour or two", MILLISECONDS),
    "low_v": Limit(0.0, 60.0, "V", "13 is usual with 4 cells", {"millivolts": 1e-3}),
    "low_s": Limit(0.0, 600.0, "s", "10 is usual, and a low battery does not last long", MILLISECONDS),
    "sag_ohm": Limit(0.0, 1.0, "ohm", "0.03 is usual", {"milliohms": 1e-3}),
}
# fmt: on


@dataclass(frozen=True)
class FailsafeLimits:
    """Limits of the failsafe monitor.

    Args:
        stale_s: age of the newest controls from which nothing pushes. Our choice: five of those that come 20 times a
            second. ArduSub takes a pilot for lost after 3 s (FS_PILOT_TIMEOUT), and pushes on until then.
        lost_s: age from which the link counts as lost.
        hold_s: how long a failsafe's `hold` holds before the vehicle goes up.
        low_v: of the battery at rest; lower than that for `low_s`, and it is low until the next start. 13 V is 3.25 V
            a cell, some 7 % of the charge; at 12 V the pack's manufacturer requires a charge. 0 disables the check.
        low_s: as ArduPilot waits (BATT_LOW_TIMER).
        sag_ohm: gives the voltage at rest from that under load. Where it is too small (a pack that is old or cold), a
            burst of thrust looks like a low battery, which is why `low_s` exists.

    Raises:
        ParameterError: a number is out of range; the message names it and the usual range.
    """

    stale_s: Annotated[float, LIMITS["stale_s"]] = 0.25
    lost_s: Annotated[float, LIMITS["lost_s"]] = 2.0
    hold_s: Annotated[float, LIMITS["hold_s"]] = 10.0
    low_v: Annotated[float, LIMITS["low_v"]] = 13.0
    low_s: Annotated[float, LIMITS["low_s"]] = 10.0
    sag_ohm: Annotated[float, LIMITS["sag_ohm"]] = 0.03

    def __post_init__(self) -> None:
        check_record(self, "FailsafeLimits.")
        if self.lost_s < self.stale_s:
            raise ParameterError(
                f"FailsafeLimits.lost_s ({self.lost_s:g}) must not be below stale_s ({self.stale_s:g}).",
                fix="a link is lost some time after the thrusters stop; the defaults are stale_s=0.25, lost_s=2.",
            )


class FailsafeMonitor(NewestControls[Controls]):
    """State machine of the newest controls and of the current failures."""

    def __init__(self, limits: FailsafeLimits, failsafes: Failsafes | None = None) -> None:
        super().__init__(Controls(), limits.stale_s)
        self.limits = limits
        self.failsafes = failsafes or Failsafes()
        # Why the outputs disarmed themselves; empty once they are armed again, or a person has disarmed.
        self.output_fault = ""
        self.is_leaking = False
        self.is_battery_low = False
        self.rest_v: float | None = None  # of the battery, without what the load costs
        # Active causes, or those that last until a person disarms: when each began, and its description.
        self.since_s: dict[str, float] = {}
        self.words: dict[str, str] = {}
        self._resumed_causes: set[str] = set()  # causes after which it has resumed by itself, since a person disarmed
        self._are_back = self._needs_person = False  # outputs that disarmed themselves
        self._low_since_s: float | None = None

    def on_controls(self, controls: Controls, made_s: float) -> None:
        """Take controls, made at a moment of the vehicle's clock; those that disarm end what failures have set."""
        if self.take(controls, made_s) and not controls.is_armed:
            self.output_fault = ""
            for known in (self.since_s, self.words, self._resumed_causes):
                known.clear()  # active causes are detected again

    def on_power(self, power: PowerReading) -> None:
        """Take what the power module measured, and so notice a battery that has been low for long enough."""
        limits = self.limits
        self.rest_v = power.voltage_v + power.current_a * limits.sag_ohm
        if self.rest_v >= limits.low_v:
            self._low_since_s = None
            return
        if self._low_since_s is None:
            self._low_since_s = power.stamp_s
        self.is_battery_low = self.is_battery_low or power.stamp_s - self._low_since_s >= limits.low_s - 1e-9

    # -- what fails ---------------------------------------------------------------------------------------------------

    def update_cause(self, cause: str, words: str, now_s: float) -> None:
        """Set or clear a cause: `words` describes it, "" clears it. It may last longer, depending on its action."""
        if words:
            self.since_s.setdefault(cause, now_s)
            self.words[cause] = words
        elif cause in self.since_s and self._is_over(cause, now_s):
            del self.since_s[cause], self.words[cause]

    def _is_over(self, cause: str, now_s: float) -> bool:
        action = self.failsafes.of(cause)
        if not self.controls.is_armed or action in ("warn", "hold", "surface"):
            return True
        return self._resumes(cause, now_s)

    def _resumes(self, cause: str, now_s: float) -> bool:
        """Return whether the vehicle resumes by itself now that a cause is over; if so, record it."""
        if not self._may_resume(cause, now_s):
            return False
        self._resumed_causes.add(cause)
        return True

    def _may_resume(self, cause: str, now_s: float) -> bool:
        action = self.failsafes.of(cause)
        in_time = not isinstance(action, str) and now_s - self.since_s[cause] <= action.within_s + 1e-9
        return in_time and cause not in self._resumed_causes

    def mark_outputs_lost(self, was_reset: bool, reason: str, is_stopped: bool, now_s: float) -> None:
        """Record that the outputs have disarmed themselves, and the reason as text.

        Args:
            was_reset: because their microcontroller has restarted.
            is_stopped: by an emergency stop: only a person ends it.
        """
        self.output_fault, self._needs_person = reason, is_stopped
        cause = "controller_reset" if was_reset else "line_lost"
        self.since_s.pop(cause, None)  # each time is counted separately
        self.update_cause(cause, reason, now_s)

    def update_outputs(self, state: str, now_s: float) -> None:
        """Update from the state of the outputs (`Health.state`), to detect that disarmed outputs are back."""
        self._are_back = state != "error"
        if not self.output_fault:
            return
        waits_s = now_s - min(self.since_s[cause] for cause in OUTPUTS if cause in self.since_s)
        if waits_s >= self.failsafes.no_rearm_s:
            self.update_cause(
                "no_rearm", f"no person has re-armed the outputs for {self.failsafes.no_rearm_s:g} s", now_s
            )
        if state != "active" or not self._may_arm(now_s):
            return
        self.output_fault = ""
        for cause in [one for one in (*OUTPUTS, "no_rearm") if one in self.since_s]:
            if self._resumes(cause, now_s):
                del self.since_s[cause], self.words[cause]
            else:
                self.since_s[cause] = now_s  # it holds, or goes up, from now on

    def _may_arm(self, now_s: float) -> bool:
        """Return whether the vehicle itself arms outputs that have disarmed themselves."""
        lost = [cause for cause in (*OUTPUTS, "no_rearm") if cause in self.since_s]
        if self._needs_person or not self._are_back or now_s < max(self.since_s[one] for one in lost) + IDLE_S:
            return False
        return any(self.failsafes.of(one) in ("hold", "surface") or self._may_resume(one, now_s) for one in lost)

    # -- what follows -------------------------------------------------------------------------------------------------

    def control_state(self, now_s: float) -> str:
        """Return whose word counts now, by the names above."""
        age_s, limits = self.age_s(now_s), self.limits
        if age_s is not None:
            is_lost = age_s >= limits.lost_s
            began_s = now_s - age_s + limits.lost_s if is_lost else now_s
            self.update_cause("link_lost", f"no controls for {limits.lost_s:g} s" if is_lost else "", began_s)
        self.update_cause("leak", "water in the hull" if self.is_leaking else "", now_s)
        low = f"for {limits.low_s:g} s it had less than {limits.low_v:g} V at rest"
        self.update_cause("low_battery", low if self.is_battery_low else "", now_s)
        if age_s is None or self.is_stopped or not self.controls.is_armed:
            return "idle"
        if self.output_fault and not self._may_arm(now_s):
            return "idle"
        required = {self._required_state(cause, now_s) for cause in self.since_s}
        if self.output_fault:
            return "neutral"  # which is shown to outputs until they are armed
        for control_state in ("surface", "neutral", "hold"):
            if control_state in required:
                return control_state
        return "pilot" if age_s <= limits.stale_s else "neutral"

    def _required_state(self, cause: str, now_s: float) -> str:
        """Return the control state that a cause requires; "warn" if none."""
        action = self.failsafes.of(cause)
        if not isinstance(action, str):
            action = "neutral"
        if cause in OUTPUTS and action == "neutral":
            return "warn"  # they are armed again, so another row required it
        if action == "hold" and now_s - self.since_s[cause] >= self.limits.hold_s:
            return "surface"
        return action
