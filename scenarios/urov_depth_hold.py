"""From 1 m down to 3 m and stay there, in a current, while a payload is released.

Every seed is another start, current and payload. The depth is held if, after the step, the vehicle settles within 10 cm
in 12 s, does not overshoot by more than 20 cm, and ends within 5 cm; and if, after the payload has gone, it is back
within 10 cm in 10 s. The pilot arms after two seconds, as the speed controllers need one to arm themselves.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_urov.evaluation import BODIES, Sample, Tracked, hold_verdict, step_response
from snr_sim_robot_urov.parameters import UrovParameters, vehicle

from snr_sim.plants import Current, Dive, Payload, Pool, Propulsion, Tether
from snr_sim.scenario import Verdict, rng_for
from snr_sim.teleop import Cue

ROBOT = "urov"
ENGINES = ("mujoco", "pymunk")
CONTROLLER = "holds"
END_S = 40.0
TIME_LIMIT_S = END_S + 1.0

FROM_M, TO_M = 1.0, 3.0
ARM_S, STEP_S, DROP_S = 2.0, 6.0, 22.0
BAND_M, SETTLING_S, OVERSHOOT_M, STEADY_M, RECOVERY_S = 0.10, 12.0, 0.20, 0.05, 10.0


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Return what happens in the run of a seed."""
    rng = rng_for(seed, "dive")
    speed, direction = rng.uniform(0.05, 0.2), rng.uniform(-math.pi, math.pi)
    mass = rng.uniform(0.3, 0.8)
    return Dive(
        position_m=(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), -FROM_M + rng.uniform(-0.2, 0.2)),
        attitude_rad=(rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), rng.uniform(-math.pi, math.pi)),
        currents=(Current(0.0, (speed * math.cos(direction), speed * math.sin(direction), 0.0)),),
        loads=(Payload(mass, volume_m3=mass * 0.4e-3, position_m=(0.0, 0.0, -0.1), end_s=DROP_S),),
        tether=Tether(anchor_m=(0.0, 0.0, 0.0)),
    )


def parameters(seed: int) -> UrovParameters:
    """Return the parameters for the controller, and the pilot's script."""
    script = (
        Cue(ARM_S, is_armed=True, mode="heading_hold", depth_m=FROM_M),
        Cue(STEP_S, depth_m=TO_M),
    )
    return UrovParameters(vehicle(), script)


def plant(seed: int, engine: str) -> Tracked:
    """Return the vehicle at its start."""
    # A long pool, so that no current carries it to a wall within a minute.
    return BODIES[engine](vehicle(), Pool(40.0, 40.0, 6.0), dive, Propulsion(8), seed)


def verdict(plant: Tracked) -> Verdict | None:
    """Return how it ended, once the time is over."""
    if plant.time_s < END_S - 1e-6:
        return None
    step, back = _step_responses(plant)
    misses = []
    if step.settling_s is None or step.settling_s > SETTLING_S:
        misses.append(_describe_settling(step.settling_s, "the step", SETTLING_S))
    if step.overshoot > OVERSHOOT_M:
        misses.append(f"overshot by {step.overshoot:.2f} m (limit {OVERSHOOT_M:g} m)")
    if back.settling_s is None or back.settling_s > RECOVERY_S:
        misses.append(_describe_settling(back.settling_s, "the payload drop", RECOVERY_S))
    if max(step.steady, back.steady) > STEADY_M:
        misses.append(f"steady-state error was {max(step.steady, back.steady):.3f} m (limit {STEADY_M:g} m)")
    return hold_verdict(plant, misses)


def metrics(plant: Tracked, seed: int) -> dict[str, Any]:
    """Return how well depth was held, and the cost."""
    step, back = _step_responses(plant)
    return {
        "settling_s": step.settling_s,
        "overshoot_m": step.overshoot,
        "steady_error_m": back.steady,
        "recovery_s": back.settling_s,
        "recovery_error_m": back.overshoot,
        "energy_j": plant.thrusters.energy_j,
        "charge": plant.thrusters.charge,
    }


def _step_responses(plant: Tracked) -> tuple[Any, Any]:
    def depth_m(sample: Sample) -> float:
        return sample.depth_m

    step = step_response(plant.course, depth_m, (STEP_S, DROP_S), (FROM_M, TO_M), BAND_M)
    back = step_response(
        plant.course, depth_m, (DROP_S, END_S), (TO_M + 1.0, TO_M), BAND_M
    )  # it goes up without payload
    return step, back


def _describe_settling(time_s: float | None, cause: str, limit_s: float) -> str:
    when = "did not settle" if time_s is None else f"settled {time_s:.1f} s"
    return f"{when} after {cause} (limit {limit_s:g} s)"
