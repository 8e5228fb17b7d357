"""The explorer and the dozer, which have plants seen from above, in the rover's plant."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from snr_sim.plants.battery import BatteryPack
from snr_sim.plants.ground.planar_vehicles import dozer_rover, explorer_rover
from snr_sim.plants.ground.rover import Rover
from snr_sim.scenario import library

from .case import Case
from .rover_runs import GRAVITY, REGULARISED, ROVER_STEPS_S, SOFT, Turn, balance, go, made, place, turn

WHEEL_RADPS = 4.0


def numbers(robot: str, name: str) -> Any:
    """Return numbers of a robot."""
    library.load_robot(library.find("robots", robot))
    return getattr(__import__(f"{library.ROBOT_MODULE}{robot}.parameters", fromlist=[name]), name)


def planar_vehicles() -> list[Case]:
    """Loads by the rule of levers, way over angle, and turning by the balance of friction, of both."""
    explorer, dozer = numbers("dora", "DORA"), numbers("housecat", "DOZER")
    pack = BatteryPack(cells=2, capacity_ah=2.0)
    weight_n = explorer.mass_kg * GRAVITY
    on_axle = weight_n * explorer.caster_m / (explorer.caster_m - explorer.axle_m)
    loads = {"L": 0.5 * on_axle, "R": 0.5 * on_axle, "C": weight_n - on_axle}
    quarter_n = 0.25 * dozer.mass_kg * GRAVITY
    return [
        *cases_of("explorer", lambda s: made(s, vehicle=explorer_rover(explorer, pack)), loads),
        *cases_of(
            "dozer",
            lambda s: made(s, vehicle=dozer_rover(dozer, pack)),
            {"L1 and L2": quarter_n, "R3 and R4": quarter_n},
        ),
    ]


def cases_of(who: str, make: Callable[[float], Rover], loads: dict[str, float]) -> list[Case]:
    """Return the cases of one vehicle; `loads` are those of some wheels at rest, or of two together."""

    @cache
    def standing(step_s: float) -> dict[str, float]:
        rover = go(make(step_s), 1.0)
        found = zip(rover.vehicle.wheels, rover.contacts.read_loads(), strict=True)
        carried = {wheel.name: load for wheel, load in found}
        return {names: sum(carried[name] for name in names.split(" and ")) for names in loads}

    def driven(step_s: float) -> float:
        """Return the way of the first wheel over its angle."""
        rover = go(make(step_s), 2.0, "speed", WHEEL_RADPS)
        x_m, before = place(rover)[0], first(rover)
        go(rover, 1.0)
        return float(place(rover)[0] - x_m) / (first(rover) - before)

    @cache
    def turned(step_s: float, left_radps: float) -> Turn:
        return turn(make(step_s), left_radps, WHEEL_RADPS)

    def balanced(left_radps: float) -> np.ndarray:
        """Return the speeds of the body; of wheels on a chain, which differ in load and radius, most slide a little."""
        there, vehicle = turned(ROVER_STEPS_S[0], left_radps), make(ROVER_STEPS_S[0]).vehicle
        scales = np.array([wheel.friction_scale for wheel in vehicle.wheels])
        return balance(vehicle, there.wheel_radps * there.radii_m, scales * there.loads_n)

    def radius_m() -> float:
        return float(balanced(WHEEL_RADPS)[0] / turned(ROVER_STEPS_S[0], WHEEL_RADPS).wheel_radps[0])

    group = "Explorer and dozer"
    return [
        *(
            Case(group, f"{who}: load of {name}", load, "N", lambda s, n=name: standing(s)[n], 0.005, SOFT)
            for name, load in loads.items()
        ),
        Case(
            group,
            f"{who}: way of a wheel over its angle",
            radius_m,
            "m",
            driven,
            0.002,
            REGULARISED,
        ),
        Case(
            group,
            f"{who}: turning rate on the spot",
            lambda: float(balanced(-WHEEL_RADPS)[2]),
            "rad/s",
            lambda s: turned(s, -WHEEL_RADPS).radps,
            0.01,
            REGULARISED,
        ),
    ]


def first(rover: Rover) -> float:
    return float(rover.read(f"motor_{rover.vehicle.motor_wheels[0].name}").turned_rad)
