"""Draws bodies: their faces in the light, and what pushes them as a flame or a jet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from snr_sim.recording.columns import Floats
from snr_sim.recording.scene import points_of, rgb_of, turned
from snr_sim.view.picture_canvas import Canvas, Point, Rgb, mixed
from snr_sim.view.picture_layout import Place

FLAME: tuple[Rgb, Rgb] = ((255, 120, 30), (255, 225, 130))
JET: tuple[Rgb, Rgb] = ((120, 205, 240), (235, 250, 255))  # of a propeller: water, not fire
NO_PUSH = ("current", "tether")  # arrows that are no thrust
LIGHT = np.array([-0.45, -0.65, 0.62])  # towards the light: from the left, from the front and from above


def draw_shapes(canvas: Canvas, place: Place, shapes: Sequence[tuple[dict[str, Any], Any]]) -> None:
    """Draws the faces that look to the south, the farthest first."""
    parts: list[tuple[float, list[Point], Rgb, float]] = []
    for shape, pose in shapes:
        rgb = tuple(rgb_of(shape))
        if shape.get("kind") == "polyline":
            corners = turned(pose, shape["points_m"])
            width = max(0.6, 2.0 * shape.get("radius_m", 0.1) * place.scale)
            parts.append((float(corners[:, 1].mean()), [place.at(corner) for corner in corners], rgb, width))  # type: ignore
            continue
        for face in _faces(shape):
            corners = turned(pose, face)
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            length = np.linalg.norm(normal)
            if length > 0 and normal[1] < 0:
                light = 0.35 + 0.65 * max(0.0, float(normal @ LIGHT / length))
                shade = mixed((0, 0, 0), rgb, light)  # type: ignore[arg-type]
                parts.append((float(corners[:, 1].mean()), [place.at(corner) for corner in corners], shade, 0.0))
    for _, points, rgb_, width in sorted(parts, key=lambda part: -part[0]):
        if width:
            canvas.line(points, rgb_, width)
        else:
            canvas.polygon(points, rgb_)


def _faces(shape: dict[str, Any]) -> list[Floats]:
    """Returns the triangles of a mesh or the sides of a box, each shape (k, 3), counter-clockwise from outside."""
    if shape.get("kind") == "mesh":
        vertices = points_of(shape)
        return [vertices[list(triangle)] for triangle in shape["triangles"]]
    if shape.get("kind") == "box":
        corners = points_of(shape)  # as binary numbers: x, y, z
        sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
        return [corners[list(side)] for side in sides]
    return []


def strongest_of(arrows: Sequence[Mapping[str, Sequence[float]]]) -> float:
    """Returns the longest push [N] of all moments, as seen; 1 if nothing pushes."""
    pushes = [_length(arrow) for one in arrows for name, arrow in one.items() if name not in NO_PUSH]
    return max(pushes, default=0.0) or 1.0


def draw_flames(
    canvas: Canvas,
    place: Place,
    arrows: Mapping[str, Sequence[float]],
    points_per_newton: float,
    colors: tuple[Rgb, Rgb],
) -> list[Point]:
    """Draws what pushes at one moment; returns the tips of what is seen of it."""
    pushes = [arrow for name, arrow in arrows.items() if name not in NO_PUSH]
    tips = [_draw_flame(canvas, place, arrow, points_per_newton, colors) for arrow in pushes]
    return [tip for tip in tips if tip is not None]


def _draw_flame(
    canvas: Canvas, place: Place, arrow: Sequence[float], points_per_newton: float, colors: tuple[Rgb, Rgb]
) -> Point | None:
    """Draws a force as what makes it: a flame the other way, out of the point where it acts; returns its tip."""
    length = _length(arrow) * points_per_newton
    if length < 1.0:
        return None
    x, y = place.at(arrow[:3])
    along = np.array([-arrow[3], arrow[5]]) / _length(arrow)
    across = np.array([-along[1], along[0]])
    for color, long, wide in zip(colors, (1.0, 0.55), (0.13, 0.07), strict=True):
        half = wide * min(length, 40.0) + 1.0
        tip = along * length * long
        canvas.polygon(
            [
                (x + half * across[0], y + half * across[1]),
                (x + tip[0], y + tip[1]),
                (x - half * across[0], y - half * across[1]),
            ],
            color,
        )
    return x + float(along[0]) * length, y + float(along[1]) * length


def _length(arrow: Sequence[float]) -> float:
    """Returns how long an arrow is in the plane of the picture."""
    return float(np.hypot(arrow[3], arrow[5]))
