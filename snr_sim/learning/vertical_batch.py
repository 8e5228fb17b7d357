"""Many vertical landers at once, as arrays: the physics of `plants/lander/lander_1d.py`, thousands of times per step.

Between commands it is the same closed form. Only where a step ends in the ground, the speed there is that of constant
acceleration over the last piece: good to a centimetre a second, or to half a metre if the tank runs dry within it; the
judge's limit is three metres a second.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from snr_sim.plants.lander.descent import Engine

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Landers(NamedTuple):
    """Where they are. Each array has the shape (n,).

    Args:
        height_m: of the pads over the ground.
        velocity_mps: positive up.
        mass_kg: all of it.
        fuel_kg: of it, what may be burned.
    """

    height_m: Floats
    velocity_mps: Floats
    mass_kg: Floats
    fuel_kg: Floats


def step(landers: Landers, throttle: Floats, engine: Engine, dt_s: float) -> tuple[Landers, Bools, Floats]:
    """Return where they are after a step, which of them have touched the ground, and how fast those were then.

    Args:
        landers: all in flight.
        throttle: of each, 0 to 1.

    Returns:
        the landers; whether each has touched down; its speed there [m/s], positive down, 0 where it has not.
    """
    height, velocity, mass, fuel = landers
    thrust_n, exhaust, gravity = engine
    flow = throttle * thrust_n / exhaust
    with np.errstate(divide="ignore", invalid="ignore"):
        burn_s = np.where(flow * dt_s <= fuel, dt_s, fuel / flow)
        left = mass - flow * burn_s
        gained = -exhaust * np.log1p(-flow * burn_s / mass)
        rise = np.where(flow > 0.0, exhaust * burn_s - left / flow * gained, 0.0)
    rise += gained * (dt_s - burn_s)  # the rest of the step after the tank ran dry
    new_velocity = velocity - gravity * dt_s + gained
    new_height = height + (velocity - 0.5 * gravity * dt_s) * dt_s + rise
    touches = (new_height <= 0.0) & (new_velocity < 0.0)
    mean = (new_velocity - velocity) / dt_s
    speed = np.where(touches, np.sqrt(np.maximum(0.0, velocity**2 - 2.0 * mean * height)), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        until_s = np.where(touches, np.minimum(burn_s, 2.0 * height / (speed - velocity)), burn_s)
    burned = flow * until_s  # the engine stops at the ground
    return Landers(new_height, new_velocity, mass - burned, np.maximum(0.0, fuel - burned)), touches, speed
