"""Draws the scene of a dive: from above and from the south, the one that tells more is larger.

Numbers in circles stand where something happened; the words for them are below the scene.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from snr_sim.recording.records import Header
from snr_sim.recording.scene import is_slack, points_of
from snr_sim.view.picture_bodies import JET, draw_flames, draw_shapes, strongest_of
from snr_sim.view.picture_canvas import Canvas, Point, Rgb
from snr_sim.view.picture_flight import Flight, from_above, is_planar, wants_map
from snr_sim.view.picture_layout import SCENE, Area, Camera, Labels, Place, Stage, feet_and_size
from snr_sim.view.picture_moments import Moment, broken, is_gate
from snr_sim.view.picture_plots import EVENT, PALE, draw_number
from snr_sim.view.picture_water import (
    draw_current,
    draw_gates,
    draw_marks,
    draw_tether,
    draw_water,
)
from snr_sim.view.picture_world import draw_ground, draw_scales

PATH: Rgb = (110, 190, 250)
BROKEN: Rgb = (255, 60, 60)
LOAD: Rgb = (196, 150, 90)
SURFACE_SHOWN_M = 4.0  # a way that comes as near to the surface is shown together with it
NEAR_M = 5.0  # so near to the way, gates and the place that holds the tether are shown with it
ENLARGED = 2.0  # at most, or it would not fit through its gates
MAIN_SHARE = 0.62  # of the height, for the view that tells more
AIR_SHARE = 0.16  # of the height, over the surface
BETWEEN = 24.0  # points between the two views
ROW, COLUMNS = 14.0, 3  # of the words below


def draw_dive(canvas: Canvas, header: Header, flight: Flight, moments: Sequence[Moment]) -> None:
    """Draws both views, or of what stays in its plane the one from the south, and the words for what happened."""
    left, top, right, bottom = SCENE
    bottom -= ROW * math.ceil(len(moments) / COLUMNS)
    poses = next(iter(flight.poses.values()))
    main_is_map = wants_map(poses) or any(map(is_gate, header.scene["statics"].values()))
    high = (MAIN_SHARE if main_is_map else 1.0 - MAIN_SHARE) * (bottom - top - BETWEEN)
    if is_planar(header):
        _View(canvas, (left, top, right, bottom), header, flight, is_above=False).draw(moments, is_main=True)
    else:
        areas: tuple[Area, Area] = (left, top, right, top + high), (left, top + high + BETWEEN, right, bottom)
        for area, is_above in zip(areas, (True, False), strict=True):
            _View(canvas, area, header, flight, is_above).draw(moments, is_main=is_above == main_is_map)
    for i, moment in enumerate(moments):
        x, y = left + (right - left) * (i % COLUMNS) / COLUMNS, bottom + 26.0 + ROW * (i // COLUMNS)
        draw_number(canvas, (x + 5.0, y), i + 1)
        canvas.text((x + 14.0, y), f"{moment.time_s:.1f} s  {moment.words}", 10.0, PALE, "lm")


class _View:
    """A dive from above or from the south.

    Args:
        canvas: to draw on.
        area: of the sheet.
        header: of the run.
        flight: the way.
        is_above: whether this is the map.
    """

    def __init__(self, canvas: Canvas, area: Area, header: Header, flight: Flight, is_above: bool) -> None:
        self.canvas, self.area, self.is_above = canvas, area, is_above
        if is_above:
            header, flight = from_above(header, flight)
        self.flight, self.bodies, self.statics = flight, header.scene["bodies"], header.scene["statics"]
        self.tethers: dict[str, dict[str, Any]] = header.scene.get("tethers", {})
        self.main = next(iter(flight.poses))
        feet = flight.poses[self.main][:, :3]  # what swims stands on nothing
        seen = np.concatenate([feet, *self._near(feet)])
        if not is_above and feet[:, 2].max() > -SURFACE_SHOWN_M:
            seen = np.concatenate([seen, [[feet[0, 0], feet[0, 1], 0.0]]])
        size_m = feet_and_size(self.bodies)[1]
        self.camera = Camera(seen[:, 0], seen[:, 2], size_m, False, area)
        if is_above:
            self.camera.center(seen[:, 2])
        else:
            low_z, high_z = self.camera.z_range()  # what room there is, is for the water
            self.camera.low_z -= max(0.0, high_z - max(AIR_SHARE * (high_z - low_z), seen[:, 2].max() + size_m))
        self.stage = Stage(self.camera, feet[:, 0], feet, size_m, ENLARGED)

    def _near(self, way: Any) -> list[Any]:
        """Returns the corners of gates, and the places that hold tethers, that are near enough to be shown."""
        low, high = way.min(axis=0), way.max(axis=0)
        held = [np.array([tether["anchor_m"]]) for tether in self.tethers.values()]
        near = [one for one in held if np.all(one > low - NEAR_M) and np.all(one < high + NEAR_M)]
        return near + [points_of(shape) for shape in self.statics.values() if is_gate(shape)]

    def draw(self, moments: Sequence[Moment], is_main: bool) -> None:
        """Draws all of it, from what lies behind to what must be read."""
        canvas, camera, stage, flight = self.canvas, self.camera, self.stage, self.flight
        draw_water(canvas, camera, self.statics, self.is_above)
        draw_marks(canvas, camera, self.statics, self.is_above)
        if not self.is_above:
            draw_ground(canvas, camera, self.statics, is_time=False)
        tethers = [self._draw_tethers(i, place) for i, place in zip(stage.moments, stage.places, strict=True)]
        points_per_newton = 0.8 * stage.size / strongest_of(flight.arrows)
        jets = []
        for i, place in zip(stage.moments, stage.places, strict=True):
            jets += draw_flames(canvas, place, flight.arrows[i], points_per_newton, JET)
            self._draw_load(i, place)
        for i, place in zip(stage.moments, stage.places, strict=True):
            shapes = [(shape, flight.poses[body][i]) for body in flight.poses for shape in self.bodies[body]]
            draw_shapes(canvas, place, shapes)
            self._mark_broken(i, place)
        draw_gates(canvas, camera, self.statics, self.is_above)
        canvas.line(stage.thinned(), PATH, 1.2)
        draw_current(canvas, camera, flight.arrows[-1].get("current") if is_main else None)
        draw_scales(canvas, camera, "m")
        left, top, right, bottom = self.area
        labels = Labels([stage.way[i] for i in stage.moments], 0.42 * stage.size, (left, top + 18, right, bottom))
        labels.keep_free(jets, 3.0)
        if not self.is_above:
            level = camera.at(0.0, 0.0)[1]  # of the surface: a line through words makes both hard to see
            labels.keep_free([(float(x), level) for x in range(round(left), round(right), 8)], 2.0)
        self._write_times(labels)
        if is_main:
            self._write_names(labels, tethers[-1])
        self._write_moments(moments)
        self._write_view()

    def _draw_tethers(self, i: int, place: Place) -> list[tuple[list[Point], str]]:
        """Draws them at a moment, faintly but for the last; returns where each is and what is to be said of it."""
        said = []
        for name, tether in self.tethers.items():
            arrow, pose = self.flight.arrows[i].get(name, [0.0] * 6), self.flight.poses[tether["body"]][i]
            pull_n = math.hypot(*arrow[3:])
            share = 1.0 if i == self.stage.moments[-1] else 0.25
            points = draw_tether(self.canvas, self.camera, place, tether, pose, pull_n, share)
            said.append((points, f"{name}: {'slack' if is_slack(tether, pose) else 'taut'}, pulls {pull_n:.1f} N"))
        return said

    def _draw_load(self, i: int, place: Place) -> None:
        """Draws what hangs at the vehicle, as a box under it; on a map it is hidden."""
        if self.is_above or not self.flight.values[i].get("load_kg"):
            return
        (x, y), half = place.feet_on_sheet, 0.14 * self.stage.size
        top = y + 0.26 * self.stage.size
        self.canvas.line([(x, y), (x, top)], LOAD, 1.2)
        self.canvas.rectangle(x - half, top, x + half, top + 1.4 * half, LOAD)

    def _mark_broken(self, i: int, place: Place) -> None:
        """Crosses out what is broken."""
        for name in broken(self.flight.values[i]):
            if name in self.flight.arrows[i]:
                x, y = place.at(self.flight.arrows[i][name][:3])
                r = max(4.0, 0.10 * self.stage.size)
                self.canvas.line([(x - r, y - r), (x + r, y + r)], BROKEN, 2.4)
                self.canvas.line([(x - r, y + r), (x + r, y - r)], BROKEN, 2.4)

    def _write_times(self, labels: Labels) -> None:
        """Writes when it was where, as far as there is room."""
        canvas, stage, r = self.canvas, self.stage, 0.55 * self.stage.size
        for i in stage.moments:
            words = f"{self.flight.times_s[i]:.0f} s"
            width, (x, y) = canvas.text_width(words, 10.5), stage.way[i]
            beside = [(x + r, y - r), (x - r - width, y - r), (x + r, y + r), (x - r - width, y + r)]
            over = [(x - width / 2, y + side * far * r) for far in (1.3, 2.0) for side in (-1.0, 1.0)]
            place = labels.place([*beside, *over], width, 11.0)
            if place is not None:
                canvas.text(place, words, 10.5, PALE, "lm")

    def _write_names(self, labels: Labels, tethers: Sequence[tuple[list[Point], str]]) -> None:
        """Writes what the tethers are and what the gates are called."""
        names = [(*points[len(points) // 2], words, EVENT) for points, words in tethers]
        for points, _ in tethers:
            labels.keep_free(points, 2.0)
        for shape in self.statics.values():
            if is_gate(shape):
                x, z = points_of(shape)[:, [0, 2]].max(axis=0)
                names.append((*self.camera.at(x, z), shape["label"], PALE))
        for x, y, words, color in names:
            width = self.canvas.text_width(words, 10.0)
            beside = [(x + dx, y + dy) for dy in (-8, 8, -22, 22, -36, 36) for dx in (8.0, -8.0 - width)]
            around = [*beside, (x - 0.5 * width, y + 12.0), (x - 0.5 * width, y - 12.0)]
            place = labels.place(around, width, 11.0)
            if place is not None:
                self.canvas.text(place, words, 10.0, color, "lm")

    def _write_moments(self, moments: Sequence[Moment]) -> None:
        """Writes the numbers of what happened where it did, beside each other if it was at one place."""
        numbers = Labels([], 0.0, self.area)
        for number, moment in enumerate(moments, 1):
            x, y = self.stage.way[int(np.searchsorted(self.flight.times_s[:-1], moment.time_s))]
            near = [(x + dx - 6.0, y + dy) for dy in (0, -12, 12, -24, 24) for dx in (0, 12, -12, 24, -24, 36, -36)]
            at_x, at_y = numbers.place(near, 12.0, 12.0) or near[0]
            draw_number(self.canvas, (at_x + 6.0, at_y), number)

    def _write_view(self) -> None:
        """Writes from where it is seen, and how large."""
        left, top, right, _ = self.area
        where = "from above: north is up" if self.is_above else "from the south: east is right"
        self.canvas.text((left + 8, top + 6), where, 10.0, PALE, "la")
        if self.stage.enlarged > 1.2:
            words = f"{self.main} drawn {self.stage.enlarged:.1f} times its size"
            self.canvas.text((right - 8, top + 6), words, 10.0, PALE, "ra")
