"""From how the rover is to move to the rates of its wheels.

Six wheels in two rows slide sideways when it turns, so it turns slower than wheels without friction sideways would:
its effective track is wider than the distance between the wheels (Wong, Theory of Ground Vehicles, chapter 6).
"""

from __future__ import annotations

from collections.abc import Sequence

from .parameters import RoverParameters

TOP_V = 20.0  # of a battery that is nearly empty
EFFECTIVE_TRACK = 2.5  # over the track, on level firm ground: 2.4 in tight curves of this plant, 3.1 in gentle ones


def wheel_rates(parameters: RoverParameters, speed_mps: float, turn_radps: float = 0.0) -> list[float]:
    """Return the rate of each wheel [rad/s] for a speed ahead and a rate of turning to the left.

    All are scaled down together if one would be faster than its motor can, so that the curve stays the same.
    """
    wheels = parameters.vehicle.motor_wheels
    top = parameters.vehicle.motor.top_radps(TOP_V)
    rates = [(speed_mps - EFFECTIVE_TRACK * turn_radps * wheel.position_m[1]) / wheel.radius_m for wheel in wheels]
    return _scaled(rates, top)


def _scaled(rates: Sequence[float], top: float) -> list[float]:
    fastest = max(map(abs, rates))
    scale = top / fastest if fastest > top else 1.0
    return [scale * rate for rate in rates]
