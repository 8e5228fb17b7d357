"""Where things come to lie on a picture's sheet: metres to points, which moments are drawn, and what is cut off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from snr_sim.recording.picture_canvas import Point
from snr_sim.recording.picture_flight import Rows
from snr_sim.recording.view_columns import Floats
from snr_sim.recording.view_scene import points_of

WIDTH, HEIGHT = 900, 500
SCENE = (46.0, 62.0, 596.0, 474.0)  # left, top, right, bottom
PLOTS = (640.0, 62.0, 884.0, 474.0)
STROBES_MAX = 9
BODY_SHARE = 0.14  # of the scene's height: a body is drawn so large, or it would be a dot on its way
GROUND_SHARE = 0.12  # so much of the scene lies below the lowest point of the way


class Camera:
    """Metres to points. `along` is x in metres, or time in seconds when the body only rises and falls."""

    def __init__(self, along: Floats, heights: Floats, body_m: float, is_time: bool) -> None:
        left, top, right, bottom = SCENE
        width, height = right - left, bottom - top
        margin = 1.3 * BODY_SHARE
        spread_z = max(float(np.ptp(heights)), body_m / BODY_SHARE * 0.5)
        self.z_scale = height * (1.0 - margin - GROUND_SHARE) / spread_z
        if is_time:
            self.scale = width * (1.0 - 1.15 * margin) / max(float(np.ptp(along)), 1e-9)
        else:
            self.z_scale = self.scale = min(
                self.z_scale, width * (1.0 - 1.6 * margin) / max(float(np.ptp(along)), 1e-9)
            )
        room_m = 0.15 * margin * width / self.scale  # on the right, for the time beside the last body
        self.middle = float(along.min() + along.max()) / 2 + room_m
        self.low_z = float(heights.min()) - GROUND_SHARE * height / self.z_scale

    def at(self, along: float, z: float) -> Point:
        """Returns where a place is on the sheet."""
        left, _, right, bottom = SCENE
        return (left + right) / 2 + (along - self.middle) * self.scale, bottom - (z - self.low_z) * self.z_scale

    def along_range(self) -> tuple[float, float]:
        """Returns what the left and the right edge show."""
        half = (SCENE[2] - SCENE[0]) / 2 / self.scale
        return self.middle - half, self.middle + half

    def z_range(self) -> tuple[float, float]:
        """Returns the heights [m] that the lower and the upper edge show."""
        return self.low_z, self.low_z + (SCENE[3] - SCENE[1]) / self.z_scale


@dataclass(frozen=True)
class Place:
    """Where a body is drawn: its feet stand at a point of the sheet, and it may be larger than life."""

    feet_on_sheet: Point
    feet_m: Any
    scale: float

    def at(self, point: Any) -> Point:
        """Returns where a point [m] of the body, world frame, is on the sheet."""
        x, y = self.feet_on_sheet
        return x + (point[0] - self.feet_m[0]) * self.scale, y - (point[2] - self.feet_m[2]) * self.scale


def feet_and_size(bodies: dict[str, list[dict[str, Any]]]) -> tuple[float, float]:
    """Returns the lowest point [m] of all bodies in their frame, and their height or width, whichever is more."""
    points = np.concatenate([points_of(shape) for shapes in bodies.values() for shape in shapes])
    return float(points[:, 2].min()), float(max(np.ptp(points[:, 0]), np.ptp(points[:, 2])))


def moments_of(way: Rows, apart: float) -> list[int]:
    """Returns indices of moments, first and last among them, evenly along the way and at least `apart` points."""
    steps = np.hypot(*np.diff(way, axis=0).T)
    gone = np.concatenate(([0.0], np.cumsum(steps)))
    count = int(min(STROBES_MAX, max(2, gone[-1] // apart + 1)))
    return sorted({int(np.searchsorted(gone, share * gone[-1])) for share in np.linspace(0.0, 1.0, count)})


def clipped(start: Point, end: Point) -> tuple[Point, Point] | None:
    """Returns the part of a segment that lies within the scene; None if none does.

    >>> clipped((0.0, 100.0), (1000.0, 100.0)) == ((SCENE[0], 100.0), (SCENE[2], 100.0))
    True
    >>> clipped((0.0, 0.0), (1000.0, 0.0)) is None
    True
    """
    (x, y), (dx, dy) = start, (end[0] - start[0], end[1] - start[1])
    enters, leaves = 0.0, 1.0
    for way, room_before, room_after in (
        (dx, SCENE[0] - x, SCENE[2] - x),
        (dy, SCENE[1] - y, SCENE[3] - y),
    ):
        if way == 0.0:
            if room_before > 0.0 or room_after < 0.0:
                return None
            continue
        first, last = sorted((room_before / way, room_after / way))
        enters, leaves = max(enters, first), min(leaves, last)
    if enters >= leaves:
        return None
    return (x + enters * dx, y + enters * dy), (x + leaves * dx, y + leaves * dy)
