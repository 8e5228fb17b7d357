"""Numbers of a small vehicle with two driven wheels and a caster, and where it starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from snr_sim.plants.ground.room import AXES, PLACE_M, Point
from snr_sim.plants.parameter_limits import DEGREES, GRAMS, IS_ABOVE, LIMITS, MILLIMETRES, Limit, Record
from snr_sim.prelude.errors import ParameterError

EXPLORER_KG = Limit(0.01, 100.0, "kg", "a robot of toy bricks has about 0.7", GRAMS)
PART_M = Limit(-3.0, 3.0, "m", "the robot is smaller", MILLIMETRES)
LENGTH_M = Limit(0.0, 3.0, "m", "the robot is smaller", MILLIMETRES, IS_ABOVE)
DRIVE_MPS = Limit(0.0, 5.0, "m/s", "one that drives indoors is slower", {"centimetres a second": 1e-2}, IS_ABOVE)
ECHO_M = Limit(0.0, 100.0, "m", "ultrasonic sensors reach some metres", {"centimetres": 1e-2}, IS_ABOVE)
ECHO_RAD = Limit(0.0, 0.5 * math.pi, "rad", "it is half the angle of a cone", DEGREES)


@dataclass(frozen=True)
class Explorer(Record, who="The explorer's "):
    """A vehicle seen from above. Body frame: x forward, y left, origin in the centre of mass.

    Args:
        mass_kg, inertia_kgm2: about the vertical through the centre of mass.
        size_m: length and width of its body, a rectangle around the origin.
        height_m: of the body, for the viewer.
        axle_m: x of the two driven wheels, behind the centre of mass, so negative.
        caster_m: x of the caster, in front; it turns without friction.
        track_m: between the two wheels.
        wheel_radius_m: of them.
        full_speed_mps: of a wheel at full command.
        lag_s: of a wheel's speed, first order.
        grip: friction coefficient of the wheels on the floor.
        wall_friction: that of the body at walls.
        echo_range_m, echo_half_angle_rad: reach and half the angle of the ultrasonic sensor, in the middle of the
            front.
        bar_m: how far the two touch bars stand out from the front when nothing touches them.

    Raises:
        ParameterError: a number is out of range, or the centre of mass is not between axle and caster.
    """

    mass_kg: Annotated[float, EXPLORER_KG]
    inertia_kgm2: Annotated[float, Limit(0.0, 100.0, "kg m2", "", {}, IS_ABOVE)]
    size_m: Annotated[Point, LENGTH_M, ("length", "width")]
    height_m: Annotated[float, LENGTH_M]
    axle_m: Annotated[float, PART_M]
    caster_m: Annotated[float, PART_M]
    track_m: Annotated[float, LENGTH_M]
    wheel_radius_m: Annotated[float, LENGTH_M]
    full_speed_mps: Annotated[float, DRIVE_MPS]
    lag_s: Annotated[float, LIMITS["lag_s"]]
    grip: Annotated[float, LIMITS["grip"]]
    wall_friction: Annotated[float, LIMITS["grip"]]
    echo_range_m: Annotated[float, ECHO_M]
    echo_half_angle_rad: Annotated[float, ECHO_RAD]
    bar_m: Annotated[float, LENGTH_M]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.axle_m < 0.0 < self.caster_m:
            raise ParameterError(
                f"The explorer's axle is at x = {self.axle_m} m, its caster at {self.caster_m} m.",
                fix="the centre of mass, x = 0, is between them: it would fall over.",
            )

    @property
    def axle_share(self) -> float:
        """Share of the weight that the driven wheels carry, by the law of the lever."""
        return self.caster_m / (self.caster_m - self.axle_m)


@dataclass(frozen=True)
class DriveStart(Record, who="The start's "):
    """Where a drive begins, at rest.

    Args:
        position_m: x and y of the centre of mass.
        heading_rad: 0 to the east, positive to the left.
    """

    position_m: Annotated[Point, PLACE_M, AXES]
    heading_rad: Annotated[float, LIMITS["angle_rad"]] = 0.0
