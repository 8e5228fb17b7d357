"""Draws the world: the ground, the water with what stands in it and where it goes, and the scales beside it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from snr_sim.recording.picture_canvas import Canvas, Point, Rgb, mixed
from snr_sim.recording.picture_layout import HEIGHT, SCENE, Camera, clipped
from snr_sim.recording.picture_plots import BACKGROUND, FAINT, PALE, ticks
from snr_sim.recording.records import Header
from snr_sim.recording.view_scene import points_of, rgb_of

FAR_M = 1e6
SKY: Rgb = (9, 12, 24)
WATER: Rgb = (12, 52, 84)
SURFACE: Rgb = (120, 200, 232)
CURRENT: Rgb = (150, 235, 190)
CURRENT_POINTS_PER_NEWTON = 3.5  # the arrow "current" of a plant is 40 N for 1 m/s
THIN_M = 0.01  # lines thinner than this are marks on the floor


def draw_water(canvas: Canvas, camera: Camera, is_above: bool) -> None:
    """Fills the scene with water, seen from the south up to its surface."""
    left, top, right, bottom = SCENE
    level = top if is_above else max(top, camera.at(0.0, 0.0)[1])
    if level < bottom:
        canvas.rectangle(left, level, right, bottom, fill=WATER)
    if top < level < bottom:
        canvas.line([(left, level), (right, level)], SURFACE, 1.6)


def lines_of(header: Header, is_above: bool) -> dict[str, Any]:
    """Returns what of the world is made of lines; from the side the surface is drawn with the water."""
    return {
        name: shape
        for name, shape in header.scene.get("statics", {}).items()
        if shape.get("kind") == "polyline" and (is_above or name != "surface")
    }


def draw_lines(canvas: Canvas, camera: Camera, shapes: Iterable[dict[str, Any]]) -> None:
    """Draws lines such as gates, and faintly those that are marks on the floor."""
    for shape in shapes:
        rgb = rgb_of(shape)
        is_thin = shape.get("radius_m", 0.1) < THIN_M
        color = mixed(WATER, (rgb[0], rgb[1], rgb[2]), 0.25 if is_thin else 1.0)
        points = [camera.at(at[0], at[2]) for at in points_of(shape)]
        for start, end in pairwise(points):
            part = clipped(start, end)
            if part is not None:
                canvas.line(list(part), color, 0.8 if is_thin else 2.2)


def draw_current(canvas: Canvas, arrow: Sequence[float] | None) -> None:
    """Draws where the water goes at the end of the run, in a corner of the scene."""
    if arrow is None:
        return
    x, y = SCENE[2] - 60.0, SCENE[3] - 40.0
    dx, dy = CURRENT_POINTS_PER_NEWTON * arrow[3], -CURRENT_POINTS_PER_NEWTON * arrow[5]
    length = math.hypot(dx, dy)
    if length < 1.0:
        return
    ux, uy = dx / length, dy / length
    tip = (x + 0.5 * dx, y + 0.5 * dy)
    canvas.line([(x - 0.5 * dx, y - 0.5 * dy), tip], CURRENT, 2.0)
    back = [(tip[0] - 7.0 * ux + side * 4.0 * uy, tip[1] - 7.0 * uy - side * 4.0 * ux) for side in (1.0, -1.0)]
    canvas.polygon([tip, *back], CURRENT)
    canvas.text((x, SCENE[3] - 72.0), "current", 10.0, CURRENT, "ma")


def draw_ground(canvas: Canvas, camera: Camera, statics: dict[str, Any], is_time: bool) -> None:
    """Fills the ground below the line in which the plane of motion cuts each static mesh, the longest lines first."""
    cuts = [(rgb_of(shape), _cut(shape)) for shape in statics.values() if shape.get("kind") == "mesh"]
    for i, (rgb, segments) in enumerate(sorted(cuts, key=lambda cut: -_extent(cut[1]))):
        color: Rgb = (rgb[0], rgb[1], rgb[2])
        line = sorted(segments)
        if is_time:  # only the place at which it comes down
            line = [
                ((low, z), (high, z))
                for (x0, z), (x1, _) in line
                if x0 <= 0.0 <= x1
                for low, high in [camera.along_range()]
            ]
        elif i == 0 and line:  # the widest is the ground, and goes on to both sides
            line = [((-FAR_M, line[0][0][1]), line[0][0]), *line, (line[-1][1], (FAR_M, line[-1][1][1]))]
        for start, end in _visible(camera, line):
            if i == 0:
                canvas.polygon([start, end, (end[0], SCENE[3]), (start[0], SCENE[3])], mixed(SKY, color, 0.55))
            canvas.line([start, end], mixed(color, (255, 255, 255), 0.15), 1.6 if i == 0 else 3.2)


def _visible(camera: Camera, segments: Iterable[tuple[Point, Point]]) -> Iterable[tuple[Point, Point]]:
    """Returns the parts of segments (x, z) that lie within the scene from left to right, on the sheet."""
    low, high = camera.along_range()
    for (x0, z0), (x1, z1) in segments:
        a, b = max(x0, low), min(x1, high)
        if b > a:
            slope = (z1 - z0) / (x1 - x0)
            yield camera.at(a, z0 + slope * (a - x0)), camera.at(b, z0 + slope * (b - x0))


def _cut(shape: dict[str, Any]) -> list[tuple[Point, Point]]:
    """Returns the segments (x, z) in which triangles meet the plane y = 0."""
    segments = []
    vertices = points_of(shape)
    for triangle in vertices[np.array(shape["triangles"], int)]:
        crossed = []
        for a, b in ((0, 1), (1, 2), (2, 0)):
            (xa, ya, za), (xb, yb, zb) = triangle[a], triangle[b]
            if (ya < 0) != (yb < 0):
                share = ya / (ya - yb)
                crossed.append((xa + share * (xb - xa), za + share * (zb - za)))
        if len(crossed) == 2:
            segments.append((min(crossed), max(crossed)))
    return segments


def _extent(segments: Sequence[tuple[Point, Point]]) -> float:
    xs = [x for segment in segments for x, _ in segment]
    return max(xs) - min(xs) if xs else 0.0


def draw_scales(canvas: Canvas, camera: Camera, is_time: bool) -> None:
    """Draws what the edges of the scene measure, and hides what hangs out below."""
    left, top, right, bottom = SCENE
    canvas.rectangle(0, bottom, right + 8, HEIGHT, fill=BACKGROUND)
    for z in ticks(*camera.z_range(), count=5):
        y = camera.at(0.0, z)[1]
        if top + 6 < y < bottom - 2:
            canvas.line([(left - 4, y), (left, y)], FAINT, 0.8)
            canvas.text((left - 7, y), f"{z:g}", 10.0, PALE, "rm")
    for along in ticks(*camera.along_range(), count=6):
        x = camera.at(along, 0.0)[0]
        if left + 4 < x < right - 22:
            canvas.line([(x, bottom), (x, bottom + 4)], FAINT, 0.8)
            canvas.text((x, bottom + 6), f"{along:g}", 10.0, PALE, "ma")
    canvas.text((left - 7, top - 2), "m", 10.0, PALE, "rm")
    canvas.text((right - 2, bottom + 6), "s" if is_time else "m", 10.0, PALE, "ra")
