"""Surroundings of an underwater vehicle: the water and its edges, gates and marks, the tether, and the current."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from snr_sim.recording.columns import Floats
from snr_sim.recording.scene import BOW, HARD_PULL_N, SLACK, TAUT, is_slack, points_of, rgb_of, world_from_body
from snr_sim.view.picture_layout import SheetPosition, SheetProjection
from snr_sim.view.picture_sheet import Part, Rgb, Sheet, mixed
from snr_sim.view.picture_tracks import NEWTONS_PER_MPS

WATER: Rgb = (12, 52, 84)
AIR: Rgb = (9, 12, 24)
DECK: Rgb = (50, 54, 62)  # colour of a pool's deck
SURFACE: Rgb = (120, 200, 232)
CURRENT: Rgb = (150, 235, 190)
CURRENT_POINTS = 140.0  # per m/s, limited to what fits into a corner
MAX_CURRENT_POINTS = 50.0
THIN_M = 0.01  # lines thinner than this are marks on the floor


def water_parts(projection: SheetProjection, statics: Mapping[str, Any], is_above: bool) -> list[Part]:
    """Return the water, on a map within the pool, from the south up to its surface; around it is the deck."""
    edge = points_of(statics["surface"])
    low, high = edge.min(axis=0), edge.max(axis=0)
    (x0, y0), (x1, y1) = projection.at(low[0], high[2]), projection.at(high[0], low[2])
    _, top, _, bottom = projection.area
    if is_above:
        marks = [
            Part(projection.at(x, z), mixed(WATER, rgb, 0.25), 0.8)
            for (x, z), rgb, is_mark in _lines(statics)
            if is_mark
        ]
        return [Part(rectangle(x0, y0, x1, y1), WATER), *marks]
    return [
        Part(rectangle(x0, top, x1, bottom), AIR),
        Part(rectangle(x0, max(y0, top), x1, bottom), WATER),
        Part(np.array([(x0, y0), (x1, y0)]), SURFACE, 1.6),
    ]


def rectangle(left: float, top: float, right: float, bottom: float) -> Floats:
    """Return the corners of a rectangle."""
    return np.array([(left, top), (right, top), (right, bottom), (left, bottom)])


def _lines(statics: Mapping[str, Any]) -> Iterator[tuple[Floats, Rgb, bool]]:
    """Yield x and z of the corners of each line, shape (2, n), its colour, and whether it is a mark on the floor."""
    for shape in statics.values():
        if shape.get("kind") == "polyline":
            yield points_of(shape)[:, [0, 2]].T, rgb_of(shape), shape.get("radius_m", 0.1) < THIN_M


def gate_parts(projection: SheetProjection, statics: Mapping[str, Any], is_above: bool) -> list[Part]:
    """Return the upright lines in the water; on a map also the level ones around it.

    From the south a level line such as the pool's edge would look like another surface.
    """
    return [
        Part(projection.at(x, z), rgb, 2.2)
        for (x, z), rgb, is_mark in _lines(statics)
        if not is_mark and (is_above or np.ptp(z) > 0.0)
    ]


def tether_part(
    projection: SheetProjection,
    position: SheetPosition,
    tether: Mapping[str, Any],
    pose: Any,
    pull_n: float,
    fraction: float,
) -> Part:
    """Return a tether of a scene from its anchor to its body: straight if taut, with a sag if slack.

    It is redder for a larger pull [N], and as opaque as the fraction, 0 to 1.
    """
    start = projection.at(tether["anchor_m"][0], tether["anchor_m"][2])
    dx, dy = span = position.at(world_from_body(pose, tether["place_m"])) - start
    bow = 0.0 if not is_slack(tether, pose) else BOW if dx <= 0.0 else -BOW  # hangs to the lower side
    along = np.linspace(0.0, 1.0, 25)[:, None]
    points = start + along * span + 4.0 * bow * along * (1.0 - along) * np.array([dy, -dx])
    color = mixed(SLACK, TAUT, min(1.0, pull_n / HARD_PULL_N))
    return Part(points, mixed(WATER, color, fraction), 1.6)


def current_parts(sheet: Sheet, projection: SheetProjection, arrow: Sequence[float] | None) -> list[Part]:
    """Return an arrow in a corner of the scene in the direction of the current, and write its speed."""
    _, _, right, bottom = projection.area
    flow = np.array([arrow[3], -arrow[5]]) / NEWTONS_PER_MPS if arrow is not None else np.zeros(2)
    speed = math.hypot(*flow)
    if speed < 0.005:
        return []
    middle, along = np.array([right - 60.0, bottom - 28.0]), flow / speed
    half = 0.5 * min(MAX_CURRENT_POINTS, CURRENT_POINTS * speed) * along
    tip, across = middle + half, np.array([along[1], -along[0]])
    sheet.text((right - 60.0, bottom - 56.0), f"current {speed:.2f} m/s", 9.0, CURRENT, "mt")
    back = tip - 7.0 * along
    return [
        Part(np.array([middle - half, tip]), CURRENT, 2.0),
        Part(np.array([tip, back + 4.0 * across, back - 4.0 * across]), CURRENT),
    ]
