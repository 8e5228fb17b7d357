"""A complementary filter: combines a gyroscope's rate with a drift-free but noisy measurement.

A gyroscope's rate, integrated, is smooth and fast, but drifts. Gravity or a magnetic field give the directions of down
and north without drift, but disturbed by every acceleration and magnetic disturbance. The filter integrates the rate
and corrects towards the drift-free measurement with a time constant: faster changes come from the gyroscope, slower
ones from the other sensor. The same for a whole attitude is `MahonyFilter` (prelude/attitude_filter.py).
"""

from __future__ import annotations

import math

from snr_sim.prelude.angles import wrap_rad
from snr_sim.prelude.errors import ParameterError


class ComplementaryFilter:
    """Complementary filter of one quantity, whose rate and, slowly or noisily, value are measured.

    Args:
        time_constant_s: of the correction towards the measured value. A bias b of the rate leaves an error of b times
            this.
        is_angle: whether values are angles [rad], corrected in the shorter direction.

    Raises:
        ParameterError: the time constant is not positive.

    >>> heading = ComplementaryFilter(time_constant_s=2.0)
    >>> heading.update(rate=0.0, measured=1.0, dt_s=0.1)  # the first value is taken as it is
    1.0
    >>> round(heading.update(rate=0.5, measured=1.05, dt_s=0.1), 6)
    1.05
    """

    def __init__(self, time_constant_s: float, is_angle: bool = False) -> None:
        if not (math.isfinite(time_constant_s) and time_constant_s > 0.0):
            raise ParameterError(
                f"A complementary filter with time_constant_s={time_constant_s!r}.", fix="seconds above 0, such as 2.0."
            )
        self.time_constant_s: float = time_constant_s
        self.is_angle: bool = is_angle
        self.estimate: float | None = None

    def reset(self) -> None:
        """Reset the filter; the next measured value becomes the estimate."""
        self.estimate = None

    def update(self, rate: float, measured: float, dt_s: float) -> float:
        """Return the estimate after a time step, from the rate in it and the value that the slow or noisy sensor has.

        Raises:
            ParameterError: a value is not finite, or dt_s is negative.
        """
        if not (dt_s >= 0.0 and math.isfinite(rate) and math.isfinite(measured)):
            raise ParameterError(
                f"A complementary filter got rate={rate!r}, measured={measured!r}, dt_s={dt_s!r}.",
                fix="finite numbers and a dt_s that is not negative.",
            )
        if self.estimate is None:
            self.estimate = measured
            return measured
        moved = self.estimate + rate * dt_s
        away = measured - moved
        if self.is_angle:
            away = wrap_rad(away)
        # The exact step response of a first-order lag, so it is stable for any step length.
        moved -= away * math.expm1(-dt_s / self.time_constant_s)
        self.estimate = wrap_rad(moved) if self.is_angle else moved
        return self.estimate
