"""A room seen from above: walls, furniture, and people who walk to and fro. World frame: x east, y north, metres."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated, TypeAlias

from snr_sim.plants.parameter_limits import IS_ABOVE, MILLIMETRES, Limit, Record, check_vector, format_value
from snr_sim.prelude.errors import ParameterError

Point: TypeAlias = tuple[float, float]
Outline: TypeAlias = tuple[Point, ...]

PLACE_M = Limit(-50.0, 50.0, "m", "rooms are smaller", MILLIMETRES)
RADIUS_M = Limit(0.0, 2.0, "m", "people have about 0.2", MILLIMETRES, IS_ABOVE)
WALK_MPS = Limit(0.0, 3.0, "m/s", "people walk at 1.4")
CELL_M = 0.1  # size of the squares in which the floor is counted
LINE_STEP_M = 0.5 * CELL_M
MAX_CELLS = 40_000
AXES = ("x", "y")


@dataclass(frozen=True)
class Walker(Record, who="The walker's "):
    """A person who walks between two points, and waits while a robot is in the way.

    Args:
        start_m, end_m: the two points.
        radius_m: of a person, as a circle.
        speed_mps: of walking.

    Raises:
        ParameterError: a number is out of range, or the points are the same.
    """

    start_m: Annotated[Point, PLACE_M, AXES]
    end_m: Annotated[Point, PLACE_M, AXES]
    radius_m: Annotated[float, RADIUS_M] = 0.2
    speed_mps: Annotated[float, WALK_MPS] = 0.4

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.start_m == self.end_m:
            raise ParameterError(f"A walker goes from {self.start_m} to the same point.", fix="give two points.")

    @cached_property
    def way_m(self) -> float:
        """Distance between the two points."""
        return math.dist(self.start_m, self.end_m)

    def place_m(self, along_m: float) -> Point:
        """Return the position at a distance from the start; on the way back this is more than `way_m`.

        >>> Walker((0.0, 0.0), (2.0, 0.0)).place_m(3.0)
        (1.0, 0.0)
        """
        share = min(along_m, 2.0 * self.way_m - along_m) / self.way_m
        (x, y), (to_x, to_y) = self.start_m, self.end_m
        return x + share * (to_x - x), y + share * (to_y - y)


@dataclass(frozen=True)
class Room:
    """A floor within an outline.

    Args:
        outline_m: corners of the walls, in order around the room.
        furniture_m: outlines of what is in it.
        walkers: people.

    Raises:
        ParameterError: an outline has fewer than three corners, a number is out of range, or there is no floor.
    """

    outline_m: Outline
    furniture_m: tuple[Outline, ...] = ()
    walkers: tuple[Walker, ...] = ()

    def __post_init__(self) -> None:
        for what, outline in self.outlines():
            if not isinstance(outline, (tuple, list)) or len(outline) < 3:
                raise ParameterError(f"{what} is {format_value(outline)}.", fix="give three corners (x, y) or more.")
            for corner in outline:
                check_vector(f"A corner of {what.lower()}", corner, PLACE_M, AXES)
        width_m, height_m = (max(values) - min(values) for values in zip(*self.outline_m, strict=True))
        if width_m * height_m > MAX_CELLS * CELL_M**2:
            raise ParameterError(f"The room is {width_m:g} m by {height_m:g} m.", fix="give a room of up to 400 m2.")
        if not self.floor_cells:
            raise ParameterError("The room has no floor.", fix="give corners in order around the room.")

    def outlines(self) -> list[tuple[str, Outline]]:
        """Return all outlines, with what each is of."""
        return [("The room", self.outline_m), *(("Furniture", outline) for outline in self.furniture_m)]

    def edges_m(self) -> list[tuple[Point, Point]]:
        """Return all edges of walls and furniture."""
        return [edge for _, outline in self.outlines() for edge in pairwise((*outline, outline[0]))]

    def is_floor(self, x_m: float, y_m: float) -> bool:
        """Return whether a point is in the room and not in its furniture; on an edge either may be returned."""
        return is_inside(self.outline_m, x_m, y_m) and not any(is_inside(one, x_m, y_m) for one in self.furniture_m)

    @cached_property
    def floor_cells(self) -> frozenset[tuple[int, int]]:
        """Squares of `CELL_M` whose middle is floor, by `cells_along`."""
        columns, rows = (
            range(math.floor(min(values) / CELL_M), math.ceil(max(values) / CELL_M))
            for values in zip(*self.outline_m, strict=True)
        )
        middle = [(i, j) for i in columns for j in rows if self.is_floor((i + 0.5) * CELL_M, (j + 0.5) * CELL_M)]
        return frozenset(middle)


def cells_along(start_m: Point, direction: Point, length_m: float) -> set[tuple[int, int]]:
    """Return the squares of the floor on a line, every `LINE_STEP_M`; `direction` is a unit vector.

    >>> sorted(cells_along((0.05, 0.05), (-1.0, 0.0), 0.1))
    [(-1, 0), (0, 0)]
    """
    (x, y), (dx, dy) = start_m, (LINE_STEP_M * part for part in direction)
    count = int(length_m / LINE_STEP_M) + 1
    return {(math.floor((x + i * dx) / CELL_M), math.floor((y + i * dy) / CELL_M)) for i in range(count)}


def is_inside(outline: Outline, x_m: float, y_m: float) -> bool:
    """Return whether a point is inside an outline: a ray from it crosses the outline an odd number of times.

    >>> is_inside(((0.0, 0.0), (2.0, 0.0), (0.0, 2.0)), 0.5, 0.5), is_inside(((0.0, 0.0), (2.0, 0.0), (0.0, 2.0)), 2, 2)
    (True, False)
    """
    inside = False
    for (ax, ay), (bx, by) in pairwise((*outline, outline[0])):
        if (ay > y_m) != (by > y_m) and x_m < ax + (y_m - ay) * (bx - ax) / (by - ay):
            inside = not inside
    return inside
