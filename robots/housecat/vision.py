"""What Housecat finds in images: where stones are in the plane of the image, and how far away."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

MIN_RED = 40  # darker pixels have no color to speak of
MIN_PIXELS = 2  # of a stone
MATCH_PX = 5  # columns and rows of a block
MAX_DISPARITY_PX = 30


def stone_pixels(rgb: Any) -> Any:
    """Return which pixels show a stone, shape (height, width): brown, more so than the posts."""
    red, blue = rgb[..., 0].astype(np.int16), rgb[..., 2].astype(np.int16)
    return (9 * red > 20 * blue) & (red > MIN_RED)


def column_bearing_rad(column: float, width: int, field_of_view_rad: float) -> float:
    """Return the angle of an image column, positive to the left.

    >>> column_bearing_rad(47.5, 96, 1.0) == 0.0, column_bearing_rad(0.0, 96, 1.0) > 0.0
    (True, True)
    """
    pixel = 2.0 * math.tan(0.5 * field_of_view_rad) / width
    return -math.atan((column - 0.5 * (width - 1)) * pixel)


def nearest_bearing_rad(rgb: Any, field_of_view_rad: float) -> float | None:
    """Return the bearing of the nearest stones in an image, or None if it shows none.

    On a level floor what is lower in the image is nearer. So the nearest are those in the lowest rows; of these it is
    the median.
    """
    mask = stone_pixels(rgb)
    rows, columns = np.nonzero(mask)
    if len(rows) < MIN_PIXELS:
        return None
    near = np.sort(columns[rows >= int(rows.max()) - 1])
    return column_bearing_rad(float(near[len(near) // 2]), rgb.shape[1], field_of_view_rad)


def stereo_distances(left: Any, right: Any, baseline_m: float, field_of_view_rad: float) -> list[tuple[float, float]]:
    """Return bearing and distance along the floor of the stones in each column that shows some.

    Block matching: a block of the left image is moved over the right one until both differ least. What is found at a
    disparity of d pixels is baseline / (d * pixel) away along the axis. Parts of a pixel: a parabola through the
    smallest difference and its neighbours.
    """
    height, width = left.shape[:2]
    mask = stone_pixels(left)
    if not mask.any():
        return []
    costs = np.full((MAX_DISPARITY_PX + 1, height, width), 1 << 20, dtype=np.int32)
    a, b = left.astype(np.int32), right.astype(np.int32)
    for d in range(MAX_DISPARITY_PX + 1):
        differences = np.abs(a[:, d:] - b[:, : width - d])
        one = differences[..., 0] + differences[..., 1] + differences[..., 2]
        costs[d, :, d:] = _box_filtered(one, MATCH_PX)
    best = costs.argmin(axis=0)
    pixel = 2.0 * math.tan(0.5 * field_of_view_rad) / width
    found = []
    for column in range(width):
        rows = np.nonzero(mask[:, column])[0]
        disparities = sorted(_refined(costs[:, row, column], int(best[row, column])) for row in rows)
        disparities = [one for one in disparities if one > 0.5]
        if disparities:
            bearing = column_bearing_rad(column, width, field_of_view_rad)
            ahead = baseline_m / (disparities[len(disparities) // 2] * pixel)
            found.append((bearing, ahead / math.cos(bearing)))
    return found


def _box_filtered(values: Any, size: int) -> Any:
    """Return the mean over squares, times their area: integers, so exact in any order."""
    height, width = values.shape
    reach = size // 2
    rows = values.take(np.arange(-reach, height + reach), axis=0, mode="clip")  # beyond an edge as at the edge
    rows = sum(rows[i : i + height] for i in range(size))  # exact: integers
    columns = rows.take(np.arange(-reach, width + reach), axis=1, mode="clip")
    return sum(columns[:, i : i + width] for i in range(size))  # exact: integers


def _refined(costs: Any, best: int) -> float:
    """Return the disparity of least cost, to parts of a pixel."""
    if not 0 < best < len(costs) - 1:
        return float(best)
    before, at, after = int(costs[best - 1]), int(costs[best]), int(costs[best + 1])
    bend = before - 2 * at + after
    return best + (0.5 * (before - after) / bend if 0 < bend < 1 << 18 else 0.0)


def distance_at(bearing_rad: float, found: list[tuple[float, float]], within_rad: float = 0.1) -> float | None:
    """Return the distance that was found next to a bearing, or None if there is none near it."""
    near = [(abs(one - bearing_rad), distance) for one, distance in found if abs(one - bearing_rad) <= within_rad]
    return min(near)[1] if near else None
