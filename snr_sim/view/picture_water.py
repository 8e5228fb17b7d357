"""Draws what a vehicle swims in: the water and its edges, gates and marks, the tether, and where the water goes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from snr_sim.recording.scene import BOW, is_slack, points_of, rgb_of, turned
from snr_sim.view.picture_canvas import Canvas, Point, Rgb, mixed
from snr_sim.view.picture_layout import Camera, Place

WATER: Rgb = (12, 52, 84)
AIR: Rgb = (9, 12, 24)
DECK: Rgb = (50, 54, 62)  # what a pool is built of
SURFACE: Rgb = (120, 200, 232)
CURRENT: Rgb = (150, 235, 190)
NEWTONS_PER_MPS = 40.0  # the arrow "current" of a plant is so long for 1 m/s
CURRENT_POINTS = 140.0  # for each m/s, and never more than what fits into a corner
CURRENT_POINTS_MOST = 50.0
THIN_M = 0.01  # lines thinner than this are marks on the floor
SLACK: Rgb = (236, 214, 110)
TAUT: Rgb = (255, 70, 60)
HARD_PULL_N = 20.0  # at which a tether has the colour of a taut one: half of what a vehicle of this size can push


def draw_water(canvas: Canvas, camera: Camera, statics: Mapping[str, Any], is_above: bool) -> None:
    """Fills the scene with water: on a map as far as the pool goes, from the south up to its surface."""
    left, top, right, bottom = camera.area
    edge = points_of(statics["surface"])
    (west, _, south), (east, _, north) = edge.min(axis=0), edge.max(axis=0)
    x0, x1 = (min(max(camera.at(x, 0.0)[0], left), right) for x in (west, east))
    y0, y1 = (min(max(camera.at(0.0, z)[1], top), bottom) for z in (north, south))
    if not is_above:
        y1 = bottom
    canvas.rectangle(left, top, right, bottom, fill=DECK)
    if x0 < x1:
        canvas.rectangle(x0, top, x1, bottom, fill=DECK if is_above else AIR)
        if y0 < y1:
            canvas.rectangle(x0, y0, x1, y1, fill=WATER)
        if not is_above and top < y0 < bottom:
            canvas.line([(x0, y0), (x1, y0)], SURFACE, 1.6)


def draw_marks(canvas: Canvas, camera: Camera, statics: Mapping[str, Any], is_above: bool) -> None:
    """Draws faintly the lines on the floor, under all else; from the south they are seen from their edge."""
    if is_above:
        for shape in statics.values():
            if shape.get("kind") == "polyline" and shape.get("radius_m", 0.1) < THIN_M:
                _draw_line(canvas, camera, shape, mixed(WATER, _rgb(shape), 0.25), 0.8)


def draw_gates(canvas: Canvas, camera: Camera, statics: Mapping[str, Any], is_above: bool) -> None:
    """Draws lines that stand in the water, over what has gone through; and on a map also the level ones around it.

    From the south a level line such as the pool's edge would look like another surface.
    """
    for shape in statics.values():
        is_line = shape.get("kind") == "polyline" and shape.get("radius_m", 0.1) >= THIN_M
        if is_line and (is_above or np.ptp(points_of(shape)[:, 2]) > 0.0):
            _draw_line(canvas, camera, shape, _rgb(shape), 2.2)


def _draw_line(canvas: Canvas, camera: Camera, shape: dict[str, Any], color: Rgb, width: float) -> None:
    points = [camera.at(at[0], at[2]) for at in points_of(shape)]
    for start, end in pairwise(points):
        part = camera.clipped(start, end)
        if part is not None:
            canvas.line(list(part), color, width)


def _rgb(shape: dict[str, Any]) -> Rgb:
    red, green, blue = rgb_of(shape)
    return red, green, blue


def draw_tether(
    canvas: Canvas, camera: Camera, place: Place, tether: Mapping[str, Any], pose: Any, pull_n: float, share: float
) -> list[Point]:
    """Draws a tether from where it is held to its body: straight if taut, with a bow if slack.

    Args:
        canvas: to draw on.
        camera: of the scene.
        place: of the body.
        tether: as the scene describes it.
        pose: of the body.
        pull_n: what it pulls at the body; the harder, the redder.
        share: how much of it is seen: 1 all, 0 nothing.

    Returns:
        Points along what is seen of it, on the sheet; where it ends at least.
    """
    end_m = turned(pose, tether["place_m"])
    start, end = camera.at(tether["anchor_m"][0], tether["anchor_m"][2]), place.at(end_m)
    (dx, dy), bow = (end[0] - start[0], end[1] - start[1]), BOW if is_slack(tether, pose) else 0.0
    side = bow if dx <= 0.0 else -bow  # hangs to the lower side
    color = mixed(WATER, mixed(SLACK, TAUT, min(1.0, pull_n / HARD_PULL_N)), share)
    points = []
    for i in range(25):
        along, out = i / 24.0, 4.0 * side * (i / 24.0) * (1.0 - i / 24.0)
        points.append((start[0] + along * dx - out * -dy, start[1] + along * dy - out * dx))
    seen = [part for ends in pairwise(points) if (part := camera.clipped(*ends)) is not None]
    for part in seen:
        canvas.line(list(part), color, 1.6)
    return [start for start, _ in seen] or [end]


def draw_current(canvas: Canvas, camera: Camera, arrow: Sequence[float] | None) -> None:
    """Draws where the water goes and how fast, in a corner of the scene."""
    if arrow is None:
        return
    _, _, right, bottom = camera.area
    east, up = arrow[3] / NEWTONS_PER_MPS, arrow[5] / NEWTONS_PER_MPS
    speed = math.hypot(east, up)
    if speed < 0.005:
        return
    length = min(CURRENT_POINTS_MOST, CURRENT_POINTS * speed)
    x, y, ux, uy = right - 60.0, bottom - 28.0, east / speed, -up / speed
    tip = (x + 0.5 * length * ux, y + 0.5 * length * uy)
    canvas.line([(x - 0.5 * length * ux, y - 0.5 * length * uy), tip], CURRENT, 2.0)
    back = [(tip[0] - 7.0 * ux + side * 4.0 * uy, tip[1] - 7.0 * uy - side * 4.0 * ux) for side in (1.0, -1.0)]
    canvas.polygon([tip, *back], CURRENT)
    canvas.text((x, bottom - 56.0), f"current {speed:.2f} m/s", 10.0, CURRENT, "ma")
