"""Slew rate limits: for several values that belong together, and for a setpoint that moves to a target.

Values that belong together all make the same fraction of their change, limited by the largest change. Their ratios
therefore stay valid during the change: thrusts that turn a vehicle do not push it sideways for a moment.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.sums import ordered_sum


class SlewRateLimiter:
    """Slew rate limiter of a list of values.

    Args:
        max_rate_per_s: maximum change of any value per second.
        start: initial values.

    Raises:
        ParameterError: the limit is not positive.

    >>> slew = SlewRateLimiter(max_rate_per_s=10.0, start=[0.0, 0.0])
    >>> slew.update([4.0, -2.0], dt_s=0.1)
    [1.0, -0.5]
    """

    def __init__(self, max_rate_per_s: float, start: Sequence[float]) -> None:
        if not max_rate_per_s > 0.0:
            raise ParameterError(f"A slew limit of {max_rate_per_s!r} per second.", fix="a number above 0.")
        self.max_rate_per_s: float = max_rate_per_s
        self._start = list(start)
        self.reset()

    def reset(self) -> None:
        """Set the values to the start, without a limit."""
        self.values: list[float] = list(self._start)

    def update(self, targets: Sequence[float], dt_s: float) -> list[float]:
        """Return the values for this time step, moved towards the targets.

        Raises:
            ParameterError: the number of values changes, one is not finite, or dt_s is negative.
        """
        if len(targets) != len(self.values) or not (math.isfinite(ordered_sum(targets)) and dt_s >= 0.0):
            raise ParameterError(
                f"A slew limit of {len(self.values)} values got {list(targets)!r} after {dt_s!r} s.",
                fix="as many finite numbers, and a time that is not negative.",
            )
        steps = [new - old for new, old in zip(targets, self.values, strict=True)]
        largest_step = max(map(abs, steps), default=0.0)
        max_step = self.max_rate_per_s * dt_s
        scale = 1.0 if largest_step <= max_step else max_step / largest_step
        self.values = [old + scale * step for old, step in zip(self.values, steps, strict=True)]
        return self.values


def approach(left: float, speed: float, brake: float, dt_s: float) -> float:
    """Return how far a setpoint moves in a time step, at limited speed and with a deceleration before its target.

    A setpoint that jumps winds up the integral of its controller, and the robot overshoots; one that moves does not.

    Args:
        left: remaining distance, with its sign.
        speed: maximum speed.
        brake: deceleration, in speed per second.

    >>> approach(5.0, speed=0.5, brake=0.1, dt_s=0.1), approach(-0.05, speed=0.5, brake=0.1, dt_s=0.1)
    (0.05, -0.010000000000000002)
    """
    max_step = min(speed, math.sqrt(2.0 * brake * abs(left))) * dt_s
    return min(max_step, max(-max_step, left))
