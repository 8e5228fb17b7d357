"""To the depth that the pilot asks for, in a tank, and stay there.

Every seed is another start, goal and current, and another weight or float on the vehicle. Seed 0 goes from
1 m to 3 m. The depth is held if the vehicle is within 15 cm of the goal after 6.5 s, and stays there, overshoots by no
more than a fifth of the way, and ends within 10 cm of it.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

from snr_sim_robot_urov.evaluation import StepResponse, TrackedUrov, hold_verdict, step_response
from snr_sim_robot_urov.parameters import UrovParameters, vehicle

from snr_sim.plants import Current, Dive, Payload, Pool, Propulsion, Tether
from snr_sim.scenario import Verdict, rng_for
from snr_sim.teleop import Cue

ROBOT = "urov"
ENGINES = ("mujoco",)
CONTROLLER = "holds"
END_S = 14.0
TIME_LIMIT_S = END_S + 1.0

ARM_S, STEP_S = 2.0, 3.0
BAND_M, SETTLING_S, OVERSHOOT, STEADY_M = 0.15, 6.5, 0.20, 0.10
STEP_M = (1.0, 2.0)
TRIM_N = 8.0
LOAD_KG = 1.0


class TankTask(NamedTuple):
    """What a seed asks for.

    Args:
        start_m: depth at the start.
        goal_m: depth the pilot asks for.
        trim_n: how hard what hangs at the vehicle pulls it down; negative: up. Without it, it floats up with 1.5 N.
        current_mps: of the water, to the east and to the north.
    """

    start_m: float
    goal_m: float
    trim_n: float
    current_mps: tuple[float, float]


def task(seed: int) -> TankTask:
    """Return what a seed asks for."""
    if seed == 0:
        return TankTask(1.0, 3.0, 0.0, (0.0, 0.0))
    rng = rng_for(seed, "task")
    goal_m = rng.uniform(1.2, 4.8)
    step_m = rng.uniform(*STEP_M) * (1.0 if goal_m > 3.0 else -1.0)  # away from the surface and the floor
    speed, direction = rng.uniform(0.0, 0.2), rng.uniform(-math.pi, math.pi)
    trim_n = rng.uniform(-TRIM_N, TRIM_N)
    return TankTask(goal_m - step_m, goal_m, trim_n, (speed * math.cos(direction), speed * math.sin(direction)))


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Return what happens in the run of a seed."""
    asked = task(seed)
    volume_m3 = (LOAD_KG - asked.trim_n / 9.81) / 1000.0
    height_m = math.copysign(0.1, -asked.trim_n)  # a weight hangs below, a float above: so neither turns it over
    return Dive(
        position_m=(0.0, 0.0, -asked.start_m),
        attitude_rad=(0.0, 0.0, rng_for(seed, "yaw").uniform(-math.pi, math.pi)),
        currents=(Current(0.0, (*asked.current_mps, 0.0)),),
        loads=(Payload(LOAD_KG, volume_m3, position_m=(0.0, 0.0, height_m)),),
        tether=Tether(anchor_m=(0.0, 0.0, 0.0)),
    )


def parameters(seed: int) -> UrovParameters:
    """Return the parameters for the controller, and the pilot's script."""
    asked = task(seed)
    script = (
        Cue(ARM_S, is_armed=True, mode="depth_hold", depth_m=asked.start_m),
        Cue(STEP_S, depth_m=asked.goal_m),
    )
    return UrovParameters(vehicle(), script)


class Tank(TrackedUrov):
    """The vehicle in its tank, with the requested targets, by which it is judged."""

    def reset(self, seed: int) -> None:
        """Reset, for another task."""
        self.asked = task(seed)
        super().reset(seed)

    def step_taken(self) -> StepResponse:
        """Return how the vehicle went from start to goal."""
        depths_m = self.asked.start_m, self.asked.goal_m
        return step_response(self.course, lambda sample: sample.depth_m, (STEP_S, END_S), depths_m, BAND_M)


def plant(seed: int, engine: str) -> Tank:
    """Return the vehicle at its start."""
    return Tank(vehicle(), Pool(40.0, 40.0, 7.0), dive, Propulsion(8), seed)


def verdict(plant: Tank) -> Verdict | None:
    """Return how it ended, once the time is over."""
    if plant.time_s < END_S - 1e-6:
        return None
    settling_s, overshoot_m, steady_m = plant.step_taken()
    misses = []
    if settling_s is None or settling_s > SETTLING_S:
        when = "did not settle" if settling_s is None else f"settled {settling_s:.1f} s"
        misses.append(f"{when} after the depth command (limit {SETTLING_S:g} s)")
    if overshoot_m is not None and overshoot_m > OVERSHOOT * abs(plant.asked.goal_m - plant.asked.start_m):
        misses.append(f"overshot by {overshoot_m:.2f} m (limit {OVERSHOOT:.0%} of the depth change)")
    if steady_m is not None and steady_m > STEADY_M:
        misses.append(f"steady-state error was {steady_m:.2f} m (limit {STEADY_M:g} m)")
    return hold_verdict(plant, misses)


def metrics(plant: Tank, seed: int) -> dict[str, Any]:
    """Return how well depth was held, and the cost."""
    asked, step = task(seed), plant.step_taken()
    way_m = abs(asked.goal_m - asked.start_m)
    return {
        "start_m": asked.start_m,
        "goal_m": asked.goal_m,
        "settling_s": step.settling_s,
        "overshoot": None if step.overshoot is None else step.overshoot / way_m,
        "steady_error_m": step.steady,
        "energy_j": plant.thrusters.energy_j,
    }
