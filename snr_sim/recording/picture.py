"""One picture that tells a whole run: the body at several moments of its way over the ground, and plots beside it.

Bodies are seen from the south, in the x-z plane. One that only rises and falls is spread out along time; one
under water whose way is better seen on a map is seen from above.
Everything comes from the header's scene and the true states of the trace, so any plant can have its picture taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from snr_sim.prelude.errors import TraceError
from snr_sim.recording.picture_canvas import Canvas, Point, Rgb, mixed
from snr_sim.recording.picture_plots import BACKGROUND, FAINT, INK, PALE, Plot, draw_plots, ticks
from snr_sim.recording.records import EndRecord, Header, Record, TruthRecord
from snr_sim.recording.view_blueprint import Line, name_and_unit, plots
from snr_sim.recording.view_columns import Batch, Floats, Series
from snr_sim.recording.view_scene import points_of, rgb_of

WIDTH, HEIGHT = 900, 500
SCENE = (46.0, 62.0, 596.0, 474.0)  # left, top, right, bottom
PLOTS = (640.0, 62.0, 884.0, 474.0)
FAR_M = 1e6
SKY: Rgb = (9, 12, 24)
PATH: Rgb = (110, 190, 250)
WATER: Rgb = (12, 52, 84)
SURFACE: Rgb = (120, 200, 232)
FLAME: tuple[Rgb, Rgb] = ((255, 120, 30), (255, 225, 130))
JET: tuple[Rgb, Rgb] = ((120, 205, 240), (235, 250, 255))  # of a propeller: water, not fire
CURRENT: Rgb = (150, 235, 190)
CURRENT_POINTS_PER_NEWTON = 3.5  # the arrow "current" of a plant is 40 N for 1 m/s
LIGHT = np.array([-0.45, -0.65, 0.62])  # towards the light: from the left, from the front and from above
SURFACE_SHOWN_M = 4.0  # a way that comes as near to the surface is shown together with it
TURN_RAD, FLAT, FLAT_M = math.radians(45.0), 4.0, 0.2  # see `_wants_map`
THIN_M = 0.01  # lines thinner than this are marks on the floor
NO_PUSH = ("current", "tether")  # arrows that are no thrust
ENLARGED_IN_WATER = 2.0
STROBES_MAX = 9
BODY_SHARE = 0.14  # of the scene's height: a body is drawn so large, or it would be a dot on its way
GROUND_SHARE = 0.12  # so much of the scene lies below the lowest point of the way
PLOTTED_UNITS = ("m", "m/s", "", "kg")  # what a newcomer understands; the view has the rest

Rows: TypeAlias = NDArray[np.float64]

Touchdown: TypeAlias = Mapping[str, float] | None


def draw_run(
    header: Header, records: Iterable[Record], path: str | Path, outcome: str = "", touchdown: Touchdown = None
) -> None:
    """Draws a run as a PNG of 1800 x 1000 pixels.

    Args:
        header: of the trace.
        records: of the trace.
        path: of the file to write.
        outcome: how it ended, in a word; without it, the reason that the node gave.
        touchdown: the judged one, number by name with unit, as in result.json; only that is told in words.

    Raises:
        MissingExtra: Pillow is not installed.
        TraceError: the trace has no true states, as one from a real robot.
    """
    batch, kept = Batch(), list(records)
    batch.extend(kept)
    reason = next((record.reason for record in reversed(kept) if isinstance(record, EndRecord)), "")
    flight = _flight(header, batch)
    canvas = Canvas(WIDTH, HEIGHT, BACKGROUND)
    _draw_scene(canvas, header, flight)
    draw_plots(canvas, PLOTS, _plots(batch), flight.touchdown_s)
    _draw_title(canvas, header, flight, outcome or reason, touchdown)
    canvas.save(path)


@dataclass(frozen=True)
class _Flight:
    """The way of the bodies.

    Args:
        times_s: shape (n,).
        poses: of each body, shape (n, 7).
        arrows: rows of each arrow, by the index of the time.
        values: the true numbers, by name.
        touchdown_s: when it first touched the ground, if it did.
    """

    times_s: Floats
    poses: dict[str, Rows]
    arrows: list[dict[str, list[float]]]
    values: list[dict[str, float]]
    touchdown_s: float | None


def _is_in_water(header: Header) -> bool:
    """Whether the scene has a line named 'surface': that of still water at z = 0."""
    return "surface" in header.scene.get("statics", {})


def _wants_map(poses: Rows) -> bool:
    """Whether a way goes much farther to the sides than up and down, or turns and goes farther to the north than so."""
    spread_x, spread_y, spread_z = np.ptp(poses[:, :3], axis=0)
    if max(spread_x, spread_y) > FLAT * max(spread_z, FLAT_M):
        return True
    x, y, z, w = poses[:, 3:].T
    heading = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    return bool(np.ptp(heading) > TURN_RAD and spread_y > spread_z)


def _from_above(header: Header, flight: _Flight) -> tuple[Header, _Flight]:
    """Returns the world laid on its back: north is up, up is towards who looks, and below is behind."""

    def point(at: Sequence[float]) -> list[float]:
        return [at[0], -at[2], at[1]]

    def laid(shape: dict[str, Any]) -> dict[str, Any]:
        return {**shape, "points_m": [point(at) for at in shape["points_m"]]}

    half = math.sqrt(0.5)  # a quarter turn about x

    def pose(at: Any) -> list[float]:
        x, y, z, w = at[3:]
        return [*point(at[:3]), half * (x + w), half * (y - z), half * (z + y), half * (w - x)]

    statics = header.scene["statics"].items()
    scene = {
        "statics": {name: laid(shape) for name, shape in statics if shape.get("kind") == "polyline"},
        "bodies": header.scene["bodies"],
    }
    return msgspec.structs.replace(header, scene=scene), replace(
        flight,
        poses={body: np.array([pose(at) for at in rows]) for body, rows in flight.poses.items()},
        arrows=[
            {name: [*point(arrow[:3]), *point(arrow[3:])] for name, arrow in arrows.items()} for arrows in flight.arrows
        ],
    )


def _flight(header: Header, batch: Batch) -> _Flight:
    truths: list[TruthRecord] = batch.truths
    bodies = [
        body for body in header.scene.get("bodies", {}) if truths and all(body in truth.poses for truth in truths)
    ]
    if not bodies:
        raise TraceError(
            "This trace has no true states of a body, so there is nothing to draw.",
            fix="draw a simulated run; what a real robot believed is in 'snr view'.",
        )
    return _Flight(
        times_s=np.array([truth.t for truth in truths]),
        poses={body: np.array([truth.poses[body] for truth in truths], float) for body in bodies},
        arrows=[truth.arrows for truth in truths],
        values=[truth.values for truth in truths],
        touchdown_s=_touchdown_s(batch),
    )


def _touchdown_s(batch: Batch) -> float | None:
    """Returns when a page said 'contact', or, without such a page, when the altitude was first zero."""
    for _, series in batch.page_values():
        if "contact" in series.path and series.values.any():
            return float(series.when.t_s[np.argmax(series.values > 0)])
    for series in batch.truth_values():
        if series.path == ("altitude_m",) and (series.values <= 0.01).any():
            return float(series.when.t_s[np.argmax(series.values <= 0.01)])
    return None


class _Camera:
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
        left, _, right, bottom = SCENE
        return (left + right) / 2 + (along - self.middle) * self.scale, bottom - (z - self.low_z) * self.z_scale

    def along_range(self) -> tuple[float, float]:
        half = (SCENE[2] - SCENE[0]) / 2 / self.scale
        return self.middle - half, self.middle + half

    def z_range(self) -> tuple[float, float]:
        return self.low_z, self.low_z + (SCENE[3] - SCENE[1]) / self.z_scale


def _draw_scene(canvas: Canvas, header: Header, flight: _Flight) -> None:
    main = next(iter(flight.poses))
    in_water = _is_in_water(header)
    is_above = in_water and _wants_map(flight.poses[main])
    if is_above:
        header, flight = _from_above(header, flight)
    bodies = header.scene["bodies"]
    feet_m, size_m = _feet_and_size(bodies)
    feet_m = 0.0 if in_water else feet_m  # what swims stands on nothing
    poses = flight.poses[main]
    feet = np.array([_turned(pose, [0.0, 0.0, feet_m]) for pose in poses])
    is_time = np.ptp(feet[:, 0]) < 0.02 * np.ptp(feet[:, 2])
    along, heights = (flight.times_s if is_time else feet[:, 0]), feet[:, 2]
    shown = [*heights, 0.0] if in_water and not is_above and heights.max() > -SURFACE_SHOWN_M else heights
    camera = _Camera(along, np.array(shown), size_m, is_time)
    if is_above:
        camera.low_z = float(heights.min() + heights.max()) / 2 - 0.5 * (SCENE[3] - SCENE[1]) / camera.z_scale
    canvas.rectangle(*SCENE, fill=SKY)
    if in_water:
        _draw_water(canvas, camera, is_above)
    lines = _lines(header, is_above) if in_water and not is_time else {}
    _draw_lines(canvas, camera, [shape for shape in lines.values() if shape.get("radius_m", 0.1) < THIN_M])
    way = [camera.at(a, z) for a, z in zip(along, heights, strict=True)]
    canvas.line(way[:: max(1, len(way) // 800)] + way[-1:], PATH, 1.2)
    enlarged = max(1.0, BODY_SHARE * (SCENE[3] - SCENE[1]) / (size_m * camera.z_scale))
    enlarged = min(enlarged, ENLARGED_IN_WATER) if in_water else enlarged  # or it would not fit through its gates
    forces = [arrow for arrows in flight.arrows for name, arrow in arrows.items() if name not in NO_PUSH]
    strongest = max(map(_length, forces), default=0.0) or 1.0
    size = size_m * camera.z_scale * enlarged
    moments = _moments(np.array(way), 1.25 * size)
    places = [_Place(way[i], feet[i], camera.z_scale * enlarged) for i in moments]
    for i, place in zip(moments, places, strict=True):
        for name, arrow in flight.arrows[i].items():
            if name not in NO_PUSH:
                _draw_flame(canvas, place, arrow, 0.8 * size / strongest, JET if in_water else FLAME)
    _draw_ground(canvas, camera, header.scene.get("statics", {}), is_time)  # over flames, under feet
    for i, place in zip(moments, places, strict=True):
        shapes = [(shape, flight.poses[body][i]) for body in flight.poses for shape in bodies[body]]
        _draw_shapes(canvas, place, shapes)
        beside = (way[i][0] + 0.62 * size, way[i][1] - 0.5 * size)
        canvas.text(beside, f"{flight.times_s[i]:.0f} s", 10.5, PALE, "lm")
    _draw_lines(canvas, camera, [shape for shape in lines.values() if shape.get("radius_m", 0.1) >= THIN_M])
    _frame(canvas, camera, is_time)
    if in_water:
        _draw_current(canvas, flight.arrows[-1].get("current"))
        canvas.text((SCENE[0] + 8, SCENE[1] + 8), "from above" if is_above else "from the south", 10.0, FAINT, "la")
    if enlarged > 1.5:
        canvas.text((SCENE[2] - 8, SCENE[1] + 8), f"{main} drawn {enlarged:.0f} times its size", 10.0, FAINT, "ra")


@dataclass(frozen=True)
class _Place:
    """Where a body is drawn: its feet stand at a point of the sheet, and it may be larger than life."""

    feet_on_sheet: Point
    feet_m: Any
    scale: float

    def at(self, point: Any) -> Point:
        x, y = self.feet_on_sheet
        return x + (point[0] - self.feet_m[0]) * self.scale, y - (point[2] - self.feet_m[2]) * self.scale


def _feet_and_size(bodies: dict[str, list[dict[str, Any]]]) -> tuple[float, float]:
    """Returns the lowest point [m] of all bodies in their frame, and their height or width, whichever is more."""
    points = np.concatenate([points_of(shape) for shapes in bodies.values() for shape in shapes])
    return float(points[:, 2].min()), float(max(np.ptp(points[:, 0]), np.ptp(points[:, 2])))


def _moments(way: Rows, apart: float) -> list[int]:
    """Returns indices of moments, first and last among them, evenly along the way and at least `apart` points."""
    steps = np.hypot(*np.diff(way, axis=0).T)
    gone = np.concatenate(([0.0], np.cumsum(steps)))
    count = int(min(STROBES_MAX, max(2, gone[-1] // apart + 1)))
    return sorted({int(np.searchsorted(gone, share * gone[-1])) for share in np.linspace(0.0, 1.0, count)})


def _turned(pose: Any, points: Any) -> Rows:
    """Returns points of the body frame, shape (..., 3), in the world frame."""
    x, y, z, w = pose[3:]
    vector = np.array([x, y, z])
    points = np.asarray(points, float)
    twice = 2.0 * np.cross(np.broadcast_to(vector, points.shape), points)
    moved: Rows = points + w * twice + np.cross(np.broadcast_to(vector, points.shape), twice) + np.asarray(pose[:3])
    return moved


def _draw_shapes(canvas: Canvas, place: _Place, shapes: Sequence[tuple[dict[str, Any], Any]]) -> None:
    """Draws the faces that look to the south, the farthest first."""
    parts: list[tuple[float, list[Point], Rgb, float]] = []
    for shape, pose in shapes:
        rgb = tuple(rgb_of(shape))
        if shape.get("kind") == "polyline":
            corners = _turned(pose, shape["points_m"])
            width = max(0.6, 2.0 * shape.get("radius_m", 0.1) * place.scale)
            parts.append((float(corners[:, 1].mean()), [place.at(corner) for corner in corners], rgb, width))  # type: ignore
            continue
        for face in _faces(shape):
            corners = _turned(pose, face)
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            length = np.linalg.norm(normal)
            if length > 0 and normal[1] < 0:
                light = 0.35 + 0.65 * max(0.0, float(normal @ LIGHT / length))
                shade = mixed((0, 0, 0), rgb, light)  # type: ignore[arg-type]
                parts.append((float(corners[:, 1].mean()), [place.at(corner) for corner in corners], shade, 0.0))
    for _, points, rgb_, width in sorted(parts, key=lambda part: -part[0]):
        if width:
            canvas.line(points, rgb_, width)
        else:
            canvas.polygon(points, rgb_)


def _faces(shape: dict[str, Any]) -> list[Rows]:
    """Returns the triangles of a mesh or the sides of a box, each shape (k, 3), counter-clockwise from outside."""
    if shape.get("kind") == "mesh":
        vertices = points_of(shape)
        return [vertices[list(triangle)] for triangle in shape["triangles"]]
    if shape.get("kind") == "box":
        corners = points_of(shape)  # as binary numbers: x, y, z
        sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
        return [corners[list(side)] for side in sides]
    return []


def _draw_water(canvas: Canvas, camera: _Camera, is_above: bool) -> None:
    """Fills the scene with water, seen from the south up to its surface."""
    left, top, right, bottom = SCENE
    level = top if is_above else max(top, camera.at(0.0, 0.0)[1])
    if level < bottom:
        canvas.rectangle(left, level, right, bottom, fill=WATER)
    if top < level < bottom:
        canvas.line([(left, level), (right, level)], SURFACE, 1.6)


def _lines(header: Header, is_above: bool) -> dict[str, Any]:
    """Returns what of the world is made of lines; from the side the surface is drawn with the water."""
    return {
        name: shape
        for name, shape in header.scene.get("statics", {}).items()
        if shape.get("kind") == "polyline" and (is_above or name != "surface")
    }


def _draw_lines(canvas: Canvas, camera: _Camera, shapes: Iterable[dict[str, Any]]) -> None:
    """Draws lines such as gates, and faintly those that are marks on the floor."""
    for shape in shapes:
        rgb = rgb_of(shape)
        is_thin = shape.get("radius_m", 0.1) < THIN_M
        color = mixed(WATER, (rgb[0], rgb[1], rgb[2]), 0.25 if is_thin else 1.0)
        points = [camera.at(at[0], at[2]) for at in points_of(shape)]
        for start, end in pairwise(points):
            part = _clipped(start, end)
            if part is not None:
                canvas.line(list(part), color, 0.8 if is_thin else 2.2)


def _clipped(start: Point, end: Point) -> tuple[Point, Point] | None:
    """Returns the part of a segment that lies within the scene; None if none does.

    >>> _clipped((0.0, 100.0), (1000.0, 100.0)) == ((SCENE[0], 100.0), (SCENE[2], 100.0))
    True
    >>> _clipped((0.0, 0.0), (1000.0, 0.0)) is None
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


