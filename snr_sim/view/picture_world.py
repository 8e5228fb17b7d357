"""Draws the ground, and the scales beside a scene."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from snr_sim.recording.scene import points_of, rgb_of
from snr_sim.view.picture_canvas import Canvas, Point, Rgb, mixed
from snr_sim.view.picture_layout import HEIGHT, Camera
from snr_sim.view.picture_plots import BACKGROUND, FAINT, PALE, ticks

FAR_M = 1e6
SKY: Rgb = (9, 12, 24)


def draw_ground(canvas: Canvas, camera: Camera, statics: dict[str, Any], is_time: bool) -> None:
    """Fills the ground below the line in which the plane of motion cuts each static mesh, the longest lines first."""
    bottom = camera.area[3]
    for i, (color, cut) in enumerate(ground_cuts(statics)):
        line = cut
        if is_time:  # only the place at which it comes down
            line = [
                ((low, z), (high, z))
                for (x0, z), (x1, _) in line
                if x0 <= 0.0 <= x1
                for low, high in [camera.along_range()]
            ]
        for part in within(line, *camera.along_range()):
            start, end = (camera.at(x, z) for x, z in part)
            if i == 0:
                canvas.polygon([start, end, (end[0], bottom), (start[0], bottom)], mixed(SKY, color, 0.55))
            canvas.line([start, end], mixed(color, (255, 255, 255), 0.15), 1.6 if i == 0 else 3.2)


def ground_cuts(statics: dict[str, Any]) -> list[tuple[Rgb, list[tuple[Point, Point]]]]:
    """Returns the colour and the segments (x, z) in which the plane of motion cuts each static mesh, widest first.

    The widest is the ground. It is drawn as far as anybody went, but it goes on to both sides.
    """
    meshes = [shape for shape in statics.values() if shape.get("kind") == "mesh"]
    cuts = [(_color(shape), sorted(cut_by_plane(shape))) for shape in meshes]
    cuts.sort(key=lambda cut: -_extent(cut[1]))
    if cuts and cuts[0][1]:
        color, line = cuts[0]
        ends = ((-FAR_M, line[0][0][1]), line[0][0]), (line[-1][1], (FAR_M, line[-1][1][1]))
        cuts[0] = color, [ends[0], *line, ends[1]]
    return cuts


def _color(shape: dict[str, Any]) -> Rgb:
    red, green, blue = rgb_of(shape)
    return red, green, blue


def within(segments: Iterable[tuple[Point, Point]], low: float, high: float) -> Iterable[tuple[Point, Point]]:
    """Returns the parts of segments (x, z) that lie between two x.

    >>> list(within([((0.0, 0.0), (4.0, 2.0)), ((4.0, 2.0), (9.0, 2.0))], 2.0, 3.0))
    [((2.0, 1.0), (3.0, 1.5))]
    """
    for (x0, z0), (x1, z1) in segments:
        a, b = max(x0, low), min(x1, high)
        if b > a:
            slope = (z1 - z0) / (x1 - x0)
            yield (a, z0 + slope * (a - x0)), (b, z0 + slope * (b - x0))


def cut_by_plane(shape: dict[str, Any]) -> list[tuple[Point, Point]]:
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


def draw_scales(canvas: Canvas, camera: Camera, unit: str) -> None:
    """Draws what the edges of the scene measure, and hides what hangs out below.

    Args:
        canvas: to draw on.
        camera: of the scene.
        unit: of what goes from left to right.
    """
    left, top, right, bottom = camera.area
    canvas.rectangle(0, bottom, right + 8, HEIGHT, fill=BACKGROUND)
    for z in ticks(*camera.z_range(), count=max(2, round((bottom - top) / 80.0))):
        y = camera.at(0.0, z)[1]
        if top + 9 < y < bottom - 2:
            canvas.line([(left - 4, y), (left, y)], FAINT, 0.8)
            canvas.text((left - 7, y), f"{z:g}", 10.0, PALE, "rm")
    for along in ticks(*camera.along_range(), count=6):
        x = camera.at(along, 0.0)[0]
        if left + 4 < x < right - 22:
            canvas.line([(x, bottom), (x, bottom + 4)], FAINT, 0.8)
            canvas.text((x, bottom + 6), f"{along:g}", 10.0, PALE, "ma")
    canvas.text((left - 7, top - 2), "m", 10.0, PALE, "rm")
    canvas.text((right - 2, bottom + 6), unit, 10.0, PALE, "ra")
