"""Yards: walls, two posts, a pit in the east, and a heap of stones in the middle."""

from __future__ import annotations

import math
from functools import lru_cache

from snr_sim.plants import DriveStart, Heap, Room
from snr_sim.scenario import rng_for

from .parameters import STONE_FRICTION, STONE_KG, STONE_M, HousecatParameters

WEST_M, EAST_M, NORTH_M = -2.2, 2.2, 1.8
STONES = 60
POST_M = 0.06  # half the side of a post
POSTS = ((1.0, 1.25), (1.0, -1.25))


@lru_cache(maxsize=4)
def start(seed: int) -> tuple[DriveStart, Room, Heap]:
    """Return where the run of a seed begins, its yard and its heap: an ellipse of stones of many browns."""
    rng = rng_for(seed, "start")
    x, y = rng.uniform(0.0, 0.3), rng.uniform(-0.25, 0.25)
    half_x, half_y = rng.uniform(0.25, 0.32), rng.uniform(0.50, 0.60)
    places: list[tuple[float, float]] = []
    while len(places) < STONES:
        a, b = rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0)
        place = float(x + a * half_x), float(y + b * half_y)
        if a * a + b * b <= 1.0 and all(math.dist(place, one) > 2.0 * STONE_M for one in places):
            places.append(place)
    rgbs = tuple(
        (int(150 * bright), int(105 * bright), int(60 * bright)) for bright in rng.uniform(0.7, 1.6, STONES).tolist()
    )
    parameters = HousecatParameters()
    heap = Heap(tuple(places), rgbs, parameters.edge_m, STONE_M, STONE_KG, STONE_FRICTION)
    corners = ((-POST_M, -POST_M), (POST_M, -POST_M), (POST_M, POST_M), (-POST_M, POST_M))
    posts = tuple(tuple((at_x + dx, at_y + dy) for dx, dy in corners) for at_x, at_y in POSTS)
    outline = ((WEST_M, -NORTH_M), (EAST_M, -NORTH_M), (EAST_M, NORTH_M), (WEST_M, NORTH_M))
    begin = DriveStart((parameters.home_m, rng.uniform(-0.4, 0.4)), rng.uniform(-0.5, 0.5))
    return begin, Room(outline, posts), heap
