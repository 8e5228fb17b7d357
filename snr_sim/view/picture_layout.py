"""Layout of a picture's sheet: conversion of metres to points, choice of moments, and placement of labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snr_sim.recording.columns import Floats
from snr_sim.recording.scene import points_of
from snr_sim.view.picture_sheet import FAINT, PALE, Area, Part, Point, Rgb, Sheet

WIDTH, HEIGHT = 900, 500
SCENE: Area = (46.0, 62.0, 596.0, 474.0)
PLOTS: Area = (640.0, 62.0, 884.0, 474.0)
PATH: Rgb = (110, 190, 250)
MAX_STROBES = 9
BODY_FRACTION = 0.14  # size of a body as a fraction of the scene's height, since at scale it would be a dot
FILLED = 0.94  # of an area by what is fitted into it
UNIT_ROOM = 24.0  # to the right of the last number of an axis, for its unit
GROUND_FRACTION = 0.12  # fraction of the scene below the lowest point of the path


class SheetProjection:
    """Conversion of metres to points of an area, in which ranges and a body of a size [m] must be visible.

    `along` is x in metres, or time in seconds if the body only rises and falls.
    """

    def __init__(self, along: Floats, heights: Floats, body_m: float, is_time: bool, area: Area = SCENE) -> None:
        self.area: Area = area
        self.unit: str = "s" if is_time else "m"
        left, top, right, bottom = area
        width, height = right - left, bottom - top
        margin = 1.3 * BODY_FRACTION
        spread_along = max(float(np.ptp(along)), 1e-9)
        spread_z = max(float(np.ptp(heights)), body_m / BODY_FRACTION * 0.5)
        self.z_scale: float = height * (1.0 - margin - GROUND_FRACTION) / spread_z
        if is_time:
            self.scale: float = width * (1.0 - 1.15 * margin) / spread_along
        else:
            self.z_scale = self.scale = min(self.z_scale, width * (1.0 - 1.6 * margin) / spread_along)
        room_m = 0.15 * margin * width / self.scale  # on the right, for the time next to the last body
        self.middle: float = float(along.min() + along.max()) / 2 + room_m
        self.low_z: float = float(heights.min()) - GROUND_FRACTION * height / self.z_scale

    def center(self, heights: Floats) -> None:
        """Centre the middle of some heights in the area."""
        half = 0.5 * (self.area[3] - self.area[1]) / self.z_scale
        self.low_z = float(heights.min() + heights.max()) / 2 - half

    def fit(self, along: Floats, heights: Floats) -> None:
        """Show ranges as large as the area allows, at one scale."""
        left, top, right, bottom = self.area
        self.scale = self.z_scale = FILLED * min((right - left) / np.ptp(along), (bottom - top) / np.ptp(heights))
        self.middle = float(along.min() + along.max()) / 2
        self.center(heights)

    def at(self, along: ArrayLike, z: ArrayLike) -> Floats:
        """Return positions on the sheet, shape (..., 2)."""
        left, _, right, bottom = self.area
        x = (left + right) / 2 + (np.asarray(along) - self.middle) * self.scale
        return np.stack(np.broadcast_arrays(x, bottom - (np.asarray(z) - self.low_z) * self.z_scale), axis=-1)

    def along_range(self) -> tuple[float, float]:
        """Return the values at the left and the right edge."""
        half = (self.area[2] - self.area[0]) / 2 / self.scale
        return self.middle - half, self.middle + half

    def columns(self) -> Floats:
        """Return the value at each half point from left to right, and slightly beyond both edges."""
        low, high = self.along_range()
        beyond = 2.0 / self.scale
        return np.linspace(low - beyond, high + beyond, 5 + 2 * round(self.area[2] - self.area[0]))

    def z_range(self) -> tuple[float, float]:
        """Return the heights [m] at the lower and the upper edge."""
        return self.low_z, self.low_z + (self.area[3] - self.area[1]) / self.z_scale

    def draw(self, sheet: Sheet, parts: Sequence[Part], background: Rgb) -> None:
        """Draw parts, clipped to the area, and the scales at its edges."""
        left, top, right, bottom = self.area
        axes = sheet.axes(self.area, self.along_range(), self.z_range(), background)
        sheet.paint(parts, axes)
        sheet.scale(axes.xaxis, 9, 4.0 / self.scale, UNIT_ROOM / self.scale, FAINT)
        sheet.scale(axes.yaxis, max(3, round((bottom - top) / 65.0)), 2.0 / self.z_scale, 9.0 / self.z_scale, FAINT)
        sheet.text((left - 7, top - 2), "m", 9.0, PALE, "rm")
        sheet.text((right - 2, bottom + 7), self.unit, 9.0, PALE, "rt")


@dataclass(frozen=True)
class SheetPosition:
    """Position of a drawn body: its feet are at a point of the sheet, and it may be enlarged."""

    feet_on_sheet: Floats
    feet_m: Floats
    scale: float

    def at(self, points: Floats) -> Floats:
        """Return the sheet positions of the body's points [m], world frame: shape (..., 3) to (..., 2)."""
        from_feet = points - self.feet_m
        return self.feet_on_sheet + self.scale * np.stack([from_feet[..., 0], -from_feet[..., 2]], axis=-1)


