"""Meeting floor, wall and post at speed: the same whatever the step, and never with more energy than before."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

from snr_sim.plants.urov.dive import Load
from snr_sim.plants.urov.pool import Gate
from snr_sim.plants.urov.urov import Urov
from snr_sim.plants.urov.vehicle import Vehicle

from .case import Case
from .swimming import BASIN, SETS, along, go, swim, undamped, vehicle, weightless

GROUP = "Meeting floor, wall and post, beside steps of 1 ms"
FINE_S = 0.001
POSTS = replace(BASIN, gates=(Gate("post", (1.0, -0.75, -2.0)),))
DROPPED = Load(6.0, 6.0 * 0.000088)
PART = "free steps before it, and how far into a part of a millisecond it touches"


def landing(one: Vehicle, step_s: float) -> Urov:
    """Comes down on the floor at speed ahead, nose down, pushed on."""
    push = (25.0, 0.0, -40.0, 0.0, 0.0, 0.0) if one.name == "wu2018" else (40.0, 0.0, -60.0, 0.0, 0.0, 0.0)
    plant = swim(
        one, step_s, BASIN, position_m=(-2.0, 0.0, -3.5), attitude_rad=(0.0, 0.1, 0.0), velocity_mps=(0.5, 0.0, -0.3)
    )
    return go(plant, 3.0, push)


def wall(one: Vehicle, step_s: float) -> Urov:
    """Runs into a wall askew and is pushed along it."""
    plant = swim(
        one, step_s, BASIN, position_m=(9.3, 0.0, -2.0), attitude_rad=(0.0, 0.0, 0.4), velocity_mps=(0.8, 0.3, 0.0)
    )
    return go(plant, 2.0, along(0, 20.0))


def post(one: Vehicle, step_s: float) -> Urov:
    """Runs into a gate's post with one shoulder."""
    return go(swim(one, step_s, POSTS, position_m=(0.4, 0.1, -2.0), velocity_mps=(0.8, 0.0, 0.0)), 1.5)


def drop(one: Vehicle, step_s: float) -> Urov:
    """Sinks to the floor with lead on it, tilted."""
    how = {"position_m": (0.0, 0.0, -3.3), "attitude_rad": (0.3, 0.2, 0.0), "velocity_mps": (0.4, 0.0, 0.0)}
    return go(swim(one, step_s, BASIN, loads=(DROPPED,), **how), 3.0)


HOW: dict[str, tuple[str, Callable[[Vehicle, float], Urov]]] = {
    "landing": ("lands at speed, pushed on: where it is after 3 s", landing),
    "wall": ("runs into a wall askew at 0.85 m/s: where it is after 2 s", wall),
    "post": ("runs into a post at 0.8 m/s: where it is after 1.5 s", post),
    "drop": ("dropped with 6 kg of lead, tilted: where it is after 3 s", drop),
}


@cache
def finely(name: str, how: str) -> tuple[float, float, float]:
    """Returns where steps of 1 ms lead to."""
    return HOW[how][1](vehicle(name), FINE_S).position_m


def gained_j(one: Vehicle, step_s: float) -> float:
    """Returns the most energy that a vehicle without drag has more, after it has touched the floor, than before.

    While it touches, energy is also in what gives way.
    """
    how = {"attitude_rad": (0.3, 0.4, 0.2), "velocity_mps": (0.8, 0.3, -0.5), "rate_radps": (0.5, -0.5, 0.7)}
    plant = swim(one, step_s, BASIN, position_m=(-5.0, 0.0, -3.4), loads=(DROPPED,), **how)
    heavy_n = BASIN.gravity_mps2 * (DROPPED.mass_kg - BASIN.density_kgm3 * DROPPED.volume_m3)
    least, most, touched = math.inf, 0.0, False
    for _ in range(round(3.0 / step_s)):
        plant.step(step_s)
        energy = plant.kinetic_energy_j + heavy_n * plant.position_m[2]
        if plant.contact_n is not None:
            touched = True
            continue
        most = max(most, energy - least) if touched else most
        least, touched = min(least, energy), False
    return most


def meeting() -> Iterator[Case]:
    """Landing, bumping into a wall and a post, and being dropped."""
    for name in SETS:
        for key, (what, run) in HOW.items():
            yield Case(
                GROUP, f"{name}: {what}", 0.0, "m",
                lambda h, name=name, key=key, run=run: math.dist(run(vehicle(name), h).position_m, finely(name, key)),
                1e-3, PART,
            )  # fmt: skip
        free = undamped(weightless(name))
        yield Case(
            GROUP, f"{name}: dropped tumbling, undamped: energy gained from one flight to the next", 0.0, "J",
            lambda h, free=free: gained_j(free, h), 1e-4, "what the rounds leave of the midpoint rule's equation",
        )  # fmt: skip
