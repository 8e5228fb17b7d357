"""From 1 m down to 3 m and stay there, in a current, while a payload is released.

Every seed is another start, current and payload. The depth is held if, after the step, the vehicle settles within 10 cm
in 12 s, does not overshoot by more than 20 cm, and ends within 5 cm; and if, after the payload has gone, it is back
within 10 cm in 10 s. The pilot arms after two seconds, as the speed controllers need one to arm themselves.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_urov.judging import BODIES, Sample, Watched, followed, judged
from snr_sim_robot_urov.parameters import UrovParameters, vehicle

from snr_sim.plants.urov.dive import Current, Dive, Load
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.tether import Tether
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.scenario import Verdict
from snr_sim.teleop.scripted_pilot import Cue

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
    speed, way = rng.uniform(0.05, 0.2), rng.uniform(-math.pi, math.pi)
    mass = rng.uniform(0.3, 0.8)
    return Dive(
        position_m=(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), -FROM_M + rng.uniform(-0.2, 0.2)),
        attitude_rad=(rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), rng.uniform(-math.pi, math.pi)),
        currents=(Current(0.0, (speed * math.cos(way), speed * math.sin(way), 0.0)),),
        loads=(Load(mass, volume_m3=mass * 0.4e-3, place_m=(0.0, 0.0, -0.1), until_s=DROP_S),),
        tether=Tether(anchor_m=(0.0, 0.0, 0.0)),
    )


def parameters(seed: int) -> UrovParameters:
    """Return the parameters for the controller, and the pilot's script."""
    script = (
        Cue(ARM_S, is_armed=True, mode="heading_hold", depth_m=FROM_M),
        Cue(STEP_S, depth_m=TO_M),
    )
    return UrovParameters(vehicle(), script)


def plant(seed: int, engine: str) -> Watched:
    """Return the vehicle at its start."""
    # A long pool, so that no current carries it to a wall within a minute.
    return BODIES[engine](vehicle(), Pool(40.0, 40.0, 6.0), dive, Propulsion(8), seed)


def verdict(plant: Watched) -> Verdict | None:
    """Return how it ended, once the time is over."""
    if plant.time_s < END_S - 1e-6:
        return None
    step, back = _judged(plant)
    misses = []
    if step.settling_s is None or step.settling_s > SETTLING_S:
        misses.append(f"settled {_in_s(step.settling_s)} after the step, not in {SETTLING_S:g} s")
    if step.overshoot > OVERSHOOT_M:
        misses.append(f"overshot by {step.overshoot:.2f} m, more than {OVERSHOOT_M:g} m")
    if back.settling_s is None or back.settling_s > RECOVERY_S:
        misses.append(f"was back {_in_s(back.settling_s)} after the payload had gone, not in {RECOVERY_S:g} s")
    if max(step.steady, back.steady) > STEADY_M:
        misses.append(f"ended {max(step.steady, back.steady):.3f} m off, more than {STEADY_M:g} m")
    return judged(plant, misses)


def metrics(plant: Watched, seed: int) -> dict[str, Any]:
    """Return how well depth was held, and the cost."""
    step, back = _judged(plant)
    return {
        "settling_s": step.settling_s,
        "overshoot_m": step.overshoot,
        "steady_error_m": back.steady,
        "recovery_s": back.settling_s,
        "recovery_error_m": back.overshoot,
        "energy_j": plant.thrusters.energy_j,
        "charge": plant.thrusters.charge,
    }


def _judged(plant: Watched) -> tuple[Any, Any]:
    def depth_m(sample: Sample) -> float:
        return sample.depth_m

    step = followed(plant.course, depth_m, (STEP_S, DROP_S), (FROM_M, TO_M), BAND_M)
    back = followed(plant.course, depth_m, (DROP_S, END_S), (TO_M + 1.0, TO_M), BAND_M)  # it goes up without payload
    return step, back


def _in_s(time_s: float | None) -> str:
    return "never" if time_s is None else f"{time_s:.1f} s"
