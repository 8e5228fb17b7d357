"""All at once: twenty seconds of a wrench on six axes in a current, beside fossen_rk4.py."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
from fossen_rk4 import Fossen, rotation

from snr_sim.plants.urov.dive import Current
from snr_sim.plants.urov.vehicle import Six, Vehicle

from .case import Case
from .swimming import CORNER, SETS, go, neutral, swim

MIXED_FLOW = (0.3, -0.2, 0.1)


def mixed_wrench(time_s: float) -> Six:
    """Returns a wrench that moves all axes."""
    return (
        20.0 * math.sin(0.5 * time_s), 10.0 * math.cos(0.7 * time_s), 5.0 * math.sin(1.1 * time_s),
        0.5 * math.sin(0.9 * time_s), 0.3 * math.cos(1.3 * time_s), math.sin(0.4 * time_s + 1.0),
    )  # fmt: skip


def lopsided() -> Vehicle:
    """Returns a vehicle whose matrices are full: no axis mirrors another, and its mass is off centre."""
    one = neutral("benzon2022")
    rng = np.random.default_rng(4)
    skew = np.diag([1.0, 1.0, 1.0, 0.15, 0.15, 0.15]) @ rng.normal(size=(6, 6))
    inertia = one.inertia_kgm2 + np.array([[0.0, 0.02, -0.01], [0.02, 0.0, 0.015], [-0.01, 0.015, 0.0]])
    return replace(
        one, name="lopsided", added_mass=one.added_mass + 2.0 * skew @ skew.T, inertia_kgm2=inertia,
        centre_of_mass_m=(0.02, -0.01, -0.03), net_buoyancy_n=None,
    )  # fmt: skip


@cache
def second_opinion(name: str) -> np.ndarray:
    """Returns where 20 s of the mixed wrench lead to in a current, by fossen_rk4.py."""
    start = np.array([*CORNER, 1.0, *(0.0,) * 9])
    fossen = Fossen(mixed(name), np.array(MIXED_FLOW))
    return fossen.run(start, lambda t: np.array(mixed_wrench(t)), 20.0, 0.01)


def mixed(name: str) -> Vehicle:
    """Returns the vehicle of a name, the lopsided one included."""
    return lopsided() if name == "lopsided" else replace(neutral(name), net_buoyancy_n=None)


@cache
def mixed_error(name: str, step_s: float) -> tuple[float, float]:
    """Returns how far the plant is from the second opinion after 20 s: position [m], attitude [rad]."""
    plant = swim(mixed(name), step_s, position_m=CORNER, currents=(Current(0.0, MIXED_FLOW),))
    for i in range(round(20.0 / step_s)):
        go(plant, step_s, mixed_wrench((i + 0.5) * step_s))
    end = second_opinion(name)
    q = end[3:7]
    turn = rotation(q).T @ rotation(np.array(plant.attitude))
    angle = 0.5 * math.hypot(turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1])
    return float(np.linalg.norm(np.array(plant.position_m) - end[:3])), angle


def together() -> Iterator[Case]:
    """Everything at once, against the second opinion."""
    for name in (*SETS, "lopsided"):
        yield Case(
            "All at once: 20 s of a wrench on six axes in a current, beside fossen_rk4.py", f"{name}: position", 0.0,
            "m", lambda h, name=name: mixed_error(name, h)[0], 5e-4,
        )  # fmt: skip
        yield Case(
            "All at once: 20 s of a wrench on six axes in a current, beside fossen_rk4.py", f"{name}: attitude", 0.0,
            "rad", lambda h, name=name: mixed_error(name, h)[1], 3e-4,
        )  # fmt: skip
