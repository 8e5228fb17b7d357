"""Events of a run with their times, as text: from its true states and from pages that report states."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from snr_sim.recording.columns import BROKEN, Batch
from snr_sim.view.picture_tracks import NEWTONS_PER_MPS, BodyTracks

STATE = "control_state"  # a field with this name is the robot's state, one word
FLAGS: dict[str, str] = {"is_battery_low": "battery low"}  # flags, and the event that each reports
MAX_EVENTS = 6
SPEED_MPS = 0.02  # minimum change of a current that is reported


class RunEvent(NamedTuple):
    """An event, and its description."""

    time_s: float
    text: str


def find_run_events(tracks: BodyTracks, statics: Mapping[str, Any], batch: Batch) -> list[RunEvent]:
    """Return the events in order of time, at most `MAX_EVENTS`."""
    gates = [shape for shape in statics.values() if is_gate(shape)]
    by_plant = [*_in_truth(tracks), *_of_current(tracks), *_through(gates, tracks)]
    found = [*by_plant, *_of_links(batch), *_of_flags(batch), *_of_states(batch)]
    return sorted(found, key=lambda event: event.time_s)[:MAX_EVENTS]  # of simultaneous ones, the cause first


def broken(values: dict[str, float]) -> list[str]:
    """Return the names of broken parts, from the true numbers of a moment."""
    return [name.removeprefix(BROKEN) for name, value in values.items() if name.startswith(BROKEN) and value]


def is_gate(shape: Mapping[str, Any]) -> bool:
    """Return whether a shape of the scene is a gate: it has four corners and is labelled as a gate."""
    return "gate" in shape.get("label", "") and len(shape.get("points_m", ())) >= 4


def _through(gates: Sequence[Mapping[str, Any]], tracks: BodyTracks) -> Iterator[RunEvent]:
    """Yield the moments at which the first body passes a gate, from either side."""
    positions = next(iter(tracks.poses.values()))[:, :3]
    for gate in gates:
        a, b, c = (np.array(corner) for corner in gate["points_m"][:3])
        up, across = a - b, c - b
        from_middle = positions - 0.5 * (a + c)
        side = from_middle @ np.cross(up, across)
        inside = np.all([2.0 * abs(from_middle @ edge) <= edge @ edge for edge in (up, across)], axis=0)
        for i in np.flatnonzero((side[:-1] < 0.0) != (side[1:] < 0.0)):
            if inside[i]:
                yield RunEvent(float(tracks.times_s[i + 1]), f"through {gate['label']}")


def _in_truth(tracks: BodyTracks) -> Iterator[RunEvent]:
    before = tracks.values[0]
    for time_s, values in zip(tracks.times_s, tracks.values, strict=True):
        if values.get("load_kg", 0.0) != before.get("load_kg", 0.0):
            is_gone = values["load_kg"] < before["load_kg"]
            change_kg = abs(values["load_kg"] - before["load_kg"])
            yield RunEvent(float(time_s), f"payload of {change_kg:.1f} kg {'released' if is_gone else 'taken up'}")
        if values.get("water_l", 0.0) > 0.0 and not before.get("water_l", 0.0):
            yield RunEvent(float(time_s), "water comes in")
        failed = [name for name in broken(values) if name not in broken(before)]
        yield from (RunEvent(float(time_s), f"{name} fails") for name in failed)
        before = values


def _of_current(tracks: BodyTracks) -> Iterator[RunEvent]:
    before = tracks.vectors[0].get("current", [0.0] * 6)
    for time_s, vectors in zip(tracks.times_s, tracks.vectors, strict=True):
        now = vectors.get("current", [0.0] * 6)
        if math.dist(now[3:], before[3:]) > SPEED_MPS * NEWTONS_PER_MPS:
            yield RunEvent(float(time_s), f"current: {math.hypot(*now[3:]) / NEWTONS_PER_MPS:.2f} m/s")
            before = now


def _of_links(batch: Batch) -> Iterator[RunEvent]:
    seen: set[tuple[bool, int]] = set()
    for _, series in batch.page_values():
        if series.path[0].startswith("link_") and series.path[1:] == ("up",):
            was_lost = False  # the first connection is not an event
            for time_s, is_up in _changes(series.when.t_s.tolist(), series.values.tolist()):
                was_lost = was_lost or not is_up
                if was_lost and (bool(is_up), round(time_s)) not in seen:  # both ends report it; one report is enough
                    seen.add((bool(is_up), round(time_s)))
                    yield RunEvent(time_s, "link is back" if is_up else "link is lost")


def _of_states(batch: Batch) -> Iterator[RunEvent]:
    for times_s, words in batch.page_texts(STATE):
        yield from (RunEvent(time_s, f"'{now}' {STATE.replace('_', ' ')}") for time_s, now in _changes(times_s, words))


def _of_flags(batch: Batch) -> Iterator[RunEvent]:
    for node, series in batch.page_values():
        key, *path = series.path
        if path and path[-1] in FLAGS and not batch.is_copy(node, key):
            for time_s, is_so in _changes(series.when.t_s.tolist(), series.values.tolist()):
                if is_so:
                    yield RunEvent(time_s, FLAGS[path[-1]])


def _changes(times_s: Sequence[float], values: Sequence[Any]) -> Iterator[tuple[float, Any]]:
    """Yield the time of each change of a value, and the new value."""
    for (_, before), (time_s, now) in pairwise(zip(times_s, values, strict=True)):
        if now != before:
            yield time_s, now
