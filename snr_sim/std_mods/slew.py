"""Slew rate limits: for several values that belong together, and for a setpoint that moves to a target.

Values that belong together all make the same fraction of their change, limited by the largest change. Their ratios
therefore stay valid during the change: thrusts that turn a vehicle do not push it sideways for a moment.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.sums import ordered_sum


class SlewLimit:
    """Slew rate limiter of a list of values.

    Args:
        most_per_s: maximum change of any value per second.
        start: initial values.

    Raises:
        ParameterError: the limit is not positive.

    >>> slew = SlewLimit(most_per_s=10.0, start=[0.0, 0.0])
    >>> slew.update([4.0, -2.0], dt_s=0.1)
    [1.0, -0.5]
    """

    def __init__(self, most_per_s: float, start: Sequence[float]) -> None:
        if not most_per_s > 0.0:
            raise ParameterError(f"A slew limit of {most_per_s!r} per second.", fix="a number above 0.")
        self.most_per_s = most_per_s
        self._start = list(start)
        self.reset()

    def reset(self) -> None:
        """Set the values to the start, without a limit."""
        self.values = list(self._start)

    def update(self, wanted: Sequence[float], dt_s: float) -> list[float]:
        """Return the values for this time step, moved towards the targets.

        Raises:
            ParameterError: the number of values changes, one is not finite, or dt_s is negative.
        """
        if len(wanted) != len(self.values) or not (math.isfinite(ordered_sum(wanted)) and dt_s >= 0.0):
            raise ParameterError(
                f"A slew limit of {len(self.values)} values got {list(wanted)!r} after {dt_s!r} s.",
                fix="as many finite numbers, and a time that is not negative.",
            )
        ways = [new - old for new, old in zip(wanted, self.values, strict=True)]
        longest = max(map(abs, ways), default=0.0)
        most = self.most_per_s * dt_s
        share = 1.0 if longest <= most else most / longest
        self.values = [old + share * way for old, way in zip(self.values, ways, strict=True)]
        return self.values


def approach(left: float, speed: float, brake: float, dt_s: float) -> float:
    """Return how far a setpoint moves in a time step, at limited speed and with a deceleration before its target.

    A setpoint that jumps winds up the integral of its controller, and the robot overshoots; one that moves does not.

    Args:
        left: remaining distance, with its sign.
        speed: maximum speed.
        brake: deceleration, in speed per second.
        dt_s: time step.

    >>> approach(5.0, speed=0.5, brake=0.1, dt_s=0.1), approach(-0.05, speed=0.5, brake=0.1, dt_s=0.1)
    (0.05, -0.010000000000000002)
    """
    most = min(speed, math.sqrt(2.0 * brake * abs(left))) * dt_s
    return min(most, max(-most, left))
