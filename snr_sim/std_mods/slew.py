"""Limits on how fast something changes: several values that go together, or a setpoint on its way to another one.

Values that go together all take the same share of their way, the one that the slowest can keep up with. So on the way
they still mean the same thing, only less of it: thrusts that turn a vehicle do not push it aside for a moment.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.sums import ordered_sum


class SlewLimit:
    """Limits how fast a list of values changes.

    Args:
        most_per_s: change of any of them, per second.
        start: what they are at first.

    Raises:
        ParameterError: the limit is not above 0.

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
        """Go back to the start at once."""
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
    """Return how far a setpoint moves in a time: no faster than a robot can follow, and slower before it arrives.

    A setpoint that jumps fills the integral of its controller, and the robot overshoots; one that moves does not.

    Args:
        left: the way that is left, with its sign.
        speed: at most.
        brake: how fast it slows down, in speed per second.
        dt_s: how long.

    >>> approach(5.0, speed=0.5, brake=0.1, dt_s=0.1), approach(-0.05, speed=0.5, brake=0.1, dt_s=0.1)
    (0.05, -0.010000000000000002)
    """
    most = min(speed, math.sqrt(2.0 * brake * abs(left))) * dt_s
    return min(most, max(-most, left))
