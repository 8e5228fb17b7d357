"""From how the rover is to move to the values of its wheels.

    speed and rate of turning --> wheel_rates --.
    shares of both sides ------> side_values ---+--> braked --> values of page "drive"
    yaw --> HeadingLoop: the rate of turning that keeps a heading

Six wheels in two rows slide sideways when it turns, so it turns slower than wheels without friction sideways would:
its effective track is wider than the distance between the wheels (Wong, Theory of Ground Vehicles, chapter 6).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from snr_sim.scenario import wrap_rad

from .parameters import RoverParameters
from .sticks import Sides

TOP_V = 20.0  # of a battery that is nearly empty
EFFECTIVE_TRACK = 2.5  # over the track, on level firm ground: 2.4 in tight curves of this plant, 3.1 in gentle ones
TURN_PER_S = 1.0  # how fast it turns back to its heading
MAX_LEAD_RAD = 0.5  # how far a stick moves the heading ahead of the rover, which may be held by a rock
# Full current from 6 rad/s on. Speeds are 50 ms old and more, and with three times as much a lifted wheel would swing.
BRAKE_A_PER_RADPS = 1.0


def wheel_rates(
    parameters: RoverParameters, speed_mps: float, turn_radps: float = 0.0, track_factor: float = EFFECTIVE_TRACK
) -> list[float]:
    """Return the rate of each wheel [rad/s] for a speed ahead and a rate of turning to the left.

    All are scaled down together if one would be faster than its motor can, so that the curve stays the same.

    Args:
        track_factor: effective track over the distance of the wheels; `Odometry` learns it.
    """
    wheels = parameters.vehicle.motor_wheels
    top = parameters.vehicle.motor.top_radps(TOP_V)
    rates = [(speed_mps - track_factor * turn_radps * wheel.position_m[1]) / wheel.radius_m for wheel in wheels]
    return _scaled(rates, top)


def side_values(parameters: RoverParameters, mode: str, sides: Sides) -> list[float]:
    """Return the value of each wheel for shares of the limit: rad/s, A, or -1 to 1 of the voltage."""
    vehicle = parameters.vehicle
    shares = [(wheel, sides.left if wheel.side == "left" else sides.right) for wheel in vehicle.motor_wheels]
    if mode == "speed":
        return [share * parameters.limit_mps / wheel.radius_m for wheel, share in shares]
    return [share * (vehicle.motor.limit_a if mode == "current" else 1.0) for _, share in shares]


def braked(
    parameters: RoverParameters, mode: str, values: Sequence[float], sides: Sequence[str], speeds: Sequence[float]
) -> list[float]:
    """Return the values, with those of the braked sides replaced by what stops their wheels in that mode.

    That is a speed of 0, which the motors keep with all their current; no voltage; or a current against the turning.

    Args:
        sides: that are braked, "left" and "right".
        speeds: of the wheels [rad/s].
    """
    limit_a = parameters.vehicle.motor.limit_a

    def stopping(speed: float) -> float:
        return -min(limit_a, max(-limit_a, BRAKE_A_PER_RADPS * speed)) if mode == "current" else 0.0

    wheels = zip(parameters.vehicle.motor_wheels, values, speeds, strict=True)
    return [stopping(speed) if wheel.side in sides else value for wheel, value, speed in wheels]


def full_brake(parameters: RoverParameters) -> dict[str, Any]:
    """Return the page "drive" that stops all wheels as hard as their motors can."""
    vehicle = parameters.vehicle
    return {"mode": "brake", "values": [vehicle.motor.limit_a] * len(vehicle.motor_wheels)}


class HeadingLoop:
    """Keeps a heading, which a rate of turning moves, so that a turn ends where it was to end."""

    def __init__(self) -> None:
        self.heading_rad: float | None = None

    def reset(self) -> None:
        """Forget the heading; the next one is where the rover then looks."""
        self.heading_rad = None

    def turn_radps(self, asked_radps: float, yaw_rad: float, dt_s: float) -> float:
        """Return the rate of turning for now.

        Args:
            asked_radps: how fast the heading is to turn to the left.
            yaw_rad: where the rover looks.
            dt_s: since the last call.
        """
        if self.heading_rad is None:
            self.heading_rad = yaw_rad
        lead = wrap_rad(self.heading_rad + asked_radps * dt_s - yaw_rad)
        lead = min(MAX_LEAD_RAD, max(-MAX_LEAD_RAD, lead))
        self.heading_rad = wrap_rad(yaw_rad + lead)
        return asked_radps + TURN_PER_S * lead


def _scaled(rates: Sequence[float], top: float) -> list[float]:
    fastest = max(map(abs, rates))
    scale = top / fastest if fastest > top else 1.0
    return [scale * rate for rate in rates]
