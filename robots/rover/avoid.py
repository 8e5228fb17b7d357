"""Which way is free, by a scan of the distances around.

    scan --> points around, x ahead and y to the left --> of all headings, the free one that is nearest to the goal's

A heading is free if no point is in the lane that the rover would sweep along it: a rectangle of its width and of the
way that it looks ahead. Of the vector field histogram (Borenstein and Koren, IEEE Transactions on Robotics and
Automation 7, 1991) it has the choice, and rectangles in the place of sectors, which are too narrow near by.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

BEHIND_M = 0.7  # of the rover's origin: its tail
NARROW_M, WIDE_M = 0.65, 0.9  # half of the lane: half of the rover, 0.45, and what is just enough, or better
LOOK_M = 3.0
TRIED_RAD = math.radians(4.0)
TRIED = tuple(i * TRIED_RAD for i in range(-30, 31))
SWAY = 0.4  # how much a radian off the last heading counts, of one off the goal
NARROW = 0.5  # how many radians a narrow lane is worse than a wide one

Point = tuple[float, float]


def points_of(ranges_m: Sequence[float], angles_rad: Sequence[float], reach_m: float) -> list[Point]:
    """Return the places that a scan has found, body frame [m]."""
    found = zip(ranges_m, angles_rad, strict=True)
    return [(r * math.cos(angle), r * math.sin(angle)) for r, angle in found if r < reach_m]


def is_free(points: Sequence[Point], heading_rad: float, half_m: float, look_m: float) -> bool:
    """Return whether no point is in the lane of a heading."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    return not any(-BEHIND_M < cos * x + sin * y < look_m and abs(cos * y - sin * x) < half_m for x, y in points)


def free_heading(points: Sequence[Point], goal_rad: float, goal_m: float, before_rad: float) -> float | None:
    """Return the heading to take, from where the rover looks now; None if there is none.

    Args:
        points: found by the scan.
        goal_rad, goal_m: bearing and distance of the goal.
        before_rad: heading that was taken last.
    """
    look_m = min(LOOK_M, goal_m)
    near = [point for point in points if math.hypot(*point) < look_m + WIDE_M + BEHIND_M]
    tried = [
        (cost + abs(heading - goal_rad) + SWAY * abs(heading - before_rad), heading, half_m)
        for half_m, cost in ((WIDE_M, 0.0), (NARROW_M, NARROW))
        for heading in (goal_rad, *TRIED)
    ]
    for _, heading, half_m in sorted(tried):
        if is_free(near, heading, half_m, look_m):
            return heading
    return None
