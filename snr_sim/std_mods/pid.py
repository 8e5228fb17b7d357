"""A PID controller: proportional to the error, its integral, and the rate of the measurement.

    output = feed forward + kp * error + ki * integral of error - kd * rate of the measurement

Two properties that the formula does not show and every robot needs:
- The derivative is of the measurement, not of the error, so that a new setpoint does not cause a derivative kick.
- While the output is saturated the integral does not grow further in that direction (anti-windup): otherwise the robot
  would overshoot until it has shrunk again.
"""

from __future__ import annotations

import math

from snr_sim.prelude.angles import wrap_rad
from snr_sim.prelude.errors import ParameterError


class Pid:
    """PID controller of one quantity.

    Args:
        kp: output per error.
        ki: output per second of error.
        kd: output per rate of the measurement.
        limits: minimum and maximum output.
        derivative_filter_s: time constant of the low-pass filter on a rate computed from measurements; a given rate is
            not filtered.
        is_angle: whether the error is wrapped to the shorter direction [rad].

    Raises:
        ParameterError: a number is not finite, or the limits are swapped.

    >>> depth = Pid(kp=10.0, ki=1.0, limits=(-40.0, 40.0))
    >>> depth.update(setpoint=2.0, measurement=1.0, dt_s=0.1)
    10.1
    """

    def __init__(
        self,
        kp: float,
        ki: float = 0.0,
        kd: float = 0.0,
        limits: tuple[float, float] = (-math.inf, math.inf),
        derivative_filter_s: float = 0.0,
        is_angle: bool = False,
    ) -> None:
        for name, value in (("kp", kp), ("ki", ki), ("kd", kd), ("derivative_filter_s", derivative_filter_s)):
            if not math.isfinite(value):
                raise ParameterError(f"A PID controller with {name}={value!r}.", fix="a number.")
        if derivative_filter_s < 0.0:
            raise ParameterError(
                f"A PID controller with derivative_filter_s={derivative_filter_s!r}.", fix="0 or more."
            )
        if not limits[0] < limits[1]:
            raise ParameterError(f"A PID controller with limits={limits!r}.", fix="(least, most).")
        self.kp: float = kp
        self.ki: float = ki
        self.kd: float = kd
        self.limits: tuple[float, float] = limits
        self.derivative_filter_s: float = derivative_filter_s
        self.is_angle: bool = is_angle
        self.reset()

    def reset(self, integral: float = 0.0) -> None:
        """Reset the state; set the integral, in units of the output, for example to compensate a weight."""
        self.integral: float = integral
        self._before: float | None = None
        self._rate = 0.0

    def update(
        self, setpoint: float, measurement: float, dt_s: float, rate: float | None = None, feed_forward: float = 0.0
    ) -> float:
        """Return the output for this time step.

        Args:
            setpoint: target value.
            measurement: measured value.
            dt_s: time since the previous update.
            rate: measured rate of the measurement; by default it is computed from the previous measurement.
            feed_forward: output that is added to the controller's.

        Raises:
            ParameterError: dt_s is not positive, or a value is not finite.
        """
        if not (dt_s > 0.0 and math.isfinite(setpoint) and math.isfinite(measurement)):
            raise ParameterError(
                f"A PID controller got setpoint={setpoint!r}, measurement={measurement!r}, dt_s={dt_s!r}.",
                fix="pass finite numbers and a dt_s greater than 0; find where the first invalid value comes from.",
            )
        error = self._difference(setpoint, measurement)
        rate = self._estimate_rate(measurement, dt_s) if rate is None else rate
        self._before = measurement
        pushed = feed_forward + self.kp * error - self.kd * rate
        growth = self.ki * error * dt_s
        unlimited = pushed + self.integral + growth
        beyond = unlimited - self._limited(unlimited)
        if beyond * growth <= 0.0:  # within the limits, or moving back to them
            self.integral += growth
        return self._limited(pushed + self.integral)

    def _limited(self, output: float) -> float:
        return min(self.limits[1], max(self.limits[0], output))

    def _estimate_rate(self, measurement: float, dt_s: float) -> float:
        if self._before is None:
            return 0.0
        newest = self._difference(measurement, self._before) / dt_s
        self._rate += (newest - self._rate) * dt_s / (self.derivative_filter_s + dt_s)
        return self._rate

    def _difference(self, one: float, other: float) -> float:
        return wrap_rad(one - other) if self.is_angle else one - other
