"""A room under pymunk: what the body of a vehicle touches, and how far it is to a wall.

pymunk only answers queries here. Nothing moves in its space, so an answer depends on nothing but where things are.
"""

from __future__ import annotations

import math
from typing import Any

from snr_sim.plants.ground.room import Point, Room
from snr_sim.plants.impulses_2d import Contact, contacts_of
from snr_sim.plants.pymunk_engine import pymunk_module

WALL_RADIUS_M = 0.01  # half the thickness of walls, which are centred on the outline


class RoomSpace:
    """The walls, furniture and people of a room, and a body of a size; with two touch bars, if they stand out."""

    def __init__(self, room: Room, size_m: Point, bar_m: float = 0.0) -> None:
        pymunk = pymunk_module()
        self._space = space = pymunk.Space()
        self._filter = pymunk.ShapeFilter()
        segments = [pymunk.Segment(space.static_body, a, b, WALL_RADIUS_M) for a, b in room.edges_m()]
        self._people = [pymunk.Body(body_type=pymunk.Body.KINEMATIC) for _ in room.walkers]
        circles = [pymunk.Circle(body, one.radius_m) for body, one in zip(self._people, room.walkers, strict=True)]
        space.add(*segments, *self._people, *circles)
        self._body = pymunk.Body(1.0, 1.0)
        half_length, half_width = 0.5 * size_m[0], 0.5 * size_m[1]
        self._frame = pymunk.Poly.create_box(self._body, size_m)
        self._bars = [
            pymunk.Poly(self._body, [(half_length, 0.0), (front, 0.0), (front, side), (half_length, side)])
            for front in [half_length + bar_m]
            if bar_m > 0.0
            for side in (half_width, -half_width)
        ]
        self._reach_m = math.hypot(half_length + bar_m, half_width)

    def put_people(self, places_m: list[Point]) -> None:
        """Set the positions of all people."""
        for body, place in zip(self._people, places_m, strict=True):
            body.position = place
            self._space.reindex_shapes_for_body(body)

    def put_body(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Set the pose of the body."""
        self._body.position, self._body.angle = (x_m, y_m), heading_rad

    def clearance_m(self) -> float:
        """Return a distance over which body and bars can move, however they turn, without touching anything."""
        nearest = self._space.point_query_nearest(self._body.position, 100.0, self._filter)
        return 100.0 if nearest is None else float(nearest.distance - self._reach_m)

    def contacts(self) -> list[Contact]:
        """Return where the frame touches something: y and turns as in `impulses_2d`. In an order of their own."""
        x, y = self._body.position
        return sorted(contact for hit in self._hits(self._frame) for contact in contacts_of(hit, x, y))

    def pressed_bars(self) -> list[bool]:
        """Return whether something presses each of the bars, left and right."""
        return [bool(self._hits(bar)) for bar in self._bars]

    def _hits(self, shape: Any) -> list[Any]:
        shape.cache_bb()
        return list(self._space.shape_query(shape))

    def distance_m(self, start: Point, end: Point) -> float | None:
        """Return how far it is from one point towards another to the first thing; None if there is none before."""
        hit = self._space.segment_query_first(start, end, 0.0, self._filter)
        return None if hit is None else float(hit.alpha) * math.dist(start, end)
