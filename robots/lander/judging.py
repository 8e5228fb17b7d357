"""How a landing is judged, the same in every scenario: by the gear, and by propellant beside the least possible."""

from __future__ import annotations

from typing import Any, Protocol

from snr_sim.plants.descent import Engine, Motion, cheapest_descent
from snr_sim.plants.gear import Touchdown
from snr_sim.plants.lander import Lander
from snr_sim.plants.lander_1d import Lander1D, VerticalStart
from snr_sim.plants.module import PlaneStart
from snr_sim.plants.module_shapes import PADS_BELOW_M
from snr_sim.plants.terrain import Terrain
from snr_sim.prelude.scenario import Verdict


class Landing(Protocol):
    """What both landers say about their end."""

    outcome: str | None
    touchdown: Touchdown | None
    fuel_kg: float

    @property
    def why(self) -> str:
        """What ended it badly, in words."""
        ...


def judge(plant: Landing) -> Verdict | None:
    """Returns how it ended, or None while it flies."""
    return None if plant.outcome is None else Verdict(plant.outcome, plant.outcome == "landed", plant.why)


def vertical_metrics(plant: Lander1D, start: VerticalStart, engine: Engine) -> dict[str, Any]:
    """Returns touchdown and propellant of a vertical descent. The optimum is exact: nothing can do with less."""
    optimum = cheapest_descent(Motion(start.height_m, start.velocity_mps, start.mass_kg), engine).fuel_kg
    return _metrics(plant, start.fuel_kg - plant.fuel_kg, optimum)


def plane_metrics(plant: Lander, start: PlaneStart, ground: Terrain) -> dict[str, Any]:
    """Returns touchdown and propellant of a descent in the plane.

    The optimum is that of the same descent straight down under the module, by an engine that runs at any throttle. It
    leaves out the way to the pad and the sideways speed: a lower bound that no flight reaches.
    """
    module = plant.module
    height = start.position_m[1] - PADS_BELOW_M - ground.ground(start.position_m[0])[0]
    motion = Motion(height, start.velocity_mps[1], start.mass_kg)
    optimum = cheapest_descent(motion, Engine(module.thrust_n, module.exhaust_mps, module.gravity_mps2)).fuel_kg
    return _metrics(plant, start.fuel_kg - plant.fuel_kg, optimum)


def _metrics(plant: Landing, fuel_kg: float, optimum_kg: float) -> dict[str, Any]:
    touchdown = plant.touchdown
    return {
        "touchdown": touchdown and dict(touchdown),
        "fuel_kg": fuel_kg,
        "fuel_optimum_kg": optimum_kg,
        "fuel_ratio": fuel_kg / optimum_kg if plant.outcome == "landed" else None,  # to fall costs nothing
    }
