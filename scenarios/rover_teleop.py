"""Drive it yourself, for up to five minutes, with a game controller or the keyboard:

    snr run rover_teleop --speed real --option pilot=manual

or as outdoors, each end in a process of its own, in two terminals:

    snr run rover_teleop --role rover
    snr run rover_teleop --role topside --option pilot=manual

    w s   ahead, astern     a d   turn left, right       1 2   arm, disarm       space   emergency stop
                                                         - +   mode down, up     c       clear the stop

There are three gates. You have brought it home if it went through all of them and back through all of them, stopped at
its start, and hit nothing with more than 50 N. Without you, a script does so, and comes back astern.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import Any

from snr_sim_robot_rover.evaluation import BODIES, Tracked, way_m
from snr_sim_robot_rover.parameters import RoverParameters, vehicle
from snr_sim_robot_rover.sticks import curve

from snr_sim.plants import HeightMap, Ledge, RoverStart
from snr_sim.scenario import Verdict, rng_for
from snr_sim.teleop import Cue

ROBOT = "rover"
ENGINES = ("mujoco", "pymunk")
CONTROLLER = "sticks"
TIME_LIMIT_S = 300.0

FIELD_M, SPACING_M = 60.0, 5.0
GATES, APART_M, HALF_WIDTH_M = 3, 4.0, 1.2  # the rover is 0.9 m wide
POST_M = (0.1, 0.15, 0.5)  # half its size
HOME_M, AT_REST_MPS, HARD_N = 2.0, 0.02, 50.0
ARM_S, GO_S, AHEAD, BEYOND_M, STAND_S = 1.0, 2.0, 0.8, 3.0, 1.0  # of the script


@lru_cache(maxsize=4)
def gates(seed: int) -> tuple[tuple[float, float], ...]:
    """Return x and y of the middle of each gate of a seed; one drives through them along x."""
    rng = rng_for(seed, "gates")
    return tuple((APART_M * (i + 1), rng.uniform(-0.4, 0.4)) for i in range(GATES))


def parameters(seed: int) -> RoverParameters:
    """Return the parameters for the controller, and the pilot's script: there, and back astern."""
    plain = RoverParameters()
    there_s = (APART_M * GATES + BEYOND_M) / (curve(AHEAD) * plain.limit_mps)
    back_s = GO_S + there_s + STAND_S
    script = (
        Cue(ARM_S, is_armed=True),
        Cue(GO_S, ahead=AHEAD),
        Cue(GO_S + there_s, ahead=0.0),
        Cue(back_s, ahead=-AHEAD),
        Cue(back_s + there_s, ahead=0.0),
    )
    return RoverParameters(script=script)


def plant(seed: int, engine: str) -> Tracked:
    """Return the rover at its start, before the gates."""
    count = round(FIELD_M / SPACING_M) + 1
    level = HeightMap([[0.0] * count] * count, SPACING_M, (-0.5 * FIELD_M, -0.5 * FIELD_M))
    posts = [
        Ledge((x, y + side * (HALF_WIDTH_M + POST_M[1]), POST_M[2]), POST_M) for x, y in gates(seed) for side in (-1, 1)
    ]
    return BODIES[engine](vehicle(), level, lambda seed: RoverStart(), obstacles=posts, seed=seed)


def passed_gates(plant: Tracked) -> list[int]:
    """Return the numbers of the gates that it went through, in this order; those on the way back are negative.

    One that it drove back through at once does not count, unless it is the last one, where it is to turn.
    """
    passed: list[int] = []
    places = gates(plant.seed)
    for before, after in pairwise(plant.course):
        for i, (x, y) in enumerate(places):
            was, now = before.position_m[0] - x, after.position_m[0] - x
            if (was < 0.0) != (now < 0.0) and abs(after.position_m[1] - y) < HALF_WIDTH_M:
                through = i + 1 if now >= 0.0 else -i - 1
                if passed and passed[-1] == -through != GATES:
                    passed.pop()
                else:
                    passed.append(through)
    return passed


def verdict(plant: Tracked) -> Verdict | None:
    """Return how it ended, or None while it drives."""
    hit_n = plant.hit_n
    if hit_n > HARD_N:
        return Verdict("collided", False, f"it hit a gate with {hit_n:.0f} N (limit {HARD_N:g} N)")
    x, y, _ = plant.read("pose").position_m
    if plant.speed_mps > AT_REST_MPS or math.hypot(x, y) > HOME_M:
        return None
    there = list(range(1, GATES + 1))
    return Verdict("completed", True) if passed_gates(plant) == [*there, *(-i for i in reversed(there))] else None


def metrics(plant: Tracked, seed: int) -> dict[str, Any]:
    """Return which gates it went through, its path, and the cost."""
    return {
        "gates": passed_gates(plant),
        "way_m": way_m(plant.course),
        "hardest_n": plant.hit_n,
        "energy_j": plant.motors.battery.energy_j,
    }
