"""A body among things in the plane, under pymunk: what it touches, and how far it is to the nearest thing.

pymunk only answers queries here. Nothing moves in its space, so an answer depends on nothing but where things are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from snr_sim.plants.impulses_2d import Contact, contacts_of
from snr_sim.plants.pymunk_engine import pymunk_module

Point = tuple[float, float]
FAR_M = 100.0
ANY, LOW, HIGH = 0b11, 0b01, 0b10  # what is near the floor, and what is above it


class BodySpace:
    """A body, made of convex outlines, in a space with things.

    Attributes:
        space: pymunk's.
        body: pymunk's.
    """

    def __init__(self) -> None:
        self._pymunk = pymunk = pymunk_module()
        self.space: Any = pymunk.Space()
        self.body: Any = pymunk.Body(1.0, 1.0)
        self._filter = pymunk.ShapeFilter()
        self._outlines: list[Any] = []
        self._reach_m = 0.0

    def add_outline(self, corners_m: Sequence[Point], layers: int = ANY) -> None:
        """Add an outline to the body, which touches what is in the same layers."""
        shape = self.outline(corners_m)
        shape.filter = self._pymunk.ShapeFilter(mask=layers)
        self._outlines.append(shape)

    def outline(self, corners_m: Sequence[Point]) -> Any:
        """Return a shape that moves with the body, within its reach."""
        self._reach_m = max(self._reach_m, *(math.hypot(*corner) for corner in corners_m))
        return self._pymunk.Poly(self.body, corners_m)

    def add_thing(self, shape: Any, layers: int = ANY) -> None:
        """Add a thing, whose shape is on the space's static body or on another one."""
        shape.filter = self._pymunk.ShapeFilter(categories=layers)
        self.space.add(shape)

    def put_body(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Set the pose of the body."""
        self.body.position, self.body.angle = (x_m, y_m), heading_rad

    def clearance_m(self) -> float:
        """Return a distance over which the body can move, however it turns, without touching anything."""
        nearest = self.space.point_query_nearest(self.body.position, FAR_M, self._filter)
        return FAR_M if nearest is None else float(nearest.distance - self._reach_m)

    def contacts(self) -> list[Contact]:
        """Return where the body touches something: y and turns as in `impulses_2d`. In an order of their own."""
        x, y = self.body.position
        found = (contact for shape in self._outlines for hit in self.hits(shape) for contact in contacts_of(hit, x, y))
        return sorted(found)

    def hits(self, shape: Any) -> list[Any]:
        """Return what a shape touches."""
        shape.cache_bb()
        return list(self.space.shape_query(shape))

    def distance_m(self, start: Point, end: Point) -> float | None:
        """Return how far it is from one point towards another to the first thing; None if there is none before."""
        hit = self.space.segment_query_first(start, end, 0.0, self._filter)
        return None if hit is None else float(hit.alpha) * math.dist(start, end)


def box_corners(half_length_m: float, half_width_m: float, center_m: Point = (0.0, 0.0)) -> list[Point]:
    """Return the corners of a box whose length is along x."""
    x, y = center_m
    signs = ((1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0))
    return [(x + a * half_length_m, y + b * half_width_m) for a, b in signs]
