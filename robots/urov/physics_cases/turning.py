"""Tumbling without drag, which keeps energy and momentum, and added mass that differs by axis."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from fossen_rk4 import rotation

from snr_sim.plants.urov.vehicle import Vehicle

from .case import ROUNDING, Case
from .closed_forms import steady_circle
from .swimming import SETS, along, go, mass_along, swim, undamped, weightless


def conserved() -> Iterator[Case]:
    """Energy and momentum of a tumbling vehicle and its water, without drag."""
    for name in SETS:
        one = undamped(weightless(name))

        def tumble(step_s: float, one: Vehicle = one) -> tuple[float, float]:
            plant = swim(one, step_s, velocity_mps=(1.0, 0.5, 0.3), rate_radps=(0.5, 0.7, 0.9))

            def momentum() -> np.ndarray:
                return rotation(np.array(plant.attitude)) @ (plant.mass_matrix @ plant.through_water)[:3]

            energy, linear = plant.kinetic_energy_j, momentum()
            go(plant, 20.0)
            gained = float(np.linalg.norm(momentum() - linear) / np.linalg.norm(linear))
            return plant.kinetic_energy_j / energy - 1.0, gained

        yield Case(
            "What is conserved", f"{name}: energy gained tumbling for 20 s, undamped", 0.0, "of it",
            lambda h, tumble=tumble: tumble(h)[0], 2e-5, ROUNDING,
        )  # fmt: skip
        yield Case(
            "What is conserved", f"{name}: change of momentum, as a vector", 0.0, "of it",
            lambda h, tumble=tumble: tumble(h)[1], 5e-5, ROUNDING,
        )  # fmt: skip


def munk() -> Iterator[Case]:
    """The moment on a body that goes askew, and the circle that it leads to without heading hold."""
    group = "Added mass that differs by axis"
    for name in SETS:
        one = weightless(name)
        added = np.diag(one.added_mass)
        askew = (added[0] - added[1]) * 1.0 * 0.2 / mass_along(one, 5)
        yield Case(
            group, f"{name}: yaw acceleration at 1 m/s ahead and 0.2 to the left (Munk)", float(askew), "rad/s2",
            lambda h, one=one: go(
                swim(undamped(one), h, velocity_mps=(1.0, 0.2, 0.0)), h
            ).rate_radps[2] / h, 1e-3, "it is the mean of a step, not its begin",
        )  # fmt: skip
        u, v, r = steady_circle(one, 40.0)
        radius = math.hypot(u, v) / abs(r)

        def circle(step_s: float, one: Vehicle = one) -> float:
            plant = go(swim(one, step_s, rate_radps=(0.0, 0.0, 0.05)), 60.0, along(0, 40.0))
            u, v, _, _, _, r = plant.through_water
            return math.hypot(u, v) / abs(r)

        yield Case(
            group, f"{name}: radius of the circle it falls into by 40 N ahead", radius, "m", circle, 1e-3,
            "what 60 s leave of the way into it",
        )  # fmt: skip
