"""Shapes of a room or yard, of what drives in it, of people and stones, for the viewer. Metres; z up from the floor."""

from __future__ import annotations

import math
from typing import Any

from snr_sim.plants.ground.dozer import Dozer
from snr_sim.plants.ground.explorer import Explorer
from snr_sim.plants.ground.room import Point, Room
from snr_sim.plants.shapes import box, mesh

WALL_M = 0.3  # height of walls in the picture: low, so that the floor is seen
FURNITURE_M = 0.2
PERSON_M = 1.7
FLOOR_RGB = [206, 198, 182]
WALL_RGB = [150, 152, 158]
FURNITURE_RGB = [142, 104, 70]
BODY_RGB = [222, 222, 226]
WHEEL_RGB = [46, 46, 52]
BAR_RGB = [196, 52, 44]
SENSOR_RGB = [60, 92, 160]
PERSON_RGB = [92, 120, 176]
DOZER_RGB = [214, 170, 40]
TRACK_RGB = [52, 52, 56]
BLADE_RGB = [120, 124, 130]
PIT_RGB = [92, 84, 74]
SIDES = 16  # of a circle


def room_shapes(room: Room) -> dict[str, Any]:
    """Return floor, walls and furniture, by name."""
    (low_x, high_x), (low_y, high_y) = ((min(values), max(values)) for values in zip(*room.outline_m, strict=True))
    middle = [0.5 * (low_x + high_x), 0.5 * (low_y + high_y), -0.01]
    half = [0.5 * (high_x - low_x), 0.5 * (high_y - low_y), 0.005]
    shapes: dict[str, Any] = {
        "floor": box(middle, half, FLOOR_RGB),
        "wall": _fence(room.outline_m, WALL_M, WALL_RGB),
    }
    for i, outline in enumerate(room.furniture_m):
        shapes[f"furniture_{i}"] = _fence(outline, FURNITURE_M, FURNITURE_RGB)
    return shapes


def explorer_shapes(explorer: Explorer) -> list[dict[str, Any]]:
    """Return body, wheels, touch bars and ultrasonic sensor."""
    (length, width), height, radius = explorer.size_m, explorer.height_m, explorer.wheel_radius_m
    front, track = 0.5 * length, 0.5 * explorer.track_m
    bar = 0.5 * explorer.bar_m
    return [
        box([0.0, 0.0, 0.5 * height + radius], [front, 0.7 * track, 0.5 * height], BODY_RGB),
        *(box([explorer.axle_m, side * track, radius], [radius, 0.014, radius], WHEEL_RGB) for side in (1, -1)),
        box([explorer.caster_m, 0.0, 0.4 * radius], [0.4 * radius] * 3, WHEEL_RGB),
        *(box([front + bar, side * 0.25 * width, radius], [bar, 0.23 * width, 0.01], BAR_RGB) for side in (1, -1)),
        *(box([front, side * 0.02, height + radius], [0.01, 0.012, 0.012], SENSOR_RGB) for side in (1, -1)),
    ]


def person_shapes(radius_m: float) -> list[dict[str, Any]]:
    """Return a person as a column."""
    turns = [2.0 * math.pi * i / SIDES for i in range(SIDES)]
    return [_fence(tuple((radius_m * math.cos(a), radius_m * math.sin(a)) for a in turns), PERSON_M, PERSON_RGB)]


def dozer_shapes(dozer: Dozer) -> list[dict[str, Any]]:
    """Return body, cabin, tracks and blade."""
    (length, width), height = dozer.size_m, dozer.height_m
    front, half = 0.5 * length, 0.5 * dozer.track_length_m
    return [
        box([-0.05 * length, 0.0, 0.45 * height], [0.4 * length, 0.3 * width, 0.25 * height], DOZER_RGB),
        box([-0.15 * length, 0.0, 0.85 * height], [0.15 * length, 0.22 * width, 0.15 * height], WALL_RGB),
        *(
            box([0.0, side * 0.5 * dozer.track_m, 0.2 * height], [half, 0.12 * width, 0.2 * height], TRACK_RGB)
            for side in (1, -1)
        ),
        box([front - 0.01, 0.0, 0.3 * height], [0.01, 0.5 * width, 0.28 * height], BLADE_RGB),
    ]


def stone_shapes(radius_m: float, rgb: tuple[int, int, int]) -> list[dict[str, Any]]:
    """Return a stone as an octahedron."""
    vertices = [[sign * radius_m if i == axis else 0.0 for i in range(3)] for axis in range(3) for sign in (1.0, -1.0)]
    # Counter-clockwise from outside; an odd number marks a corner on the negative side.
    faces = [[i, j, k] if (i + j + k) % 2 == 0 else [i, k, j] for i in (0, 1) for j in (2, 3) for k in (4, 5)]
    return [mesh(vertices, faces, list(rgb))]


def pit_shapes(room: Room, edge_m: float) -> dict[str, Any]:
    """Return the floor of the pit, east of its edge: a dark plane, a little higher than the floor of the yard."""
    (low_x, high_x), (low_y, high_y) = ((min(values), max(values)) for values in zip(*room.outline_m, strict=True))
    west_m = max(low_x, edge_m)
    corners = [[west_m, low_y, -0.002], [high_x, low_y, -0.002], [high_x, high_y, -0.002], [west_m, high_y, -0.002]]
    return mesh(corners, [[0, 1, 2], [0, 2, 3]], PIT_RGB)


def _fence(outline: tuple[Point, ...], height_m: float, rgb: list[int]) -> dict[str, Any]:
    """Return upright faces along an outline."""
    vertices = [[x, y, z] for x, y in outline for z in (0.0, height_m)]
    triangles = []
    for i in range(0, len(vertices), 2):
        a, b, c, d = i, i + 1, (i + 2) % len(vertices), (i + 3) % len(vertices)
        triangles += [[a, c, b], [b, c, d]]
    return mesh(vertices, triangles, rgb)
