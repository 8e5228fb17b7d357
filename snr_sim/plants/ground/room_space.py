"""A room under pymunk: its walls, furniture and people, and the body of a vehicle with touch bars."""

from __future__ import annotations

from snr_sim.plants.ground.body_space import BodySpace, box_corners
from snr_sim.plants.ground.room import Point, Room
from snr_sim.plants.pymunk_engine import pymunk_module

WALL_RADIUS_M = 0.01  # half the thickness of walls, which are centred on the outline


class RoomSpace:
    """The walls, furniture and people of a room, and a body of a size; with two touch bars, if they stand out.

    Attributes:
        plane: the body among them.
    """

    def __init__(self, room: Room, size_m: Point, bar_m: float = 0.0) -> None:
        pymunk = pymunk_module()
        self.plane: BodySpace = BodySpace()
        space = self.plane.space
        self._people = [pymunk.Body(body_type=pymunk.Body.KINEMATIC) for _ in room.walkers]
        space.add(*self._people)
        for a, b in room.edges_m():
            self.plane.add_thing(pymunk.Segment(space.static_body, a, b, WALL_RADIUS_M))
        for body, one in zip(self._people, room.walkers, strict=True):
            self.plane.add_thing(pymunk.Circle(body, one.radius_m))
        half_length, half_width = 0.5 * size_m[0], 0.5 * size_m[1]
        self.plane.add_outline(box_corners(half_length, half_width))
        self._bars = [
            self.plane.outline([(half_length, 0.0), (front, 0.0), (front, side), (half_length, side)])
            for front in [half_length + bar_m]
            if bar_m > 0.0
            for side in (half_width, -half_width)
        ]

    def put_people(self, places_m: list[Point]) -> None:
        """Set the positions of all people."""
        for body, place in zip(self._people, places_m, strict=True):
            body.position = place
            self.plane.space.reindex_shapes_for_body(body)

    def pressed_bars(self) -> list[bool]:
        """Return whether something presses each of the bars, left and right."""
        return [bool(self.plane.hits(bar)) for bar in self._bars]
