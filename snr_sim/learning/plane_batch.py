"""Many landers in the plane at once, as arrays: the flight of `plants/lander/lander_2d.py` until something touches.

The engine's lag, its propellant and the jets are the plant's; the ground is level, and a touchdown is where the lower
foot of a tilted module meets it. Steps are taken in parts of `PART_S`, position and speed by the mean acceleration of
each: a flight of 10 s is where the plant's is to some centimetres (tests/learning/test_plane_batch.py).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from snr_sim.plants.lander.legs import FEET_M
from snr_sim.plants.lander.module import LunarModule
from snr_sim.plants.lander.module_shapes import PADS_BELOW_M

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
PART_S = 0.05
FEET_OUT_M = max(abs(x) for x, _ in FEET_M)


class PlaneLanders(NamedTuple):
    """Where they are. Each array has the shape (n,).

    Args:
        height_m: of the pads over level ground, as if upright.
        vz_mps, vx_mps: up and to the right.
        attitude_rad, rate_radps: positive counter-clockwise.
        mass_kg: all of it.
        fuel_kg: of it, what may be burned.
        throttle: of the engine, which approaches the commanded one.
    """

    height_m: Floats
    vz_mps: Floats
    vx_mps: Floats
    attitude_rad: Floats
    rate_radps: Floats
    mass_kg: Floats
    fuel_kg: Floats
    throttle: Floats


def step(landers: PlaneLanders, throttle: Floats, turn: Floats, module: LunarModule, dt_s: float) -> PlaneLanders:
    """Return where they are after a step of whole parts of `PART_S`; all of them fly.

    Args:
        throttle: commanded of each, fractions that the engine can run at.
        turn: of the attitude jets of each, -1 to 1.
    """
    height, vz, vx, attitude, rate, mass, fuel, runs = landers
    inertia_per_kg = module.gyration_m**2
    keeps = math.exp(-PART_S / module.throttle_lag_s) if module.throttle_lag_s > 0.0 else 0.0
    for _ in range(round(dt_s / PART_S)):
        goal = np.where(fuel > 0.0, throttle, 0.0)
        then = goal + (runs - goal) * keeps
        # Of a lag of first order, exactly: where it was, where it is, and how much has gone by in between.
        mean = goal + (runs - then) * module.throttle_lag_s / PART_S if module.throttle_lag_s > 0.0 else goal
        runs = then
        burned = np.minimum(fuel, mean * module.thrust_n / module.exhaust_mps * PART_S)
        push = burned * module.exhaust_mps / (mass - 0.5 * burned) / PART_S
        turning = turn * module.jets_nm / (mass * inertia_per_kg)
        middle = attitude + 0.5 * rate * PART_S + 0.125 * turning * PART_S**2
        attitude = attitude + rate * PART_S + 0.5 * turning * PART_S**2
        rate = rate + turning * PART_S
        climbing = push * np.cos(middle) - module.gravity_mps2
        height = height + vz * PART_S + 0.5 * climbing * PART_S**2
        vz, vx = vz + climbing * PART_S, vx - push * np.sin(middle) * PART_S
        mass, fuel = mass - burned, fuel - burned
    return PlaneLanders(height, vz, vx, attitude, rate, mass, fuel, runs)


def touches(landers: PlaneLanders) -> Bools:
    """Return which of them have a foot on the ground."""
    lower_m = FEET_OUT_M * np.abs(np.sin(landers.attitude_rad)) - PADS_BELOW_M * (1.0 - np.cos(landers.attitude_rad))
    down: Bools = landers.height_m <= lower_m
    return down
