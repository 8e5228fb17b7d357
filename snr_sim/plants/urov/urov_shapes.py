"""Shapes of pool and vehicle, for the viewer alone; positions of thrusters and gates are those of the physics."""

from __future__ import annotations

import math
from typing import Any

from snr_sim.plants.shapes import box, mesh, polyline
from snr_sim.plants.urov.pool import POST_M, WALLS_RISE_M, Pool
from snr_sim.plants.urov.tether import Tether
from snr_sim.plants.urov.vehicle import Vehicle

TILE_M = 1.0  # lines on the floor
LINES_OVER_FLOOR_M = 0.005  # or the floor would hide them
TILES_RGB = [[150, 186, 196], [138, 174, 186]]
LINE_RGB = [92, 128, 142]
WATER_RGB = [120, 200, 232]
WALL_RGB = [178, 196, 202]
GATE_RGB = [[214, 64, 48], [232, 170, 40]]
FRAME_RGB = [38, 44, 52]
FLOAT_RGB = [40, 130, 210]
TUBE_RGB = [206, 212, 218]
DUCT_RGB = [24, 26, 30]
DUCT_M = 0.049  # radius and half length of a thruster's duct
LAMP_RGB = [250, 236, 160]


def pool_shapes(pool: Pool) -> dict[str, Any]:
    """Return floor, walls, the line of the surface and the gates, by name."""
    half_x, half_y = 0.5 * pool.length_m, 0.5 * pool.width_m
    bottom, top = -pool.depth_m, WALLS_RISE_M
    rim = [[half_x, half_y], [-half_x, half_y], [-half_x, -half_y], [half_x, -half_y], [half_x, half_y]]
    shapes: dict[str, Any] = {
        "floor": mesh([[x, y, bottom] for x, y in rim[:4]], [[0, 1, 2], [0, 2, 3]], TILES_RGB[0]),
        "surface": {**polyline([[x, y, 0.0] for x, y in rim], WATER_RGB, 0.03), "label": "water surface"},
        "rim": polyline([[x, y, top] for x, y in rim], WALL_RGB, 0.04),
    }
    for i, (x, y) in enumerate(rim[:4]):
        shapes[f"corner_{i}"] = polyline([[x, y, bottom], [x, y, top]], WALL_RGB, 0.04)
    z = bottom + LINES_OVER_FLOOR_M
    shapes["lines_north"] = polyline([[x, y, z] for x, y in _to_and_fro(half_x, half_y)], LINE_RGB, 0.008)
    shapes["lines_east"] = polyline([[x, y, z] for y, x in _to_and_fro(half_y, half_x)], LINE_RGB, 0.008)
    for i, gate in enumerate(pool.gates):
        corners = [list(corner) for corner in gate.corners_m()]
        frame = polyline([*corners, corners[0]], GATE_RGB[i % 2], POST_M)
        shapes[gate.name] = {**frame, "label": gate.name.replace("_", " ")}
    return shapes


def tether_shape(tether: Tether) -> dict[str, Any]:
    """Return the tether as the viewer wants it: where it is held, and where at which body it ends."""
    return {
        "anchor_m": list(tether.anchor_m),
        "body": "vehicle",
        "place_m": list(tether.attachment_m),
        "length_m": tether.length_m,
    }


def _to_and_fro(half: float, other: float) -> list[tuple[float, float]]:
    """Return one polyline of lines a tile apart, edge to edge: one line is drawn faster than 40."""
    count = math.floor(half / TILE_M)
    way = []
    for i in range(-count, count + 1):
        side = other if i % 2 else -other
        way += [(i * TILE_M, side), (i * TILE_M, -side)]
    return way


def vehicle_shapes(vehicle: Vehicle) -> list[dict[str, Any]]:
    """Return frame, floats, tube, lamps and the ducts of all thrusters."""
    length, width, height = (0.5 * side for side in vehicle.size_m)
    shapes = []
    for side in (1.0, -1.0):
        y = side * 0.62 * width
        shapes += [
            box([0.0, y, -0.6 * height], [length, 0.012, 0.045], FRAME_RGB),
            box([0.0, y, 0.35 * height], [length, 0.012, 0.02], FRAME_RGB),
            box([0.8 * length, y, -0.1 * height], [0.025, 0.012, 0.5 * height], FRAME_RGB),
            box([-0.8 * length, y, -0.1 * height], [0.025, 0.012, 0.5 * height], FRAME_RGB),
            box([0.3 * length, side * 0.5 * width, 0.7 * height], [0.55 * length, 0.32 * width, 0.035], FLOAT_RGB),
            box([-0.62 * length, side * 0.5 * width, 0.7 * height], [0.35 * length, 0.32 * width, 0.035], FLOAT_RGB),
            box([0.95 * length, side * 0.35 * width, -0.45 * height], [0.02, 0.022, 0.022], LAMP_RGB),
        ]
    shapes.append(_drum([0.0, 0.0, 0.1 * height], [1.0, 0.0, 0.0], 0.057, 0.17, TUBE_RGB))
    shapes.append(_drum([0.02, 0.0, -0.55 * height], [1.0, 0.0, 0.0], 0.045, 0.13, FRAME_RGB))
    shapes += [_drum(list(one.position_m), list(one.direction), DUCT_M, DUCT_M, DUCT_RGB) for one in vehicle.thrusters]
    return shapes


def _drum(center: list[float], axis: list[float], radius: float, half: float, rgb: list[int]) -> dict[str, Any]:
    """Return a closed cylinder of twelve sides along an axis."""
    ax, ay, az = axis
    side = [-ay, ax, 0.0] if abs(az) < 0.9 else [0.0, -az, ay]
    size = math.hypot(*side)
    sx, sy, sz = (value / size for value in side)
    tx, ty, tz = ay * sz - az * sy, az * sx - ax * sz, ax * sy - ay * sx
    n = 12
    vertices = []
    for end in (-half, half):
        for i in range(n):
            c, s = radius * math.cos(2.0 * math.pi * i / n), radius * math.sin(2.0 * math.pi * i / n)
            around = (c * sx + s * tx, c * sy + s * ty, c * sz + s * tz)
            vertices.append([round(m + end * a + b, 5) for m, a, b in zip(center, axis, around, strict=True)])
    triangles = []
    for i in range(n):
        j = (i + 1) % n
        triangles += [[i, j, n + i], [j, n + j, n + i]]
    for i in range(1, n - 1):
        triangles += [[0, i + 1, i], [n, n + i, n + i + 1]]
    return mesh(vertices, triangles, rgb)
