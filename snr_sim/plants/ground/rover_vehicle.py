"""Numbers of a vehicle on wheels with motors: where they are, what they weigh, how they hang, what turns them.

Body frame: x forward, y left, z up; its origin lies on the ground under the middle of the vehicle when it stands level.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from snr_sim.plants.battery import BatteryPack
from snr_sim.plants.ground.dc_motor import DcMotor
from snr_sim.plants.ground.manipulator import Manipulator
from snr_sim.plants.parameter_limits import GRAMS, IS_ABOVE, LIMITS, MILLIMETRES, Limit, Record, check_valid
from snr_sim.prelude.errors import ParameterError, suggest
from snr_sim.prelude.sums import ordered_sum

PART_KG = Limit(0.0, 500.0, "kg", "a rover that people lift has 50", GRAMS, IS_ABOVE)
PART_M = Limit(-5.0, 5.0, "m", "a rover that people lift is smaller", MILLIMETRES)
WHEEL_M = Limit(0.02, 1.0, "m", "wheels of a rover have 0.05 to 0.3", MILLIMETRES)
SIZE_M = Limit(0.01, 5.0, "m", "a rover that people lift is smaller", MILLIMETRES)
INERTIA = Limit(0.0, 1000.0, "kg m2", "a box of 40 kg and a metre has about 5", {}, IS_ABOVE)
TURN_RAD = Limit(0.0, 1.5, "rad", "a bogie turns by about 0.5", {"degrees": 0.017453292519943295}, IS_ABOVE)
AXES = ("x", "y", "z")
OWN_MOTOR, NO_MOTOR = "own", "none"


@dataclass(frozen=True)
class Wheel(Record, who="The wheel's "):
    """A wheel.

    Args:
        name: of it, and of its motor if it has one of its own, as "LF".
        position_m: of the middle of its axle.
        radius_m, width_m: of the tyre when nothing presses it.
        mass_kg: with the motor.
        hangs_on: "chassis", "rocker" or "bogie", those of its side.
        friction_scale: factor on the ground's friction; 0 is a caster.
        motor: "own"; "none" rolls freely; or the name of the wheel whose motor turns this one, too, by a chain.
    """

    name: str
    position_m: Annotated[tuple[float, float, float], PART_M, AXES]
    radius_m: Annotated[float, WHEEL_M]
    width_m: Annotated[float, SIZE_M]
    mass_kg: Annotated[float, PART_KG]
    hangs_on: str = "chassis"
    friction_scale: Annotated[float, LIMITS["grip"]] = 1.0
    motor: str = OWN_MOTOR

    def __post_init__(self) -> None:
        super().__post_init__()
        is_name = isinstance(self.name, str) and self.name.isidentifier()
        check_valid(is_name, "A wheel's name", self.name, 'give one of letters and digits, as "LF".')
        is_part = self.hangs_on in ("chassis", "rocker", "bogie")
        check_valid(is_part, f"What wheel {self.name} hangs on", self.hangs_on, 'give "chassis", "rocker" or "bogie".')
        is_in_line = self.motor == NO_MOTOR and self.hangs_on == "chassis"
        what = f"The position_m of wheel {self.name}"
        check_valid(self.position_m[1] != 0.0 or is_in_line, what, self.position_m, "y is not 0, or it is a caster.")

    @property
    def side(self) -> str:
        """Return "left" or "right"."""
        return "left" if self.position_m[1] > 0.0 else "right"


@dataclass(frozen=True)
class RockerBogie(Record, who="The suspension's "):
    """A rocker on each side, with a bogie at its rear end; a differential turns one rocker down as the other turns up.

    So the chassis has the mean of both rockers' angles.

    Args:
        rocker_pivot_m, bogie_pivot_m: x and z of the pivots.
        rocker_kg, bogie_kg: of those of one side.
        limit_rad: how far both turn.
    """

    rocker_pivot_m: Annotated[tuple[float, float], PART_M, ("x", "z")]
    bogie_pivot_m: Annotated[tuple[float, float], PART_M, ("x", "z")]
    rocker_kg: Annotated[float, PART_KG]
    bogie_kg: Annotated[float, PART_KG]
    limit_rad: Annotated[float, TURN_RAD] = 0.6


@dataclass(frozen=True)
class RoverVehicle(Record, who="The rover's "):
    """A vehicle.

    Args:
        chassis_kg: mass of the chassis with all that is fixed to it: without rockers, bogies and wheels.
        center_of_mass_m: of the chassis.
        inertia_kgm2: of the chassis about its center of mass: roll, pitch, yaw.
        size_m, center_m: of the box that is its body, for contacts and pictures.
        wheels: all.
        motor: of each wheel that has its own.
        battery: of all.
        electronics_a: current of everything but the motors.
        suspension: None is a rigid one.
        arm: None if there is not one; its mass comes on top of the chassis'.

    Raises:
        ParameterError: a number is out of range, names repeat, or what a wheel hangs on or is turned by is not there.
    """

    chassis_kg: Annotated[float, PART_KG]
    center_of_mass_m: Annotated[tuple[float, float, float], PART_M, AXES]
    inertia_kgm2: Annotated[tuple[float, float, float], INERTIA, ("roll", "pitch", "yaw")]
    size_m: Annotated[tuple[float, float, float], SIZE_M, AXES]
    center_m: Annotated[tuple[float, float, float], PART_M, AXES]
    wheels: Annotated[tuple[Wheel, ...], "give a tuple of Wheel(...)."]
    motor: Annotated[DcMotor, "give a DcMotor(...)."]
    battery: Annotated[BatteryPack, "give a BatteryPack(...)."]
    electronics_a: Annotated[float, LIMITS["electronics_a"]] = 2.0
    suspension: Annotated[RockerBogie | None, "give a RockerBogie(...), or None."] = None
    arm: Annotated[Manipulator | None, "give a Manipulator(...), or None."] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        names = [wheel.name for wheel in self.wheels]
        check_valid(len(names) > 2, "The rover's wheels", names, "give at least three.")
        check_valid(len(set(names)) == len(names), "The names of the rover's wheels", names, "each has its own.")
        i, j, k = sorted(self.inertia_kgm2)
        check_valid(i + j >= k, "The rover's inertia_kgm2", self.inertia_kgm2, "no body has more than the sum of two.")
        motors = [OWN_MOTOR, NO_MOTOR, *(wheel.name for wheel in self.motor_wheels)]
        check_valid(len(motors) > 2, "The rover's motors", [wheel.motor for wheel in self.wheels], 'give one "own".')
        for wheel in self.wheels:
            if wheel.motor not in motors:
                raise ParameterError(
                    f"The motor of wheel {wheel.name} is '{wheel.motor}'.", fix=suggest(wheel.motor, motors)
                )
            if wheel.hangs_on != "chassis" and self.suspension is None:
                raise ParameterError(
                    f"Wheel {wheel.name} hangs on a {wheel.hangs_on}, and the rover has no suspension.",
                    fix='give suspension=RockerBogie(...), or hangs_on="chassis".',
                )
        for side in ("left", "right") if self.suspension else ():
            on_bogie = [wheel.name for wheel in self.wheels if (wheel.side, wheel.hangs_on) == (side, "bogie")]
            check_valid(
                len(on_bogie) > 0, f"The list of wheels of the {side} bogie", on_bogie, 'give one hangs_on="bogie".'
            )

    @property
    def motor_wheels(self) -> tuple[Wheel, ...]:
        """Return the wheels that have a motor of their own: a command has a value for each."""
        return tuple(wheel for wheel in self.wheels if wheel.motor == OWN_MOTOR)

    @property
    def mass_kg(self) -> float:
        """Mass of all."""
        hung = 2.0 * (self.suspension.rocker_kg + self.suspension.bogie_kg) if self.suspension else 0.0
        carried = self.arm.mass_kg if self.arm else 0.0
        return self.chassis_kg + carried + hung + ordered_sum(wheel.mass_kg for wheel in self.wheels)
