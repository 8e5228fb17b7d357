"""Water that moves as a whole."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from snr_sim.plants.urov.dive import Current
from snr_sim.plants.urov.vehicle import Vehicle

from .case import Case
from .closed_forms import coasting, terminal_speed
from .swimming import SEA, SETS, go, mass_along, swim, undamped, vehicle, weightless


def current() -> Iterator[Case]:
    """Water that moves as a whole."""
    flow, up = (0.3, 0.0, 0.0), (0.0, 0.0, 0.2)
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
        slip = coasting(mass_along(one, 2), one.linear_damping[2], one.quadratic_damping[2], 0.2, 3.0)
        yield Case(
            "Current", f"{name}: lifted, after 3 s, by a current of 0.2 m/s upwards", 0.2 - slip, "m/s",
            lambda h, one=one: go(swim(one, h, currents=(Current(0.0, up),)), 3.0).velocity_mps[2], 1e-4,
        )  # fmt: skip
        as_is = vehicle(name).trimmed(SEA.density_kgm3, SEA.gravity_mps2)
        rises = terminal_speed(one.linear_damping[2], one.quadratic_damping[2], 1.5)
        yield Case(
            "Current", f"{name}: with its 1.5 N in a current of 0.3 m/s downwards", rises - 0.3, "m/s",
            lambda h, as_is=as_is: go(
                swim(as_is, h, currents=(Current(0.0, (0.0, 0.0, -0.3)),)), 30.0
            ).velocity_mps[2], 1e-5, "what is left of the way to it in 30 s",
        )  # fmt: skip
