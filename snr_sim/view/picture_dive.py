"""Drawing of the scene of a dive, from above and from the south; the view with more motion is larger.

Numbers in circles mark the positions of events, which are described below the scene.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from snr_sim.recording.columns import Floats
from snr_sim.recording.records import Header
from snr_sim.recording.scene import is_slack, points_of
from snr_sim.view.picture_bodies import JET, body_parts, flame_parts, strongest_of
from snr_sim.view.picture_layout import (
    PATH,
    SCENE,
    Labels,
    SheetPosition,
    SheetProjection,
    TrackView,
    feet_and_size,
    spread,
)
from snr_sim.view.picture_plots import draw_number
from snr_sim.view.picture_scene import ground_cuts, ground_parts
from snr_sim.view.picture_sheet import EVENT, PALE, Area, Part, Rgb, Sheet
from snr_sim.view.picture_tracks import BodyTracks, from_above, is_planar, wants_map
from snr_sim.view.picture_water import AIR, DECK, current_parts, gate_parts, tether_part, water_parts
from snr_sim.view.run_events import RunEvent, broken, is_gate

BROKEN: Rgb = (255, 60, 60)
LOAD: Rgb = (196, 150, 90)
SURFACE_SHOWN_M = 4.0  # the surface is shown if the path comes this near to it
NEAR_M = 5.0  # gates and the tether's anchor are shown if they are this near to the path
MAX_ENLARGEMENT = 2.0  # maximum; a larger body would not fit through its gates
MAIN_FRACTION = 0.62  # of the height, for the larger view
AIR_FRACTION = 0.16  # of the height, over the surface
BETWEEN = 24.0  # points between the two views
ROW, COLUMNS = 14.0, 3  # of the texts below


def draw_dive(sheet: Sheet, header: Header, tracks: BodyTracks, events: Sequence[RunEvent]) -> None:
    """Draw both views, or only the one from the south for planar motion, and the descriptions of events."""
    left, top, right, bottom = SCENE
    bottom -= ROW * math.ceil(len(events) / COLUMNS)
    poses = next(iter(tracks.poses.values()))
    main_is_map = wants_map(poses) or any(map(is_gate, header.scene["statics"].values()))
    high = (MAIN_FRACTION if main_is_map else 1.0 - MAIN_FRACTION) * (bottom - top - BETWEEN)
    views = [(True, (left, top, right, top + high)), (False, (left, top + high + BETWEEN, right, bottom))]
    if is_planar(header):
        views = [(False, (left, top, right, bottom))]
    for is_above, area in views:
        is_main = len(views) == 1 or is_above == main_is_map
        _View(sheet, area, header.scene, tracks, is_above).draw(events, is_main)
    for i, event in enumerate(events):
        x, y = left + (right - left) * (i % COLUMNS) / COLUMNS, bottom + 26.0 + ROW * (i // COLUMNS)
        draw_number(sheet, (x + 5.0, y), i + 1)
        sheet.text((x + 14.0, y), f"{event.time_s:.1f} s  {event.text}", 9.0, PALE, "lm")


class _View:
    """A dive, drawn in an area of the sheet: from above, or from the south."""

    def __init__(self, sheet: Sheet, area: Area, scene: dict[str, Any], tracks: BodyTracks, is_above: bool) -> None:
        self.sheet, self.area, self.is_above = sheet, area, is_above
        if is_above:
            scene, tracks = from_above(scene, tracks)
        self.tracks, self.bodies, self.statics = tracks, scene["bodies"], scene["statics"]
        self.tethers: dict[str, dict[str, Any]] = scene.get("tethers", {})
        self.main = next(iter(tracks.poses))
        feet = tracks.poses[self.main][:, :3]  # an underwater body has no legs
        seen = np.concatenate([feet, *self._near(feet)])
        if not is_above and feet[:, 2].max() > -SURFACE_SHOWN_M:
            seen = np.concatenate([seen, [[feet[0, 0], feet[0, 1], 0.0]]])
        size_m = feet_and_size(self.bodies)[1]
        self.projection = SheetProjection(seen[:, 0], seen[:, 2], size_m, False, area)
        if is_above:
            self.projection.center(seen[:, 2])
        else:
            low_z, high_z = self.projection.z_range()  # all free space is for the water
            self.projection.low_z -= max(0.0, high_z - max(AIR_FRACTION * (high_z - low_z), seen[:, 2].max() + size_m))
        self.track_view = TrackView(self.projection, feet[:, 0], feet, size_m, MAX_ENLARGEMENT)

    def _near(self, path: Floats) -> list[Floats]:
        """Return the corners of gates and the anchors of tethers that are near enough to be shown."""
        low, high = path.min(axis=0), path.max(axis=0)
        held = [np.array([tether["anchor_m"]]) for tether in self.tethers.values()]
        near = [one for one in held if np.all(one > low - NEAR_M) and np.all(one < high + NEAR_M)]
        return near + [points_of(shape) for shape in self.statics.values() if is_gate(shape)]

    def draw(self, events: Sequence[RunEvent], is_main: bool) -> None:
        """Draw everything, from the background to the texts."""
        projection, track_view, tracks = self.projection, self.track_view, self.tracks
        parts = water_parts(projection, self.statics, self.is_above)
        if not self.is_above:
            cuts = ground_cuts(self.statics)
            parts += ground_parts(cuts, projection.at, projection.columns(), self.area[3], AIR)
        tethers = [self._tether_parts(i, position) for i, position in track_view.strobes]
        parts += [part for one in tethers for part in one]
        points_per_newton = 0.8 * track_view.size / strongest_of(tracks.vectors)
        jets: list[Part] = []
        for i, position in track_view.strobes:
            jets += flame_parts(position, tracks.vectors[i], points_per_newton, JET)
            jets += self._load_parts(i, position)
        parts += jets
        for i, position in track_view.strobes:
            shapes = [(shape, poses[i]) for body, poses in tracks.poses.items() for shape in self.bodies[body]]
            parts += [*body_parts(position, shapes), *self._broken_parts(i, position)]
        gates = gate_parts(projection, self.statics, self.is_above)
        parts += [*gates, Part(track_view.path, PATH, 1.2)]
        if is_main:
            parts += current_parts(self.sheet, projection, tracks.vectors[-1].get("current"))
        projection.draw(self.sheet, parts, DECK)
        self._write_labels(tethers[-1] if is_main else None, jets, gates)
        self._write_events(events)
        left, top, right, _ = self.area
        where = "from above: north is up" if self.is_above else "from the south: east is right"
        self.sheet.text((left + 8, top + 6), where, 9.0, PALE)
        if track_view.enlargement > 1.2:
            words = f"{self.main} drawn {track_view.enlargement:.1f} times its size"
            self.sheet.text((right - 8, top + 6), words, 9.0, PALE, "rt")

    def _tether_parts(self, i: int, position: SheetPosition) -> list[Part]:
        """Return the tethers at a moment, faint except at the last."""
        fraction, parts = 1.0 if i == self.track_view.strobes[-1][0] else 0.25, []
        for name, tether in self.tethers.items():
            pose = self.tracks.poses[tether["body"]][i]
            parts.append(tether_part(self.projection, position, tether, pose, self._pull_n(name, i), fraction))
        return parts

    def _pull_n(self, tether: str, i: int) -> float:
        return math.hypot(*self.tracks.vectors[i].get(tether, [0.0] * 6)[3:])

    def _load_parts(self, i: int, position: SheetPosition) -> list[Part]:
        """Return the vehicle's load as a box under it; on a map it is hidden."""
        if self.is_above or not self.tracks.values[i].get("load_kg"):
            return []
        size, at = self.track_view.size, position.feet_on_sheet
        box = np.array([(-0.14, 0.26), (0.14, 0.26), (0.14, 0.456), (-0.14, 0.456)])
        return [Part(at + size * np.array([(0.0, 0.0), (0.0, 0.26)]), LOAD, 1.2), Part(at + size * box, LOAD)]

    def _broken_parts(self, i: int, position: SheetPosition) -> list[Part]:
        """Return crosses over broken thrusters."""
        vectors, r = self.tracks.vectors[i], max(4.0, 0.10 * self.track_view.size)
        positions = [
            position.at(np.array(vectors[name][:3])) for name in broken(self.tracks.values[i]) if name in vectors
        ]
        strokes = r * np.array([[(-1, -1), (1, 1)], [(-1, 1), (1, -1)]])
        return [Part(at + stroke, BROKEN, 2.4) for at in positions for stroke in strokes]

    def _write_labels(self, tethers: list[Part] | None, jets: list[Part], gates: list[Part]) -> None:
        """Write the times at the bodies and, in the larger view, the names of tethers and gates, where they fit."""
        track_view, (left, top, right, bottom) = self.track_view, self.area
        bodies = [position.feet_on_sheet for _, position in track_view.strobes]
        labels = Labels(bodies, 0.42 * track_view.size, (left, top + 18, right, bottom))
        for part in jets:
            labels.keep_free(part.points, 3.0)
        for part in gates:
            labels.keep_free(spread(part.points), 2.0)
        if not self.is_above:  # a line through a text makes both hard to see
            level = self.projection.at(0.0, 0.0)[1]
            labels.keep_free(spread(np.array([(left, level), (right, level)])), 2.0)
        r = 0.55 * track_view.size
        for i, position in track_view.strobes:
            x, y = position.feet_on_sheet
            beside = [(x + r, y - r, 0.0), (x - r, y - r, 1.0), (x + r, y + r, 0.0), (x - r, y + r, 1.0)]
            over = [(x, y + side * far * r, 0.5) for far in (1.3, 2.0) for side in (-1.0, 1.0)]
            labels.write(self.sheet, f"{self.tracks.times_s[i]:.0f} s", 9.5, PALE, [*beside, *over])
        if tethers is not None:
            self._write_names(labels, tethers)

    def _write_names(self, labels: Labels, tethers: list[Part]) -> None:
        left, top, right, bottom = self.area
        named: list[tuple[Floats, str, Rgb]] = []
        for (name, tether), part in zip(self.tethers.items(), tethers, strict=True):
            x, y = np.asarray(part.points).T
            seen = part.points[(x >= left) & (x <= right) & (y >= top) & (y <= bottom)]
            is_loose = is_slack(tether, self.tracks.poses[tether["body"]][-1])
            words = f"{name}: {'slack' if is_loose else 'taut'}, pulls {self._pull_n(name, -1):.1f} N"
            named.append((seen[len(seen) // 2] if len(seen) else part.points[-1], words, EVENT))
            labels.keep_free(seen, 2.0)
        named.extend(
            (self.projection.at(*points_of(shape)[:, [0, 2]].max(axis=0)), shape["label"], PALE)
            for shape in self.statics.values()
            if is_gate(shape)
        )
        for (x, y), words, rgb in named:
            beside = [(x + dx, y + dy, float(dx < 0)) for dy in (-8, 8, -22, 22, -36, 36) for dx in (8.0, -8.0)]
            labels.write(self.sheet, words, 9.0, rgb, [*beside, (x, y + 12.0, 0.5), (x, y - 12.0, 0.5)])

    def _write_events(self, events: Sequence[RunEvent]) -> None:
        """Write the numbers of events at their positions, in a row if several share one position."""
        numbers = Labels([], 0.0, self.area)
        for number, event in enumerate(events, 1):
            x, y = self.track_view.path[int(np.searchsorted(self.tracks.times_s[:-1], event.time_s))]
            near = [(x + dx - 6.0, y + dy) for dy in (0, -12, 12, -24, 24) for dx in (0, 12, -12, 24, -24, 36, -36)]
            at_x, at_y = numbers.find_free(near, 12.0, 12.0) or near[0]
            draw_number(self.sheet, (at_x + 6.0, at_y), number)
