"""Five way points, about 120 m over gravel and low hills, by a satellite receiver that is off by meters.

The rover starts on a mark whose position is known, and must come within 3 m of each way point, in their order, and stop
at the last one within three minutes. Every seed is another round, other hills and other errors.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_rover.evaluation import BODIES, Mark, Tracked, nearest_m, way_m
from snr_sim_robot_rover.parameters import RoverParameters, vehicle

from snr_sim.plants import Coulomb, HeightMap, RoverStart, make_hills
from snr_sim.scenario import Verdict, rng_for

ROBOT = "rover"
ROLES = ("rover",)
ENGINES = ("mujoco", "pymunk")
CONTROLLER = "waypoints"
END_S = 180.0
TIME_LIMIT_S = END_S + 1.0

COUNT, LEG_M = 5, 24.0
WITHIN_M = 3.0
AT_REST_MPS = 0.02
RELIEF_M, HILL_M, FIELD_M, SPACING_M = 0.1, 12.0, 130.0, 1.0
# Wong, Theory of Ground Vehicles, chapter 1; with more grip its motors hardly turn it on the spot.
GRAVEL = Coulomb(0.6)
GPS_HZ = 10.0


@lru_cache(maxsize=4)
def points(seed: int) -> tuple[tuple[float, float], ...]:
    """Return x and y of the way points of a seed: corners of a pentagon that is a little out of shape."""
    rng = rng_for(seed, "waypoints")
    heading, made, x, y = rng.uniform(-math.pi, math.pi), [], 0.0, 0.0
    for i in range(COUNT):
        along = heading + 2.0 * math.pi * i / COUNT + rng.uniform(-0.25, 0.25)
        length_m = LEG_M + rng.uniform(-2.0, 2.0)
        x, y = x + length_m * math.cos(along), y + length_m * math.sin(along)
        made.append((x, y))
    return tuple(made)


@lru_cache(maxsize=4)
def ground(seed: int) -> HeightMap:
    """Return the hills of a seed."""
    return make_hills(seed, RELIEF_M, HILL_M, FIELD_M, SPACING_M)


def start(seed: int) -> RoverStart:
    """Return where the run of a seed begins: on the mark, in any direction."""
    return RoverStart(heading_rad=rng_for(seed, "start").uniform(-math.pi, math.pi))


def parameters(seed: int) -> RoverParameters:
    """Return the parameters for the controller, with the route as latitudes and longitudes."""
    plane = RoverParameters().gps.plane()
    return RoverParameters(gps_hz=GPS_HZ, route=tuple(plane.geodetic(x, y)[:2] for x, y in points(seed)))


def plant(seed: int, engine: str) -> Tracked:
    """Return the rover at its start."""
    rover = BODIES[engine](vehicle(), ground(seed), start, GRAVEL, seed=seed)
    rover.marks = [Mark(x, y, WITHIN_M) for x, y in points(seed)]
    return rover


def verdict(plant: Tracked) -> Verdict | None:
    """Return how it ended, or None while it drives."""
    if plant.has_tipped_over:
        return Verdict("tipped over", False, "the rover lies on its side")
    is_at_end = math.dist(plant.read("pose").position_m[:2], points(plant.seed)[-1]) <= WITHIN_M
    is_over, is_done = plant.time_s >= END_S - 1e-6, is_at_end and plant.speed_mps <= AT_REST_MPS
    if not (is_over or is_done):
        return None
    missed = [
        f"{i + 1} by {gap:.1f} m"
        for i, gap in enumerate(nearest_m(plant.course, points(plant.seed), WITHIN_M))
        if gap > WITHIN_M
    ]
    if not missed and is_done:
        return Verdict("arrived", True)
    if not is_over:
        return None  # the last way point may be near the start
    return Verdict(
        "timeout", False, f"it missed way point {', '.join(missed)}" if missed else "it did not stop at the end"
    )


def metrics(plant: Tracked, seed: int) -> dict[str, Any]:
    """Return how near it came to each way point, how far and how long it drove, and what it took."""
    return {
        "nearest_m": nearest_m(plant.course, points(seed), WITHIN_M),
        "way_m": way_m(plant.course),
        "time_s": plant.time_s,
        "energy_j": plant.motors.battery.energy_j,
    }
