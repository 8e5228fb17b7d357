"""Where things come to lie on a picture's sheet: metres to points, which moments are drawn, and what is cut off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from snr_sim.recording.columns import Floats
from snr_sim.recording.scene import points_of
from snr_sim.view.picture_canvas import Point

Area: TypeAlias = tuple[float, float, float, float]  # left, top, right, bottom

WIDTH, HEIGHT = 900, 500
SCENE: Area = (46.0, 62.0, 596.0, 474.0)
PLOTS: Area = (640.0, 62.0, 884.0, 474.0)
STROBES_MAX = 9
BODY_SHARE = 0.14  # of the scene's height: a body is drawn so large, or it would be a dot on its way
GROUND_SHARE = 0.12  # so much of the scene lies below the lowest point of the way


class Camera:
    """Metres to points. `along` is x in metres, or time in seconds when the body only rises and falls.

    Args:
        along, heights: what must be seen.
        body_m: size of the body.
        is_time: whether `along` is time.
        area: of the sheet.
    """

    def __init__(self, along: Floats, heights: Floats, body_m: float, is_time: bool, area: Area = SCENE) -> None:
        self.area = area
        left, top, right, bottom = area
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

    def center(self, heights: Floats) -> None:
        """Puts the middle of some heights into the middle of the area."""
        half = 0.5 * (self.area[3] - self.area[1]) / self.z_scale
        self.low_z = float(heights.min() + heights.max()) / 2 - half

    def at(self, along: float, z: float) -> Point:
        """Returns where a place is on the sheet."""
        left, _, right, bottom = self.area
        return (left + right) / 2 + (along - self.middle) * self.scale, bottom - (z - self.low_z) * self.z_scale

    def along_range(self) -> tuple[float, float]:
        """Returns what the left and the right edge show."""
        half = (self.area[2] - self.area[0]) / 2 / self.scale
        return self.middle - half, self.middle + half

    def z_range(self) -> tuple[float, float]:
        """Returns the heights [m] that the lower and the upper edge show."""
        return self.low_z, self.low_z + (self.area[3] - self.area[1]) / self.z_scale

    def clipped(self, start: Point, end: Point) -> tuple[Point, Point] | None:
        """Returns the part of a segment on the sheet that lies within the area; None if none does.

        >>> camera = Camera(np.zeros(1), np.zeros(1), 1.0, False)
        >>> camera.clipped((0.0, 100.0), (1000.0, 100.0)) == ((SCENE[0], 100.0), (SCENE[2], 100.0))
        True
        >>> camera.clipped((0.0, 0.0), (1000.0, 0.0)) is None
        True
        """
        left, top, right, bottom = self.area
        (x, y), (dx, dy) = start, (end[0] - start[0], end[1] - start[1])
        enters, leaves = 0.0, 1.0
        for way, room_before, room_after in ((dx, left - x, right - x), (dy, top - y, bottom - y)):
            if way == 0.0:
                if room_before > 0.0 or room_after < 0.0:
                    return None
                continue
            first, last = sorted((room_before / way, room_after / way))
            enters, leaves = max(enters, first), min(leaves, last)
        if enters >= leaves:
            return None
        return (x + enters * dx, y + enters * dy), (x + leaves * dx, y + leaves * dy)


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


class Stage:
    """A body's way on the sheet, and the moments at which it is drawn.

    Args:
        camera: metres to points.
        along, feet: of each time: where it is along the way, and where its feet are, world frame.
        size_m: of the body.
        enlarged_most: how much larger than life it may be drawn.

    Attributes:
        way: on the sheet.
        enlarged: how much larger than life the body is drawn.
        size: of the body on the sheet.
        moments: indices of the times at which it is drawn.
        places: where, at each of them.
    """

    def __init__(self, camera: Camera, along: Floats, feet: Floats, size_m: float, enlarged_most: float) -> None:
        self.camera = camera
        self.way = [camera.at(a, z) for a, z in zip(along, feet[:, 2], strict=True)]
        _, top, _, bottom = camera.area
        self.enlarged = min(enlarged_most, max(1.0, BODY_SHARE * (bottom - top) / (size_m * camera.z_scale)))
        self.size = size_m * camera.z_scale * self.enlarged
        self.moments = moments_of(np.array(self.way), 1.25 * self.size)
        self.places = [Place(self.way[i], feet[i], camera.z_scale * self.enlarged) for i in self.moments]

    def thinned(self) -> list[Point]:
        """Returns the way with as many points as can be told apart."""
        return self.way[:: max(1, len(self.way) // 800)] + self.way[-1:]


def feet_and_size(bodies: dict[str, list[dict[str, Any]]]) -> tuple[float, float]:
    """Returns the lowest point [m] of all bodies in their frame, and their height or width, whichever is more."""
    points = np.concatenate([points_of(shape) for shapes in bodies.values() for shape in shapes])
    return float(points[:, 2].min()), float(max(np.ptp(points[:, 0]), np.ptp(points[:, 2])))


def moments_of(way: Floats, apart: float) -> list[int]:
    """Returns indices of moments, first and last among them, evenly along the way and at least `apart` points."""
    steps = np.hypot(*np.diff(way, axis=0).T)
    gone = np.concatenate(([0.0], np.cumsum(steps)))
    count = int(min(STROBES_MAX, max(2, gone[-1] // apart + 1)))
    return sorted({int(np.searchsorted(gone, share * gone[-1])) for share in np.linspace(0.0, 1.0, count)})


class Labels:
    """Finds a free place for each label: beside what it names, over no body and no other label.

    Args:
        bodies: middles of what must not be hidden.
        radius: of each of them.
        area: that labels stay within.
    """

    def __init__(self, bodies: Sequence[Point], radius: float, area: Area) -> None:
        self._taken: list[Area] = []
        self._area = area
        self.keep_free(bodies, radius)

    def keep_free(self, points: Sequence[Point], radius: float) -> None:
        """Takes more that must not be hidden."""
        self._taken += [(x - radius, y - radius, x + radius, y + radius) for x, y in points]

    def place(self, candidates: Sequence[Point], width: float, height: float) -> Point | None:
        """Returns the first candidate, the left middle of a label, that is free; None if none is."""
        left, top, right, bottom = self._area
        for x, y in candidates:
            box = (x, y - 0.5 * height, x + width, y + 0.5 * height)
            inside = left <= box[0] and box[2] <= right and top <= box[1] and box[3] <= bottom
            if inside and not any(_overlap(box, other) for other in self._taken):
                self._taken.append(box)
                return x, y
        return None


def _overlap(one: Area, other: Area) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
