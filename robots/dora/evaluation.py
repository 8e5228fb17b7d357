"""Judge of an exploration, the same in every room: without a hard hit, and most of the floor seen."""

from __future__ import annotations

from typing import Any

from snr_sim.plants import DiffDrive2D
from snr_sim.scenario import Verdict

from .parameters import DoraParameters

END_S = 300.0
MAX_HIT_MPS = 0.1
MIN_SEEN = 0.6


def parameters(seed: int) -> DoraParameters:
    """Return the parameters for the controller: the same in every room."""
    return DoraParameters()


def verdict(plant: DiffDrive2D) -> Verdict | None:
    """Return how it ended, or None while it drives."""
    if plant.hit_mps > MAX_HIT_MPS:
        return Verdict("collided", False, f"it hit something at {plant.hit_mps:.2f} m/s (limit {MAX_HIT_MPS:g} m/s)")
    if plant.time_s < END_S - 1e-6:
        return None
    if plant.seen_share < MIN_SEEN:
        return Verdict(
            "incomplete", False, f"it saw {100 * plant.seen_share:.0f} % of the floor (limit {100 * MIN_SEEN:g} %)"
        )
    return Verdict("explored", True)


def metrics(plant: DiffDrive2D, seed: int) -> dict[str, Any]:
    """Return how far it drove, how much it saw, and how hard it hit something."""
    return {
        "way_m": plant.way_m,
        "seen_share": plant.seen_share,
        "hit_mps": plant.hit_mps,
        "mean_mps": plant.way_m / plant.time_s if plant.time_s else 0.0,
    }
