"""A complementary filter: a gyroscope for the quick, something slower and steadier for the long run.

A gyroscope's rate, summed up, is smooth and quick, and drifts away. Gravity or a magnetic field say where down and
north are, without drift, but shaken by every acceleration and disturbance. The filter follows the sum of rates, and
lets itself be pulled to the steady measurement with a time constant: what is faster than it comes from the gyroscope,
what is slower from the other. The same for a whole attitude is `MahonyFilter` (prelude/attitude_filter.py).
"""

from __future__ import annotations

import math

from snr_sim.prelude.angles import wrap_rad
from snr_sim.prelude.errors import ParameterError


class ComplementaryFilter:
    """One quantity of which both the rate and, slowly or noisily, the value are measured.

    Args:
        time_constant_s: of the pull to the measured value. A bias b of the rate leaves an error of b times this.
        is_angle: values are angles [rad], and the pull goes the shorter way round.

    Raises:
        ParameterError: the time constant is not above 0.

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
        self.time_constant_s = time_constant_s
        self.is_angle = is_angle
        self.estimate: float | None = None

    def reset(self) -> None:
        """Forget; the next measured value is taken as it is."""
        self.estimate = None

    def update(self, rate: float, measured: float, dt_s: float) -> float:
        """Return the estimate for now.

        Args:
            rate: of the quantity, since the update before.
            measured: the quantity, as the slow or noisy sensor has it now.
            dt_s: since the update before.

        Raises:
            ParameterError: a value is not finite, or time goes back.
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
        # The share that a first-order lag covers in this time, exactly: no step is too long for it.
        moved -= away * math.expm1(-dt_s / self.time_constant_s)
        self.estimate = wrap_rad(moved) if self.is_angle else moved
        return self.estimate
