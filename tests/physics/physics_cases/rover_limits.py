"""The rover where wheels leave the ground: on a table that tilts, and with a wheel over a ditch."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np

from snr_sim.plants.ground.rover import Rover, RoverStart
from snr_sim.plants.ground.rover_vehicle import RoverVehicle
from snr_sim.plants.ground.terramechanics import Coulomb

from .case import Case
from .rover_runs import (
    GRAVITY,
    LEFT,
    MOTOR,
    REGULARISED,
    SOFT,
    STRONG,
    VEHICLE,
    Part,
    go,
    made,
    mass_height_m,
    parts_of_a_side,
    rates,
    rolling_radii_m,
    shared,
    slope,
    suspension,
)

# Without rockers: a bogie that carries little turns on its pivot, and a rover on its nose then has no closed form.
RIGID = replace(STRONG, suspension=None, wheels=tuple(replace(wheel, hangs_on="chassis") for wheel in VEHICLE.wheels))
LOOSE = replace(VEHICLE, motor=replace(MOTOR, friction_nm=0.0))
# Over the ditch is a wheel with a small radius; its bogie turns to its stop, and does not reach the ground.
DITCH = replace(
    VEHICLE,
    wheels=tuple(replace(wheel, radius_m=0.08) if wheel.name == "LM" else wheel for wheel in VEHICLE.wheels),
    suspension=replace(suspension(), limit_rad=0.01),
)
ON_GROUND = [i for i, wheel in enumerate(DITCH.wheels) if wheel.name != "LM"]


def tilt(rover: Rover, to: tuple[float, float], degrees: float, upper: list[int]) -> float:
    """Turn gravity towards a direction until the upper wheels carry nothing: a tilt table; return its angle then.

    It tilts fast until 2 degrees before `degrees`, then by half a degree a second.
    """
    gravity = rover._world.model.opt.gravity
    angle = 0.0
    while angle < degrees + 5.0:
        angle += (20.0 if angle < degrees - 2.0 else 0.5) * rover.step_s
        along = GRAVITY * math.sin(math.radians(angle))
        gravity[:] = along * to[0], along * to[1], -GRAVITY * math.cos(math.radians(angle))
        loads = go(rover, rover.step_s).contacts.read_loads()
        if angle > degrees - 2.0 and sum(loads[i] for i in upper) == 0.0:
            return angle
    return math.inf


def tipping() -> list[Case]:
    """A vehicle tips where its weight points at the lower wheels: atan(their distance / height), with locked wheels.

    With rockers one wheel lifts earlier: what a side carries less is taken off at the pivot of its rocker, and of that
    the front wheel has the share of a lever. Wheels roll freely there, as locked ones brace a side against its rocker.
    """
    axle_x, half_m, axle_z = VEHICLE.wheels[0].position_m
    (rocker_x, _), (bogie_x, _) = suspension().rocker_pivot_m, suspension().bogie_pivot_m
    share = (rocker_x - bogie_x) / (axle_x - bogie_x)
    on_front = shared(parts_of_a_side()[0], axle_x, bogie_x)[0]
    lifts = on_front / (0.5 * VEHICLE.mass_kg * GRAVITY * share)
    wheels_kg = sum(wheel.mass_kg for wheel in RIGID.wheels)
    rigid_z = (RIGID.chassis_kg * RIGID.center_of_mass_m[2] + wheels_kg * axle_z) / RIGID.mass_kg
    rigid_x = sum(wheel.mass_kg * wheel.position_m[0] for wheel in RIGID.wheels) / RIGID.mass_kg
    to_side, to_nose = (0.0, -1.0), (1.0, 0.0)

    def case(
        name: str, vehicle: RoverVehicle, brake_a: float, slope: float, to: tuple[float, float], upper: list[int]
    ) -> Case:
        degrees = math.degrees(math.atan(slope))

        def run(step_s: float) -> float:
            rover = go(made(step_s, soil=Coulomb(3.0), vehicle=vehicle), 0.1, "brake", brake_a)
            return tilt(rover, to, degrees, upper)

        return Case("Tipping", name, degrees, "deg", run, 0.5 / degrees, f"half a degree: {SOFT}")

    return [
        case("to the side: the upper front wheel lifts", LOOSE, 0.0, lifts * half_m / mass_height_m(), to_side, [0]),
        case("to the side, wheels fixed to the chassis", RIGID, 60.0, half_m / rigid_z, to_side, [0, 1, 2]),
        case(
            "to the nose, wheels fixed to the chassis", RIGID, 60.0, (axle_x - rigid_x) / rigid_z, to_nose, [1, 2, 4, 5]
        ),
    ]


def in_the_air() -> list[Case]:
    """A side with its bogie at the stop is one beam on two wheels; the wheel in the air turns at its no-load rate."""
    front, middle, back = (wheel.position_m[0] for wheel in VEHICLE.wheels[LEFT])
    pivot = suspension().bogie_pivot_m[0]
    rocker, bogie = parts_of_a_side()
    on_front, on_bogie = shared(rocker, front, pivot)
    other_side: Part = shared(bogie, middle, back, (on_bogie, pivot))
    expected = dict(zip(("LF", "LB"), shared(rocker + bogie, front, back), strict=True))
    expected |= dict(zip(("RF", "RM", "RB"), (on_front, *other_side), strict=True))

    @cache
    def standing(step_s: float) -> dict[str, float]:
        loads = go(made(step_s, vehicle=DITCH), 3.0, "brake", 6.0).contacts.read_loads()
        return {wheel.name: load for wheel, load in zip(DITCH.wheels, loads, strict=True)}

    @cache
    def climbed(step_s: float) -> tuple[float, float, float, float]:
        """Return rates on a slope, of the free wheel and of the others, and those of the motors' lines.

        Wheels on the ground share a speed, not a rate: more load makes a smaller radius.
        """
        degrees, duty = 10.0, 0.5
        rover = go(made(step_s, slope(degrees), vehicle=DITCH, start=RoverStart((-25.0, 0.0))), 6.0, "duty", duty)
        supply_v, radii_m, found = rover.read("power").voltage_v, rolling_radii_m(rover)[ON_GROUND], rates(rover)
        per_v = MOTOR.nm_per_a / MOTOR.resistance_ohm
        standing_nm = per_v * duty * supply_v - MOTOR.friction_nm
        push_n = float((standing_nm / radii_m).sum()) - DITCH.mass_kg * GRAVITY * math.sin(math.radians(degrees))
        speed_mps = push_n / float((per_v * MOTOR.v_per_radps / radii_m**2).sum())
        free = standing_nm / (per_v * MOTOR.v_per_radps)
        others = float(np.mean(speed_mps / radii_m))
        return float(found[LEFT][1]), float(found[ON_GROUND].mean()), free, others

    group = "A wheel in the air"
    what = ("of the wheel in the air", "of the others")
    return [
        Case(group, "load of the middle wheel on the left", 0.0, "N", lambda s: standing(s)["LM"], 1e-3, SOFT),
        *(
            Case(group, f"load of wheel {name}", load, "N", lambda s, n=name: standing(s)[n], 0.01, SOFT)
            for name, load in expected.items()
        ),
        *(
            Case(
                group,
                f"duty 0.5 on 10 degrees: rate {name}",
                lambda i=i: climbed(0.001)[2 + i],
                "rad/s",
                lambda s, i=i: climbed(s)[i],
                0.01,
                REGULARISED,
            )
            for i, name in enumerate(what)
        ),
    ]
