"""Floor and wall, which meet the mass of vehicle and water."""

from __future__ import annotations

from collections.abc import Iterator

from snr_sim.plants.urov.vehicle import Vehicle

from .case import Case
from .swimming import BASIN, DEEP, SETS, along, go, mass_along, swim, undamped, vehicle, weightless


def contact() -> Iterator[Case]:
    """Floor and wall, which meet the mass of vehicle and water."""
    for name in SETS:
        one = vehicle(name).trimmed(BASIN.density_kgm3, BASIN.gravity_mps2)
        bottom = -BASIN.depth_m + 0.5 * one.size_m[2]

        def pressed(step_s: float, one: Vehicle = one, bottom: float = bottom) -> float:
            plant = go(swim(one, step_s, BASIN, position_m=(0.0, 0.0, bottom)), 3.0, along(2, -40.0))
            return (plant.contact_n or DEEP)[2]

        yield Case(
            "Contact", f"{name}: force on the floor, 40 N down less 1.5 N", 38.5, "N", pressed, 1e-3,
            "what 3 s leave of settling",
        )  # fmt: skip
        free = undamped(weightless(name))
        side = 0.5 * BASIN.length_m - 0.5 * one.size_m[0]

        def bump(step_s: float, free: Vehicle = free, side: float = side) -> float:
            """Meets a wall with the bow; returns the wall's impulse less the change of momentum, as a share of it."""
            plant = swim(free, step_s, BASIN, position_m=(side - 0.1, 0.0, -2.0), velocity_mps=(0.5, 0.0, 0.0))
            impulse = 0.0
            for _ in range(round(0.6 / step_s)):
                plant.step(step_s)
                impulse += step_s * (plant.contact_n or (0.0, 0.0, 0.0))[0]
            return impulse / (mass_along(free, 0) * (plant.velocity_mps[0] - 0.5))

        yield Case(
            "Contact", f"{name}: impulse of a wall, by the change of momentum of vehicle and water", 1.0, "",
            bump, 1e-9, "rounding",
        )  # fmt: skip
