"""Judge of a clearing: most of the stones in the pit, and nothing else touched."""

from __future__ import annotations

from typing import Any

from snr_sim.plants import Dozer2D
from snr_sim.scenario import Verdict

from .parameters import HousecatParameters

END_S = 120.0
MIN_CLEARED = 0.8
MAX_HIT_MPS = 0.0


def parameters(seed: int) -> HousecatParameters:
    """Return the parameters for the controller: the same in every yard."""
    return HousecatParameters()


def verdict(plant: Dozer2D) -> Verdict | None:
    """Return how it ended, or None while it works."""
    if plant.hit_mps > MAX_HIT_MPS:
        return Verdict("collided", False, f"it hit a wall or a post at {plant.hit_mps:.2f} m/s")
    if plant.position_m[0] + 0.5 * plant.dozer.size_m[0] > plant.heap.edge_m + 0.3:
        return Verdict("fell", False, "it drove more than 0.3 m beyond the edge of the pit")
    if plant.cleared_share >= MIN_CLEARED:
        return Verdict("cleared", True)
    if plant.time_s < END_S - 1e-6:
        return None
    cleared, limit = 100.0 * plant.cleared_share, 100.0 * MIN_CLEARED
    return Verdict("incomplete", False, f"{cleared:.0f} % of the stones are in the pit (limit {limit:g} %)")


def metrics(plant: Dozer2D, seed: int) -> dict[str, Any]:
    """Return how much it cleared, how long it took, and how far it drove."""
    return {
        "cleared_share": plant.cleared_share,
        "time_s": plant.time_s,
        "way_m": plant.way_m,
        "hit_mps": plant.hit_mps,
    }
