"""Move the wrist of the arm outwards along a level line, while the rover stands: planar mode, by inverse kinematics.

Once it is at the beginning of the line, the wrist must keep its height within 5 mm until it is at the end, by the true
angles of the joints. Every seed is another line. Under MuJoCo only.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

from snr_sim_robot_rover.arm import wrist_m
from snr_sim_robot_rover.evaluation import TrackedRover
from snr_sim_robot_rover.parameters import RoverParameters, vehicle

from snr_sim.plants import HeightMap, Manipulator, RoverStart
from snr_sim.scenario import Verdict, rng_for

ROBOT = "rover"
ROLES = ("rover",)
ENGINES = ("mujoco",)
CONTROLLER = "arm_line"
TIME_LIMIT_S = 30.0

ARM = Manipulator()
LEVEL = HeightMap([[0.0] * 3] * 3, 10.0, (-10.0, -10.0))
MAX_OFF_M = 0.005
NEAR_M = 0.01  # of an end of the line


class Reaching(TrackedRover):
    """Records radius and height of the wrist, with each sample of the course."""

    wrists_m: list[tuple[float, float]]

    def reset(self, seed: int) -> None:
        """Reset, with an empty record."""
        self.wrists_m = []
        super().reset(seed)

    def step(self, dt_s: float) -> None:
        """Advance, and record what is due."""
        super().step(dt_s)
        if len(self.wrists_m) < len(self.course):
            _, shoulder, elbow, *_ = self.read("arm").angles_rad
            self.wrists_m.append(wrist_m(ARM, shoulder, elbow))

    def restore(self, snapshot: Any) -> None:
        """Restore the rover, and drop what was recorded since."""
        super().restore(snapshot)
        self.wrists_m = self.wrists_m[: len(self.course)]


@lru_cache(maxsize=4)
def parameters(seed: int) -> RoverParameters:
    """Return the parameters for the controller."""
    rng = rng_for(seed, "line")
    line_m = rng.uniform(-0.2, 0.3), rng.uniform(0.35, 0.45), rng.uniform(0.65, 0.75)
    return RoverParameters(vehicle=replace(vehicle(), arm=ARM), arm_line_m=line_m)


def plant(seed: int, engine: str) -> Reaching:
    """Return the rover at its start."""
    return Reaching(parameters(seed).vehicle, LEVEL, lambda seed: RoverStart(), seed=seed)


def on_line(plant: Reaching) -> list[tuple[float, float]]:
    """Return where the wrist was since it came to the beginning of the line."""
    height_m, from_m, _ = parameters(plant.seed).arm_line_m
    for i, (radius_m, at_m) in enumerate(plant.wrists_m):
        if abs(radius_m - from_m) < NEAR_M and abs(at_m - height_m) < MAX_OFF_M:
            return plant.wrists_m[i:]
    return []


def off_m(plant: Reaching) -> float:
    """Return how far the wrist was from its height on the line, at most."""
    return max((abs(at_m - parameters(plant.seed).arm_line_m[0]) for _, at_m in on_line(plant)), default=0.0)


def verdict(plant: Reaching) -> Verdict | None:
    """Return how it ended, or None while it moves."""
    since = on_line(plant)
    if off_m(plant) > MAX_OFF_M:
        return Verdict("off the line", False, f"it was {1e3 * off_m(plant):.1f} mm off its height (limit 5 mm)")
    is_there = bool(since) and since[-1][0] > parameters(plant.seed).arm_line_m[2] - NEAR_M
    return Verdict("reached", True) if is_there else None


def metrics(plant: Reaching, seed: int) -> dict[str, Any]:
    """Return how far it was off its height, and how long it took."""
    return {"off_m": off_m(plant), "time_s": plant.time_s, "energy_j": plant.motors.battery.energy_j}
