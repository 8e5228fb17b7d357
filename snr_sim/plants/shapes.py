"""Shapes for viewer and cameras, of the kinds that `prelude/plant.py` lists. Metres."""

from __future__ import annotations

from typing import Any


def box(center: list[float], half_size: list[float], rgb: list[int]) -> dict[str, Any]:
    """Return a box with its sides along the axes."""
    return {"kind": "box", "half_size_m": half_size, "center_m": center, "rgb": rgb}


def polyline(points: list[list[float]], rgb: list[int], radius_m: float) -> dict[str, Any]:
    """Return a line through points."""
    return {"kind": "polyline", "points_m": points, "rgb": rgb, "radius_m": radius_m}


def height_field(
    corner_m: list[float], spacing_m: list[float], rows_m: list[list[float]], rgb: list[int]
) -> dict[str, Any]:
    """Return ground with a height for each place: rows from south to north, in each from west to east."""
    heights = [height for row in rows_m for height in row]
    shape = [len(rows_m), len(rows_m[0])]
    where = {"corner_m": corner_m, "spacing_m": spacing_m, "shape": shape}
    return {"kind": "heightfield", **where, "heights_m": heights, "rgb": rgb}


def mesh(vertices: list[list[float]], triangles: list[list[int]], rgb: list[int]) -> dict[str, Any]:
    """Return a mesh of triangles, whose corners are numbers of vertices."""
    return {"kind": "mesh", "vertices_m": vertices, "triangles": triangles, "rgb": rgb}