def _draw_current(canvas: Canvas, arrow: Sequence[float] | None) -> None:
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


def _draw_flame(
    canvas: Canvas,
    place: _Place,
    arrow: Sequence[float],
    points_per_newton: float,
    colors: tuple[Rgb, Rgb],
) -> None:
    """Draws a force as what makes it: a flame the other way, out of the point where it acts."""
    length = _length(arrow) * points_per_newton
    if length < 1.0:
        return
    x, y = place.at(arrow[:3])
    along = np.array([-arrow[3], arrow[5]]) / _length(arrow)
    across = np.array([-along[1], along[0]])
    for color, long, wide in zip(colors, (1.0, 0.55), (0.13, 0.07), strict=True):
        half = wide * min(length, 40.0) + 1.0
        tip = along * length * long
        canvas.polygon(
            [
                (x + half * across[0], y + half * across[1]),
                (x + tip[0], y + tip[1]),
                (x - half * across[0], y - half * across[1]),
            ],
            color,
        )


def _length(arrow: Sequence[float]) -> float:
    return float(np.hypot(arrow[3], arrow[5]))


def _draw_ground(canvas: Canvas, camera: _Camera, statics: dict[str, Any], is_time: bool) -> None:
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


def _visible(camera: _Camera, segments: Iterable[tuple[Point, Point]]) -> Iterable[tuple[Point, Point]]:
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


