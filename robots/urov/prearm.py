"""Pre-arm checks: why the vehicle may not be armed before the dive, as text, so that the pilot knows what to check.

Only the first arming is checked. In the water a person who arms has a reason, and failsafes do the rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from snr_sim import Page

from .failsafe_monitor import FailsafeMonitor
from .readings import Outputs, Readings

CLOCK_S = 1.0  # readings that were measured so long before they came: their clock is another one
WARM_UP_S = 2.0  # after the start missing readings may still arrive: arming waits for so long


def failing_checks(
    failsafe: FailsafeMonitor, readings: Readings, ages_s: Mapping[str, float], outputs: Outputs | None
) -> list[str]:
    """Return a description of each failing check, from the ages of pages; none if the vehicle may be armed."""
    failing = readings.missing(ages_s)
    if failsafe.rest_v is not None and failsafe.rest_v < failsafe.limits.low_v:
        failing.append(f"battery: {failsafe.rest_v:.1f} V at rest, less than {failsafe.limits.low_v:g} V")
    for cause, what in (("nonsense", "sensors"), ("disk_full", "disk"), ("overloaded", "computer"), ("leak", "leak")):
        if cause in failsafe.since_s:
            failing.append(f"{what}: {failsafe.words[cause]}")
    failing += [
        f"clock: {key} is stamped {late_s:.1f} s before it came"
        for key, late_s in _late_s(readings.newest, readings.pages).items()
        if late_s > CLOCK_S
    ]
    if outputs is not None and outputs.state == "error":
        failing.append(f"outputs and their firmware: {outputs.fault.partition(chr(10))[0]}")
    return failing


def _late_s(newest: Mapping[str, Any], pages: Mapping[str, Page]) -> dict[str, float]:
    """Return how long before its page each reading was measured, from its stamp."""
    return {key: pages[key].created_at_s - reading.stamp_s for key, reading in newest.items() if key in pages}


class PreArm:
    """Lets the first arming through once all is well. What was refused is not made up for later: disarm, arm again."""

    def __init__(self) -> None:
        self.has_armed = False
        self._refused = ""  # reason of the refusal; reported until the pilot disarms
        self._start_s = math.inf

    def refusal_reason(self, is_armed: bool, failing: list[str], now_s: float) -> str | None:
        """Return why the vehicle is not armed; "" if it is only not armed yet; None if nothing is against it.

        Controls ask for `is_armed`; `failing_checks` found what is `failing`.
        """
        self._start_s = min(self._start_s, now_s)
        if not is_armed or self.has_armed:
            self._refused = ""
            return None
        if self._refused:
            return self._refused
        if failing and now_s < self._start_s + WARM_UP_S:
            return ""
        if failing:
            self._refused = f"Not armed: {'; '.join(failing)}. Disarm, then arm again."
            return self._refused
        self.has_armed = True
        return None
