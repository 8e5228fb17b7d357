"""The rover on soft soil: sinkage, resistance and traction after Wong, written here a second time."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np

from snr_sim.plants.ground.rover import RoverStart
from snr_sim.plants.ground.terramechanics import DRY_SAND, LUNAR_SOIL, Bekker

from .case import Case
from .rover_runs import (
    COUNT,
    GRAVITY,
    LAST_STEP,
    MOTOR,
    RADIUS_M,
    ROVER_STEPS_S,
    VEHICLE,
    WIDTH_M,
    go,
    made,
    rates,
    rolling_radii_m,
    rolling_radius_m,
    slope,
    speed_mps,
)

SOILS = {"dry sand": DRY_SAND, "lunar soil": LUNAR_SOIL}
FREE = replace(VEHICLE, motor=replace(MOTOR, friction_nm=0.0, rotor_kgm2=0.0))  # almost no traction slows its wheels
GROUP = "Soft soil"


def sinkage_m(soil: Bekker, load_n: float) -> float:
    """Depth at which pressure bears the load of a rigid wheel, in closed form."""
    per_m = (3.0 - soil.n) * WIDTH_M * (soil.kc / WIDTH_M + soil.kphi) * math.sqrt(2.0 * RADIUS_M)
    return float((3.0 * load_n / per_m) ** (2.0 / (1.0 + 2.0 * soil.n)))


def resistance_n(soil: Bekker, load_n: float) -> float:
    """Work of pressing a rut, for each metre: the integral of pressure over depth."""
    depth_m = sinkage_m(soil, load_n)
    return float(WIDTH_M * (soil.kc / WIDTH_M + soil.kphi) * depth_m ** (soil.n + 1.0) / (soil.n + 1.0))


def traction_n(soil: Bekker, load_n: float, slip: float) -> float:
    """Mean shear stress after Janosi and Hanamoto, over the length of the contact."""
    length_m = math.sqrt(2.0 * RADIUS_M * sinkage_m(soil, load_n))
    strength_n = WIDTH_M * length_m * soil.cohesion_pa + load_n * math.tan(soil.phi_rad)
    way = slip * length_m / soil.shear_m
    return strength_n * (1.0 - (1.0 - math.exp(-way)) / way)


def slip_for(soil: Bekker, loads: list[float], rolled_mps: np.ndarray, pull_n: float) -> float:
    """Return the mean slip at which traction pulls so much besides the resistance.

    Args:
        rolled_mps: rate times rolling radius of each wheel: those with more load turn slower, and have smaller radii.
    """
    needed_n = pull_n + sum(resistance_n(soil, load) for load in loads)
    low, high = 0.0, float(rolled_mps.min())
    for _ in range(60):
        speed = 0.5 * (low + high)
        slips = 1.0 - speed / rolled_mps
        pulled_n = sum(traction_n(soil, load, slip) for load, slip in zip(loads, slips.tolist(), strict=True))
        low, high = (low, speed) if pulled_n < needed_n else (speed, high)
    return 1.0 - low / float(rolled_mps.mean())


@cache
def driven(step_s: float, name: str, degrees: float, pull_n: float) -> tuple[float, list[float], np.ndarray]:
    """Return slip, loads and rolled speeds of a rover that climbs, or pulls something."""
    ground = slope(degrees)
    rover = made(step_s, ground, SOILS[name], start=RoverStart((-25.0, 0.0)))
    rover._world.data.xfrc_applied[rover._world.body_id("chassis"), 0] = -pull_n
    go(rover, 8.0, "speed", 4.0)
    rolled_mps = rates(rover) * rolling_radii_m(rover)
    return 1.0 - speed_mps(rover) / float(rolled_mps.mean()), rover.contacts.read_loads(), rolled_mps


def slip_case(what: str, soil: str, degrees: float, pull_n: float) -> Case:
    needed_n = pull_n + VEHICLE.mass_kg * GRAVITY * math.sin(math.radians(degrees))
    return Case(
        GROUP,
        f"{soil}, {what}: slip",
        lambda: slip_for(SOILS[soil], *driven(ROVER_STEPS_S[0], soil, degrees, pull_n)[1:], needed_n),
        "",
        lambda s: driven(s, soil, degrees, pull_n)[0],
        0.005,
        LAST_STEP,
        is_long=True,
    )


def on_soil() -> list[Case]:
    """Slip at which traction carries the weight's share and the resistance of the soil, with the loads found."""
    return [slip_case(f"{degrees:g} degrees", "dry sand", degrees, 0.0) for degrees in (0.0, 2.5, 5.0, 8.0)]


def pulling() -> list[Case]:
    """Drawbar pull: a force holds the rover back on level soil."""
    pulls = (("dry sand", 20.0), ("dry sand", 50.0), ("lunar soil", 40.0), ("lunar soil", 80.0))
    return [slip_case(f"pull of {pull_n:g} N", soil, 0.0, pull_n) for soil, pull_n in pulls]


def coasting() -> list[Case]:
    """Wheels that roll freely are slowed by what it takes to press their ruts."""

    @cache
    def found(step_s: float, soil: str) -> tuple[float, float]:
        """Return deceleration, and the resistance of the loads in the middle of the time over mass."""
        rover = made(step_s, soil=SOILS[soil], vehicle=FREE)
        go(rover, 0.0, "off", 0.0)
        data = rover._world.data
        data.qvel[0] = 1.5
        data.qvel[rover._dofs] = 1.5 / rolling_radius_m(rover)
        before = speed_mps(go(rover, 0.2))
        radius_m = rolling_radius_m(go(rover, 0.2))
        loads = rover.contacts.read_loads()
        after = speed_mps(go(rover, 0.2))
        wheel_kg = 0.5 * VEHICLE.wheels[0].mass_kg * RADIUS_M**2 / radius_m**2
        slowed_kg = VEHICLE.mass_kg + COUNT * wheel_kg
        return (before - after) / 0.4, sum(resistance_n(SOILS[soil], load) for load in loads) / slowed_kg

    return [
        Case(
            GROUP,
            f"{soil}, wheels roll freely: deceleration",
            lambda n=soil: found(ROVER_STEPS_S[0], n)[1],
            "m/s2",
            lambda s, n=soil: found(s, n)[0],
            0.005,
            LAST_STEP,
        )
        for soil in SOILS
    ]


def sunken() -> list[Case]:
    """Sinkage, which only the resistance shows in a run."""
    return [
        Case(
            GROUP,
            f"{name}: sinkage under 70 N",
            1e3 * sinkage_m(soil, 70.0),
            "mm",
            lambda s, soil=soil: 1e3 * soil.sinkage_m(70.0, RADIUS_M, WIDTH_M),
            0.005,
            "rounding",
        )
        for name, soil in SOILS.items()
    ]