class TrackView:
    """A body's path on the sheet, and the moments at which it is drawn.

    Args:
        along, feet: for each time: its position along the path, and that of its feet, world frame.

    Attributes:
        path: on the sheet, shape (n, 2).
        enlargement, size: of the body on the sheet.
        strobes: index of each time at which it is drawn, and its position then.
    """

    def __init__(
        self, projection: SheetProjection, along: Floats, feet: Floats, size_m: float, max_enlargement: float
    ) -> None:
        self.path: Floats = projection.at(along, feet[:, 2])
        _, top, _, bottom = projection.area
        enlargement = BODY_FRACTION * (bottom - top) / (size_m * projection.z_scale)
        self.enlargement: float = min(max_enlargement, max(1.0, enlargement))
        self.size: float = size_m * projection.z_scale * self.enlargement
        scale = projection.z_scale * self.enlargement
        indices = find_strobe_indices(self.path, 1.25 * self.size)
        self.strobes: list[tuple[int, SheetPosition]] = [
            (i, SheetPosition(self.path[i], feet[i], scale)) for i in indices
        ]


def feet_and_size(bodies: dict[str, list[dict[str, Any]]]) -> tuple[float, float]:
    """Return the lowest point [m] of all bodies in their frame, and the larger of their height and width."""
    points = np.concatenate([points_of(shape) for shapes in bodies.values() for shape in shapes])
    return float(points[:, 2].min()), float(max(np.ptp(points[:, 0]), np.ptp(points[:, 2])))


def find_strobe_indices(path: Floats, min_distance: float) -> list[int]:
    """Return indices of moments, including first and last, evenly along the path."""
    steps = np.hypot(*np.diff(path, axis=0).T)
    gone = np.concatenate(([0.0], np.cumsum(steps)))
    count = int(min(MAX_STROBES, max(2, gone[-1] // min_distance + 1)))
    return sorted({int(np.searchsorted(gone, fraction * gone[-1])) for fraction in np.linspace(0.0, 1.0, count)})


class Labels:
    """Placement of labels in an area: each next to the object that it names, not over bodies or other labels."""

    def __init__(self, bodies: ArrayLike, radius: float, area: Area) -> None:
        self._taken: list[Area] = []
        self._area = area
        self.keep_free(bodies, radius)

    def keep_free(self, points: ArrayLike, radius: float) -> None:
        """Add points that labels must not hide."""
        places = np.asarray(points, float).reshape(-1, 2).tolist()
        self._taken += [(x - radius, y - radius, x + radius, y + radius) for x, y in places]

    def find_free(self, candidates: Sequence[Point], width: float, height: float) -> Point | None:
        """Return the first free candidate, the left middle of a label; None if there is none."""
        left, top, right, bottom = self._area
        for x, y in candidates:
            box = (x, y - 0.5 * height, x + width, y + 0.5 * height)
            inside = left <= box[0] and box[2] <= right and top <= box[1] and box[3] <= bottom
            if inside and not any(_overlap(box, other) for other in self._taken):
                self._taken.append(box)
                return x, y
        return None

    def write(
        self, sheet: Sheet, words: str, size: float, rgb: Rgb, candidates: Sequence[tuple[float, float, float]]
    ) -> None:
        """Write a label at the first free candidate: x, y, and the fraction of its width to the left of x, 0 to 1."""
        width = sheet.text_width(words, size)
        place = self.find_free([(x - part * width, y) for x, y, part in candidates], width, 11.0)
        if place is not None:
            sheet.text(place, words, size, rgb, "lm")


def spread(points: Floats) -> Floats:
    """Return points along a line, so close together that no label fits in between."""
    return np.concatenate([np.linspace(a, b, 2 + int(np.hypot(*(b - a)) / 6.0)) for a, b in pairwise(points)])


def _overlap(one: Area, other: Area) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