def _frame(canvas: Canvas, camera: _Camera, is_time: bool) -> None:
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


def _plots(batch: Batch) -> list[Plot]:
    """Returns a plot for each unit that a newcomer understands, out of the true numbers."""
    series: dict[str, Series] = {one.path[-1]: one for one in batch.truth_values() if one.values.any()}
    lines = [Line(key, *name_and_unit((key,)), is_truth=True) for key in series]
    chosen = {title: group for title, group in plots(lines).items() if group[0].unit in PLOTTED_UNITS}
    return [
        Plot(title, [(line.name, series[line.entity].when.t_s, series[line.entity].values) for line in group])
        for title, group in chosen.items()
    ]


def _draw_title(canvas: Canvas, header: Header, flight: _Flight, outcome: str, touchdown: Touchdown) -> None:
    left, right = 14.0, PLOTS[2]
    canvas.text((left, 10), header.scenario, 19.0, INK)
    beside = left + canvas.text_width(header.scenario, 19.0) + 12
    canvas.text((beside, 16), f"seed {header.seed}, controller '{header.controller}'", 12.5, PALE)
    said = f"{outcome}, " if outcome else ""
    canvas.text((right, 12), f"{said}{flight.times_s[-1]:.1f} s", 15.0, INK, "ra")
    canvas.text((right, 35), _told(flight, touchdown), 11.5, PALE, "ra")


def _told(flight: _Flight, touchdown: Touchdown) -> str:
    """Returns what is worth a line: how it touched down, and what it burned."""
    told = []
    first, last = flight.values[0], flight.values[-1]
    numbers = [(*name_and_unit((key,)), value) for key, value in (touchdown or {}).items()]
    if numbers:
        told.append("touchdown: " + ", ".join(f"{name} {value:.1f} {unit}" for name, unit, value in numbers))
    for key in first.keys() & last.keys():
        name, unit = name_and_unit((key,))
        if unit == "kg" and last[key] < first[key]:
            told.append(f"{first[key] - last[key]:.0f} kg of {name}")
    return "; ".join(told)
