"""Geometry of a run: the shapes of the scene, their sizes, and the paths of bodies.

This module does not draw. The viewer and the picture both use its numbers, so that they show the same scene.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Points: TypeAlias = NDArray[np.float64]

# A path is drawn with at most this many points. More are not distinguishable on a screen, and a run may last for days.
MAX_PATH_POINTS = 2_000
SLACK, TAUT = (236, 214, 110), (255, 70, 60)  # colours of a tether
HARD_PULL_N = 20.0  # at which it has the colour of a taut one: half the thrust of a vehicle of its size
BOW = 0.10  # sag of a slack tether in drawings, as a fraction of its span
# A bow of unit length, along x, that goes out along z.
TETHER_LINE: Points = np.array([[i / 16.0, 0.0, 4.0 * (i / 16.0) * (1.0 - i / 16.0)] for i in range(17)])


class Path:
    """Path of one body, decimated as it grows, so that a long run needs no more memory than a short one.

    >>> path = Path(points_max=4)
    >>> path.extend(np.arange(30.0).reshape(10, 3))
    >>> path.points()[:, 0].tolist()
    [0.0, 12.0, 24.0, 27.0]
    """

    def __init__(self, points_max: int = MAX_PATH_POINTS) -> None:
        self._points_max = points_max
        self._stride = 1
        self._seen = 0
        self._kept: list[Points] = []
        self._last: Points = np.empty((0, 3))

    def extend(self, positions: Points) -> None:
        """Add positions [m], shape (n, 3)."""
        first = -self._seen % self._stride
        self._kept.append(positions[first :: self._stride])
        self._seen += len(positions)
        self._last = positions[-1:] if len(positions) else self._last
        while sum(map(len, self._kept)) > self._points_max:
            self._kept = [np.concatenate(self._kept)[::2]]
            self._stride *= 2

    def points(self) -> Points:
        """Return the path, shape (n, 3), from the first position to the last."""
        path = np.concatenate([np.empty((0, 3)), *self._kept])
        ends_there = len(path) and np.array_equal(path[-1], self._last[0])
        return path if ends_there else np.concatenate([path, self._last])[-self._points_max :]


def points_of(shape: dict[str, Any]) -> Points:
    """Return points [m] that bound the whole shape, shape (n, 3), in the shape's own frame."""
    shape = as_mesh(shape)
    kind = shape.get("kind")
    if kind == "box":
        half, center = np.array(shape["half_size_m"], float), np.array(shape["center_m"], float)
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
        around: Points = center + corners * half
        return around
    points = shape.get("points_m" if kind == "polyline" else "vertices_m", [])
    return np.array(points, np.float64).reshape(-1, 3)


def as_mesh(shape: dict[str, Any]) -> dict[str, Any]:
    """Return a height field as a mesh, two triangles for each of its squares; any other shape as it is."""
    if shape.get("kind") != "heightfield":
        return shape
    (rows, columns), (west, south), (wide, high) = shape["shape"], shape["corner_m"], shape["spacing_m"]
    x, y = np.meshgrid(west + wide * np.arange(columns), south + high * np.arange(rows))
    vertices = np.stack([x.ravel(), y.ravel(), np.array(shape["heights_m"], float)], axis=1)
    first = (columns * np.arange(rows - 1)[:, None] + np.arange(columns - 1)).ravel()
    up = first + columns
    triangles = np.stack([first, first + 1, up, first + 1, up + 1, up], axis=1).reshape(-1, 3)
    return {"kind": "mesh", "vertices_m": vertices, "triangles": triangles.tolist(), "rgb": rgb_of(shape)}


def size_of(shapes: Iterable[dict[str, Any]]) -> float:
    """Return the longest edge [m] of the box around some shapes; 1 if there are none."""
    points = [points_of(shape) for shape in shapes]
    if not sum(map(len, points)):
        return 1.0
    return float(np.ptp(np.concatenate(points), axis=0).max()) or 1.0


def rgb_of(shape: dict[str, Any]) -> tuple[int, int, int]:
    """Return the shape's colour; grey if it has none."""
    red, green, blue = shape.get("rgb", (170, 170, 170))
    return int(red), int(green), int(blue)


def world_from_body(pose: Any, points: Any) -> Points:
    """Return points of a body's frame in the world's.

    Args:
        pose: x, y, z [m] and the quaternion x, y, z, w; shape (7,), or (n, 7) for one point at n moments.
        points: shape (..., 3).
    """
    pose, points = np.asarray(pose, float), np.asarray(points, float)
    vector, w = pose[..., 3:6], pose[..., 6:]
    twice = 2.0 * np.cross(vector, points)
    moved: Points = points + w * twice + np.cross(vector, twice) + pose[..., :3]
    return moved


def tether_spans(tether: Mapping[str, Any], poses: Any) -> Points:
    """Return the vector [m] from a tether's anchor to its end at the body, for one pose or for many."""
    spans: Points = world_from_body(poses, tether["place_m"]) - np.asarray(tether["anchor_m"], float)
    return spans


def is_slack(tether: Mapping[str, Any], poses: Any) -> Any:
    """Return whether a tether is longer than its span, for one pose or for many."""
    return np.linalg.norm(tether_spans(tether, poses), axis=-1) < tether["length_m"]


def tether_frames(tether: Mapping[str, Any], poses: Points) -> Points:
    """Return the matrices that map `TETHER_LINE` to a tether: straight if it is taut, with a sag if it is slack.

    The sag only indicates slack: the plant's tether is straight.

    Args:
        tether: as a scene describes it.
        poses: of its body, shape (n, 7); there is one matrix for each, of shape (n, 3, 3).
    """
    spans = tether_spans(tether, poses)
    lengths = np.linalg.norm(spans, axis=1, keepdims=True)
    ways = np.divide(spans, lengths, out=np.zeros_like(spans), where=lengths > 0)
    aside = np.array([0.0, 0.0, -1.0]) + ways[:, 2:] * ways  # as much down as is possible across it
    wide = np.linalg.norm(aside, axis=1, keepdims=True)
    aside = np.where(wide > 0.1, aside / np.maximum(wide, 1e-9), [[1.0, 0.0, 0.0]])
    bows = np.where(is_slack(tether, poses)[:, None], BOW, 1e-3) * np.maximum(lengths, 1e-6) * aside
    return np.stack([spans, np.cross(ways, aside) + 1e-9, bows], axis=-1)


def meshes_with_normals(meshes: Sequence[dict[str, Any]]) -> tuple[Points, Points]:
    """Return three separate vertices for each of k triangles of meshes, and unit normals, so that edges are sharp.

    Both have the shape (3 k, 3), mesh by mesh.
    """
    vertices = [points_of(mesh) for mesh in meshes]
    begins = np.cumsum([0, *map(len, vertices[:-1])])
    triangles = [np.array(mesh["triangles"], int) + begin for mesh, begin in zip(meshes, begins, strict=True)]
    corners = np.concatenate(vertices)[np.concatenate(triangles)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    return corners.reshape(-1, 3), np.repeat(normals, 3, axis=0)
