"""Two motor controllers lose their plugs while the rover drives, and get them back swapped.

Names belong to controllers and not to ports, so afterwards each wheel must follow its own command. Before, the rover
must stop, and stay where it is until its pilot has disarmed and armed it, whatever the sticks command meanwhile. Every
seed is another pair of wheels, one of each side, and other times. Simulated motors without controllers have no plugs,
so it needs emulated controllers: in memory, or with `--io pty` at serial ports.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from snr_sim_robot_rover.evaluation import BODIES, Sample, Tracked, way_m
from snr_sim_robot_rover.parameters import RoverParameters, vehicle

from snr_sim.devices.emulated import Replug
from snr_sim.plants import Coulomb, HeightMap, RoverStart
from snr_sim.scenario import Verdict, rng_for
from snr_sim.teleop import Cue

ROBOT = "rover"
ENGINES = ("mujoco", "pymunk")
IO = ("emulated", "pty")
CONTROLLER = "sticks"
# Of the pilot, who does not see that the rover has stopped.
ARM_S, AHEAD_S, DISARM_S, ARM_AGAIN_S, AHEAD_AGAIN_S, TURN_S, END_S = 1.0, 1.5, 9.0, 9.5, 10.0, 12.0, 14.0
TIME_LIMIT_S = END_S + 1.0

STICK = 0.8
STOP_S = 1.0  # after the first plug was pulled
MIN_WAY_M, MAX_STILL_M, MIN_RATE_RADPS = 1.0, 0.02, 0.5
FIELD_M, SPACING_M = 60.0, 5.0
GRAVEL = Coulomb(0.6)  # Wong, Theory of Ground Vehicles, chapter 1; with more grip it hardly turns on the spot


@lru_cache(maxsize=4)
def replugs(seed: int) -> tuple[Replug, Replug]:
    """Return which plugs are pulled and put back; the first is pulled first."""
    rng = rng_for(seed, "replugs")
    wheels = [[wheel.name for wheel in vehicle().motor_wheels if wheel.side == side] for side in ("left", "right")]
    left, right = (f"motor_{names[rng.integers(len(names))]}" for names in wheels)
    out_s, in_s = rng.uniform(4.0, 5.0), rng.uniform(6.5, 7.5)
    later_s, back_later_s = rng.uniform(0.0, 0.5), rng.uniform(0.0, 0.5)
    # Its plug comes back last, so that it also gets the other one's device file.
    return Replug(left, out_s, in_s + back_later_s, right), Replug(right, out_s + later_s, in_s, left)


def parameters(seed: int) -> RoverParameters:
    """Return the parameters for the controller, and the pilot's script."""
    script = (
        Cue(ARM_S, is_armed=True),
        Cue(AHEAD_S, ahead=STICK),
        Cue(DISARM_S, is_armed=False, ahead=0.0),
        Cue(ARM_AGAIN_S, is_armed=True),
        Cue(AHEAD_AGAIN_S, ahead=STICK),
        Cue(TURN_S, ahead=0.0, turn=STICK),
    )
    return RoverParameters(script=script, replugs=replugs(seed))


def plant(seed: int, engine: str) -> Tracked:
    """Return the rover at its start, on level ground."""
    count = round(FIELD_M / SPACING_M) + 1
    level = HeightMap([[0.0] * count] * count, SPACING_M, (-0.5 * FIELD_M, -0.5 * FIELD_M))
    return BODIES[engine](vehicle(), level, lambda seed: RoverStart(), GRAVEL, seed=seed)


def moved_m(course: Sequence[Sample], from_s: float, to_s: float) -> float:
    """Return how far the rover got from where it was at a time, until another."""
    places = [sample.position_m for sample in course if from_s <= sample.time_s <= to_s]
    return max((math.dist(places[0], place) for place in places), default=0.0)


def rates(plant: Tracked) -> dict[str, float]:
    """Return how fast each wheel turns [rad/s]."""
    return {wheel.name: plant.read(f"motor_{wheel.name}").speed_radps for wheel in vehicle().motor_wheels}


def verdict(plant: Tracked) -> Verdict | None:
    """Return how it ended, or None while it drives."""
    if plant.time_s < END_S - 1e-6:
        return None
    course, (first, _) = plant.course, replugs(plant.seed)
    before_m, after_m = moved_m(course, 0.0, first.out_s), moved_m(course, ARM_AGAIN_S, TURN_S)
    if min(before_m, after_m) < MIN_WAY_M:
        return Verdict("failed", False, f"it drove {before_m:.1f} m, and then {after_m:.1f} m")
    still_m = moved_m(course, first.out_s + STOP_S, ARM_AGAIN_S)
    if still_m > MAX_STILL_M:
        return Verdict("failed", False, f"it moved {still_m:.2f} m before it was armed again")
    wrong = [name for name, rate in rates(plant).items() if (-rate if name[0] == "L" else rate) < MIN_RATE_RADPS]
    if wrong:
        return Verdict("failed", False, f"it turns to the left, and {', '.join(wrong)} does not do its part")
    return Verdict("completed", True)


def metrics(plant: Tracked, seed: int) -> dict[str, Any]:
    """Return which wheels it was, how far it drove and rolled, and what each wheel does at the end."""
    first, second = replugs(seed)
    return {
        "unplugged": [first.motor, second.motor],
        "way_m": way_m(plant.course),
        "rolled_m": moved_m(plant.course, first.out_s, ARM_AGAIN_S),
        "still_m": moved_m(plant.course, first.out_s + STOP_S, ARM_AGAIN_S),
        "rates_radps": rates(plant),
    }
