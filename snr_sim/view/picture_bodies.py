"""Bodies as parts of a picture: their shaded faces, and thrust as a flame or a jet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from snr_sim.recording.columns import Floats
from snr_sim.recording.scene import points_of, rgb_of, world_from_body
from snr_sim.view.picture_layout import SheetPosition
from snr_sim.view.picture_sheet import Part, Rgb, mixed

FLAME: tuple[Rgb, Rgb] = ((255, 120, 30), (255, 225, 130))
JET: tuple[Rgb, Rgb] = ((120, 205, 240), (235, 250, 255))  # of a propeller: water, not fire
NO_PUSH = ("current", "tether")  # arrows that do not show thrust
LIGHT: Floats = np.array([-0.45, -0.65, 0.62])  # towards the light: from the left, from the front and from above
# Corners of each side, numbered by their coordinates as binary digits x, y, z.
BOX_SIDES: list[list[int]] = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def body_parts(position: SheetPosition, shapes: Sequence[tuple[dict[str, Any], Any]]) -> list[Part]:
    """Return the south-facing faces of shapes with their poses, the farthest first."""
    parts: list[tuple[float, Part]] = []
    for shape, pose in shapes:
        rgb = rgb_of(shape)
        if shape.get("kind") == "polyline":
            corners = world_from_body(pose, points_of(shape))
            width = max(0.6, 2.0 * shape.get("radius_m", 0.1) * position.scale)
            parts.append((float(corners[:, 1].mean()), Part(position.at(corners), rgb, width)))
            continue
        faces = world_from_body(pose, faces_of(shape))
        normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        light = 0.35 + 0.65 * np.maximum(0.0, normals @ LIGHT / np.maximum(np.linalg.norm(normals, axis=1), 1e-12))
        depths, on_sheet = faces[:, :, 1].mean(axis=1), position.at(faces)
        parts.extend(
            (depths[i], Part(on_sheet[i], mixed((0, 0, 0), rgb, light[i]))) for i in np.flatnonzero(normals[:, 1] < 0)
        )
    return [part for _, part in sorted(parts, key=lambda one: -one[0])]


def faces_of(shape: dict[str, Any]) -> Floats:
    """Return the triangles of a mesh or the sides of a box, shape (k, n, 3), counter-clockwise from outside."""
    corners = {"box": BOX_SIDES, "mesh": shape.get("triangles")}.get(shape.get("kind", ""))
    return points_of(shape)[np.array(corners, int)] if corners else np.empty((0, 3, 3))


def strongest_of(vectors: Sequence[Mapping[str, Sequence[float]]]) -> float:
    """Return the longest drawn thrust [N] of all moments; 1 if there is none."""
    pushes = [np.hypot(arrow[3], arrow[5]) for one in vectors for name, arrow in one.items() if name not in NO_PUSH]
    return float(max(pushes, default=0.0)) or 1.0


def flame_parts(
    position: SheetPosition, vectors: Mapping[str, Sequence[float]], points_per_newton: float, colors: tuple[Rgb, Rgb]
) -> list[Part]:
    """Return each force of a moment as a flame in the opposite direction, starting at the point where it acts.

    A flame has two triangles, of which the middle corner is the tip.
    """
    parts = []
    for name, arrow in vectors.items():
        push = np.array([-arrow[3], arrow[5]]) * points_per_newton
        length = float(np.hypot(*push))
        if name in NO_PUSH or length < 1.0:
            continue
        start, along = position.at(np.array(arrow[:3])), push / length
        across = np.array([-along[1], along[0]])
        for rgb, long, wide in zip(colors, (1.0, 0.55), (0.13, 0.07), strict=True):
            half = (wide * min(length, 40.0) + 1.0) * across
            parts.append(Part(np.array([start + half, start + long * push, start - half]), rgb))
    return parts
