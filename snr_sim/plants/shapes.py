"""Shapes for viewer and cameras, of the kinds that `prelude/plant.py` lists. Metres."""

from __future__ import annotations

from typing import Any


def box(center: list[float], half_size: list[float], rgb: list[int]) -> dict[str, Any]:
    """Return a box with its sides along the axes."""
    return {"kind": "box", "half_size_m": half_size, "center_m": center, "rgb": rgb}


def polyline(points: list[list[float]], rgb: list[int], radius_m: float) -> dict[str, Any]:
    """Return a line through points."""
    return {"kind": "polyline", "points_m": points, "rgb": rgb, "radius_m": radius_m}


def mesh(vertices: list[list[float]], triangles: list[list[int]], rgb: list[int]) -> dict[str, Any]:
    """Return a mesh of triangles, whose corners are numbers of vertices."""
    return {"kind": "mesh", "vertices_m": vertices, "triangles": triangles, "rgb": rgb}
