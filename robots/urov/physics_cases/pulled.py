"""The cheap tether: its drag, and its stretch."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from snr_sim.plants.urov.dive import Current
from snr_sim.plants.urov.tether import Tether

from .case import Case
from .swimming import SEA, along, go, mass_along, swim, weightless


def tether() -> Iterator[Case]:
    """The cheap tether."""
    one = weightless("benzon2022")
    line = Tether((0.0, 0.0, -50.0), 20.0, place_m=(0.0, 0.0, 0.0))
    mass = mass_along(one, 1)
    drag = 0.5 * 0.5 * SEA.density_kgm3 * line.across * line.diameter_m * 20.0 * 0.3**2
    flow = (Current(0.0, (0.0, 0.3, 0.0)),)

    def pull(step_s: float) -> float:
        """Force of the tether alone at the first moment: acceleration with it less that without it."""
        place = (20.0, 0.0, -50.0)
        with_it = swim(one, step_s, position_m=place, currents=flow, tether=line).read("imu").specific_force_mps2[1]
        alone = swim(one, step_s, position_m=place, currents=flow).read("imu").specific_force_mps2[1]
        return mass * (with_it - alone)

    yield Case("Tether", "20 m across 0.3 m/s: share at the vehicle", drag, "N", pull, 1e-9, "rounding")
    stretched = 20.0 + 50.0 / line.stiffness_npm
    bare = replace(line, across=0.0, along=0.0)
    yield Case(
        "Tether", "20 m, pulled with 50 N: length", stretched, "m",
        lambda h: go(swim(one, h, position_m=(19.5, 0.0, -50.0), tether=bare), 40.0, along(0, 50.0)).position_m[0],
        1e-4, "what 40 s leave of bouncing",
    )  # fmt: skip
