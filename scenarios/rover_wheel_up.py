"""A rock lifts the wheels of one side, one after the other, and each falls down behind it.

A wheel that carries nothing turns as fast as its motor lets it, and then meets the ground: driven by torque it races.
It must turn at most 1.5 times as fast as those on the ground, which must carry on until the rover is past the rock.
Every seed is another side, place and height of the rock. Under MuJoCo only: in the plane nothing is lifted.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from snr_sim_robot_rover.evaluation import TrackedRover
from snr_sim_robot_rover.parameters import RoverParameters, vehicle

from snr_sim.plants import HeightMap, Ledge, RoverStart
from snr_sim.scenario import Verdict, rng_for

ROBOT = "rover"
ROLES = ("rover",)
ENGINES = ("mujoco",)
CONTROLLER = "dead_reckoning"
TIME_LIMIT_S = 40.0

END_M, MAX_OFF_M = 6.0, 1.0
LEVEL = HeightMap([[0.0] * 5] * 5, 10.0, (-20.0, -20.0))
HALF_LENGTH_M, HALF_WIDTH_M = 0.15, 0.2
MAX_RATIO, MIN_RADPS = 1.5, 1.0  # slower wheels on the ground count as that fast
SAMPLE_S = 0.02


class Lifted(TrackedRover):
    """Records which wheels did not touch the ground, and how fast they turned."""

    sample_s = SAMPLE_S
    ratios: list[float]  # rate of the fastest lifted wheel over that of the fastest one on the ground, at each sample
    lifted: list[set[str]]  # names of the lifted wheels, at each sample

    def reset(self, seed: int) -> None:
        """Reset, with empty records."""
        self.ratios, self.lifted = [], []
        super().reset(seed)

    def step(self, dt_s: float) -> None:
        """Advance, and record what is due."""
        super().step(dt_s)
        if len(self.ratios) < len(self.course):
            lifted = set()
            fastest = {True: 0.0, False: MIN_RADPS}  # of those that are lifted, and of the others
            for wheel, load_n in zip(self.vehicle.wheels, self.contacts.read_loads(), strict=True):
                is_lifted, rate = load_n == 0.0, abs(self.read(f"motor_{wheel.name}").speed_radps)
                fastest[is_lifted] = max(fastest[is_lifted], rate)
                if is_lifted:
                    lifted.add(wheel.name)
            self.ratios.append(fastest[True] / fastest[False])
            self.lifted.append(lifted)

    def restore(self, snapshot: Any) -> None:
        """Restore the rover, and drop what was recorded since."""
        super().restore(snapshot)
        self.ratios, self.lifted = self.ratios[: len(self.course)], self.lifted[: len(self.course)]


def rock(seed: int) -> Ledge:
    """Return the rock of a seed."""
    rng = rng_for(seed, "rock")
    y_m = vehicle().wheels[0].position_m[1] * (-1.0) ** int(rng.integers(2))
    height_m = rng.uniform(0.05, 0.07)
    return Ledge((rng.uniform(2.0, 3.0), y_m, 0.0), (HALF_LENGTH_M, HALF_WIDTH_M, height_m))


@lru_cache(maxsize=4)
def start(seed: int) -> RoverStart:
    """Return where the run of a seed begins."""
    return RoverStart()


def parameters(seed: int) -> RoverParameters:
    """Return the parameters for the controller."""
    return RoverParameters(points_m=((END_M + 3.0, 0.0),))


def plant(seed: int, engine: str) -> Lifted:
    """Return the rover before the rock."""
    return Lifted(vehicle(), LEVEL, start, obstacles=[rock(seed)], seed=seed)


def verdict(plant: Lifted) -> Verdict | None:
    """Return how it ended, or None while it drives."""
    if not plant.course:
        return None
    if plant.has_tipped_over:
        return Verdict("tipped over", False, "the rover lies on its side")
    x_m, y_m, _ = plant.course[-1].position_m
    if abs(y_m) > MAX_OFF_M:
        return Verdict("off course", False, f"it is {abs(y_m):.2f} m beside its line (limit {MAX_OFF_M:g} m)")
    if plant.ratios[-1] > MAX_RATIO:
        return Verdict("a wheel raced", False, f"it turned {plant.ratios[-1]:.1f} times as fast as the others")
    if x_m < END_M:
        return None
    if len(set().union(*plant.lifted)) < len(plant.vehicle.wheels) // 2:
        return Verdict("passed by", False, "not all wheels of a side went over the rock")
    return Verdict("passed", True)


def metrics(plant: Lifted, seed: int) -> dict[str, Any]:
    """Return how fast a lifted wheel turned over those on the ground, and how hard the rock was met."""
    return {
        "ratio": max(plant.ratios, default=0.0),
        "lifted": sorted(set().union(*plant.lifted)),
        "off_m": max((abs(sample.position_m[1]) for sample in plant.course), default=0.0),
        "hit_n": plant.hit_n,
        "time_s": plant.time_s,
    }
