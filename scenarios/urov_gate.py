"""Through three gates, one after the other, without touching them. The pilot sees the vehicle, and knows the gates.

The run succeeds if the vehicle went through all gates in their order and touched nothing.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import Any

from snr_sim_robot_urov.evaluation import TrackedUrov
from snr_sim_robot_urov.parameters import UrovParameters, vehicle
from snr_sim_robot_urov.waypoint_pilot import Waypoint

from snr_sim.plants import Current, Dive, Gate, Pool, Propulsion, Tether
from snr_sim.scenario import Verdict, rng_for

ROBOT = "urov"
ENGINES = ("mujoco",)
CONTROLLER = "holds"
TIME_LIMIT_S = 120.0

START_M = (-9.0, 0.0, -1.5)
ROOM_M = 1.2  # before a gate the vehicle lines up, and behind it it may turn


@lru_cache(maxsize=4)
def gates(seed: int) -> tuple[Gate, ...]:
    """Return the gates of a seed: about six metres apart, to and fro, and each turned a little."""
    rng = rng_for(seed, "gates")
    return tuple(
        Gate(
            f"gate_{i + 1}",
            (-5.0 + 5.0 * i, rng.uniform(-1.5, 1.5), -rng.uniform(1.3, 2.5)),
            heading_rad=rng.uniform(-0.35, 0.35),
        )
        for i in range(3)
    )


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Return what happens in the run of a seed."""
    rng = rng_for(seed, "dive")
    current = Current(0.0, (rng.uniform(-0.05, 0.05), rng.uniform(-0.05, 0.05), 0.0))
    return Dive(position_m=START_M, currents=(current,), tether=Tether(anchor_m=(-9.0, 0.0, 0.0)))


def parameters(seed: int) -> UrovParameters:
    """Return the parameters for the controller, and the pilot's route: before each gate, then behind it."""
    route = []
    for gate in gates(seed):
        x, y, z = gate.position_m
        ahead = math.cos(gate.heading_rad), math.sin(gate.heading_rad)
        for side, within_m, stay_s in ((-ROOM_M, 0.2, 1.0), (ROOM_M, 0.4, 0.0)):
            place = x + side * ahead[0], y + side * ahead[1]
            route.append(Waypoint(*place, -z, gate.heading_rad, within_m, stay_s))
    return UrovParameters(vehicle(), route=tuple(route))


class GateCourse(TrackedUrov):
    """The vehicle, with a counter of the gates it went through."""

    def passed_gates(self) -> list[str]:
        """Return the names of the gates it went through, in the right direction, in this order."""
        names = []
        for before, after in pairwise(self.course):
            for gate in self.pool.gates:
                (a, _, _), (b, across, up) = (_seen_from(gate, one.position_m) for one in (before, after))
                if a < 0.0 <= b and abs(across) < 0.5 * gate.width_m and abs(up) < 0.5 * gate.height_m:
                    names.append(gate.name)
        return names


def plant(seed: int, engine: str) -> GateCourse:
    """Return the vehicle at its start."""
    return GateCourse(vehicle(), Pool(25.0, 12.5, 4.0, gates=gates(seed)), dive, Propulsion(8), seed)


def verdict(plant: GateCourse) -> Verdict | None:
    """Return how it ended, or None while it runs."""
    if plant.max_contact_n > 0.0:
        return Verdict("collided", False, f"touched an obstacle with {plant.max_contact_n:.0f} N")
    last = plant.pool.gates[-1]
    if _seen_from(last, plant.position_m)[0] < 0.5:
        return None
    passed_gates, expected = plant.passed_gates(), [gate.name for gate in plant.pool.gates]
    if passed_gates == expected:
        return Verdict("completed", True)
    return Verdict("failed", False, f"passed {', '.join(passed_gates) or 'no gate'} instead of {', '.join(expected)}")


def metrics(plant: GateCourse, seed: int) -> dict[str, Any]:
    """Return which gates it went through, the time and the cost."""
    return {"gates": plant.passed_gates(), "time_s": plant.time_s, "energy_j": plant.thrusters.energy_j}


def _seen_from(gate: Gate, position_m: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return a position relative to a gate: distance behind it, to its left, and above its middle."""
    x, y, z = (a - b for a, b in zip(position_m, gate.position_m, strict=True))
    cos, sin = math.cos(gate.heading_rad), math.sin(gate.heading_rad)
    return cos * x + sin * y, -sin * x + cos * y, z
