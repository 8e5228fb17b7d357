"""Water that moves as a whole."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from snr_sim.plants.dive import Current
from snr_sim.plants.vehicle import Vehicle

from .case import Case
from .closed_forms import coasting
from .swimming import SETS, go, mass_along, swim, undamped, weightless


def current() -> Iterator[Case]:
    """Water that moves as a whole."""
    flow = (0.3, 0.0, 0.0)
    for name in SETS:
        one = weightless(name)
        a, b = one.linear_damping[0], one.quadratic_damping[0]
        slip = coasting(mass_along(one, 0), a, b, 0.3, 3.0)
        yield Case(
            "Current", f"{name}: drift after 3 s in 0.3 m/s", 0.3 - slip, "m/s",
            lambda h, one=one: go(swim(one, h, currents=(Current(0.0, flow),)), 3.0).velocity_mps[0], 1e-4,
        )  # fmt: skip
        spinning = undamped(one)

        def off_course(step_s: float, one: Vehicle = spinning) -> float:
            """Tumbles in moving water, and in still water with the same speed through it: both must part evenly."""
            moving = swim(
                one, step_s, rate_radps=(0.3, 0.2, 1.0), velocity_mps=(0.5, 0.0, 0.0), currents=(Current(0.0, flow),)
            )
            still = swim(one, step_s, rate_radps=(0.3, 0.2, 1.0), velocity_mps=(0.2, 0.0, 0.0))
            go(moving, 10.0)
            go(still, 10.0)
            apart = np.array(moving.position_m) - np.array(still.position_m)
            return float(np.linalg.norm(apart - 10.0 * np.array(flow)))

        yield Case(
            "Current", f"{name}: tumbling in a current and in still water, part from its way in 10 s", 0.0, "m",
            off_course, 1e-9, "rounding",
        )  # fmt: skip
