"""One of six motors breaks while the rover drives up a gentle slope. It gets no notice of it, only readings.

It copes if it keeps within 0.5 m of its line until it is 20 m beyond the place where the motor broke. Every seed is
another motor, another slope and another fault: it is dead, its gear drags, or its controller falls silent.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_rover.evaluation import BODIES, Sample, Tracked
from snr_sim_robot_rover.parameters import RoverParameters, vehicle

from snr_sim.plants import Coulomb, HeightMap, MotorFault, RoverStart
from snr_sim.scenario import Verdict, rng_for

ROBOT = "rover"
ROLES = ("rover",)
ENGINES = ("mujoco", "pymunk")
CONTROLLER = "dead_reckoning"
TIME_LIMIT_S = 60.0

FIELD_M, SPACING_M = 100.0, 5.0
GRAVEL = Coulomb(0.6)
WAY_M, MAX_OFF_M = 20.0, 0.5


@lru_cache(maxsize=4)
def start(seed: int) -> RoverStart:
    """Return where the run of a seed begins, and which motor breaks."""
    rng = rng_for(seed, "fault")
    motor = vehicle().motor_wheels[int(rng.integers(6))].name
    fault = MotorFault(rng.uniform(8.0, 11.0), motor, ("dead", "drags", "silent")[int(rng.integers(3))])
    return RoverStart(faults=(fault,))


def parameters(seed: int) -> RoverParameters:
    """Return the parameters for the controller."""
    return RoverParameters(points_m=((0.5 * FIELD_M - SPACING_M, 0.0),))


def plant(seed: int, engine: str) -> Tracked:
    """Return the rover at the foot of the slope."""
    slope = math.tan(math.radians(rng_for(seed, "slope").uniform(3.0, 6.0)))
    count = round(FIELD_M / SPACING_M) + 1
    corner_m = -0.5 * FIELD_M
    along = [(corner_m + SPACING_M * i) * slope for i in range(count)]
    return BODIES[engine](
        vehicle(), HeightMap([along] * count, SPACING_M, (corner_m, corner_m)), start, GRAVEL, seed=seed
    )


def broken(plant: Tracked) -> list[Sample]:
    """Return the course since the motor broke."""
    (fault,) = start(plant.seed).faults
    return [sample for sample in plant.course if sample.time_s >= fault.at_s]


def verdict(plant: Tracked) -> Verdict | None:
    """Return how it ended, or None while it drives."""
    if not plant.course:
        return None
    off_m = abs(plant.course[-1].position_m[1])
    if off_m > MAX_OFF_M:
        return Verdict("off course", False, f"it was {off_m:.2f} m beside its line (limit {MAX_OFF_M:g} m)")
    since = broken(plant)
    is_there = bool(since) and since[-1].position_m[0] - since[0].position_m[0] >= WAY_M
    return Verdict("arrived", True) if is_there else None


def metrics(plant: Tracked, seed: int) -> dict[str, Any]:
    """Return what broke, how far it was off its line, and how far it came."""
    (fault,), since = start(seed).faults, broken(plant)
    return {
        "motor": fault.motor,
        "fault": fault.fault,
        "broke_s": fault.at_s,
        "off_m": max((abs(sample.position_m[1]) for sample in plant.course), default=0.0),
        "way_m": since[-1].position_m[0] - since[0].position_m[0] if since else 0.0,
        "time_s": plant.time_s,
        "energy_j": plant.motors.battery.energy_j,
    }
