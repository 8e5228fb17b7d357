"""Stones that a blade pushes over a floor.

Soil is slow: friction stops a stone that was pushed at 0.3 m/s within 1 cm. So stones have no momentum here. One lies
where it is until the blade or another stone moves it, and it moves no farther than out of the way: from the blade
forward, from a stone along the line between both middles. Stones are taken in order of their distance from the blade,
each moves those in front of it. The blade feels the friction of all that moved.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from snr_sim.plants.ground.dozer import Heap
from snr_sim.plants.ground.room import Point
from snr_sim.plants.ground.traction import GRAVITY_MPS2

SLACK_M = 1e-9


class Push(NamedTuple):
    """What a blade feels: a force, and how far to the left of its middle it acts."""

    force_n: float = 0.0
    arm_m: float = 0.0


class Soil:
    """The rules by which the stones of a heap move in front of a blade."""

    def __init__(self, heap: Heap, blade_m: float) -> None:
        self._heap = heap
        self._half_blade_m = 0.5 * blade_m
        self._per_stone_n = heap.friction * heap.stone_kg * GRAVITY_MPS2

    def is_in_pit(self, place_m: Point) -> bool:
        """Return whether a stone at a place has fallen into the pit."""
        return place_m[0] > self._heap.edge_m

    def count_in_pit(self, stones: tuple[Point, ...]) -> int:
        """Return how many stones have fallen into the pit."""
        edge_m = self._heap.edge_m
        return len([None for x, _ in stones if x > edge_m])

    def push(self, stones: tuple[Point, ...], blade: Point, heading_rad: float) -> tuple[tuple[Point, ...], Push]:
        """Return the stones after a small movement of the blade, and what it feels.

        `stones` and `blade`, the middle of its front, are x and y, world frame [m].
        """
        radius, (x, y) = self._heap.radius_m, blade
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        # Blade frame: ahead and to the left. Those behind are under the vehicle, and pass between its tracks.
        places: dict[int, Point] = {}
        edge_m = self._heap.edge_m
        for i, (at_x, at_y) in enumerate(stones):
            if at_x <= edge_m:
                dx, dy = at_x - x, at_y - y
                ahead = cos * dx + sin * dy
                if ahead > -radius:
                    places[i] = ahead, cos * dy - sin * dx
        moved = self._move_by_blade(places)
        if not moved:
            return stones, Push()
        self._move_by_stones(places, moved)
        news = list(stones)
        for i in moved:
            ahead, left = places[i]
            news[i] = x + cos * ahead - sin * left, y + sin * ahead + cos * left
        arm_m = math.fsum(places[i][1] for i in moved) / len(moved)
        return tuple(news), Push(
            self._per_stone_n * len(moved), min(self._half_blade_m, max(-self._half_blade_m, arm_m))
        )

    def _move_by_blade(self, places: dict[int, Point]) -> set[int]:
        """Move the stones that the blade would enter; return which."""
        radius, half = self._heap.radius_m, self._half_blade_m
        moved = set()
        for i, (ahead, left) in places.items():
            beyond = max(0.0, abs(left) - half)  # the end of the blade
            if ahead < radius and beyond < radius:
                out = math.sqrt(radius * radius - beyond * beyond)
                if ahead < out - SLACK_M:
                    places[i] = out, left
                    moved.add(i)
        return moved

    def _move_by_stones(self, places: dict[int, Point], moved: set[int]) -> None:
        """Move the stones that others would enter, from the blade forward."""
        size = 2.0 * self._heap.radius_m
        order = sorted(places, key=lambda i: (places[i], i))
        for at, i in enumerate(order):
            if i not in moved:
                continue
            ahead, left = places[i]
            for j in order[at + 1 :]:
                to_ahead, to_left = places[j]
                away, aside = to_ahead - ahead, to_left - left
                if away >= size:
                    if j not in moved:
                        break  # those that follow lay farther, and none of them has come nearer
                    continue
                gap2 = away * away + aside * aside
                if gap2 < size * size - SLACK_M:
                    gap = math.sqrt(gap2)
                    share = size / gap if gap > 0.0 else 0.0
                    places[j] = (ahead + share * away, left + share * aside) if share else (ahead + size, left)
                    moved.add(j)
