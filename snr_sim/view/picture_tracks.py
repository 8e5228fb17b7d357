"""Data of a picture: the paths of the bodies, their touchdown, and the best direction of view."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from snr_sim.prelude.errors import TraceError
from snr_sim.recording.columns import Batch, Floats
from snr_sim.recording.records import Header, TruthRecord

NEWTONS_PER_MPS = 40.0  # length of a plant's arrow "current" for 1 m/s
TURN_RAD, FLAT, FLAT_M = math.radians(45.0), 4.0, 0.05  # see `wants_map`
LEVEL_M = 0.1  # ground that rises by less is best seen from above


@dataclass(frozen=True)
class BodyTracks:
    """Paths of the bodies."""

    times_s: Floats  # shape (n,)
    poses: dict[str, Floats]  # of each body, shape (n, 7)
    vectors: list[dict[str, list[float]]]  # arrows at each time
    values: list[dict[str, float]]  # the true numbers at each time, by name
    touchdown_s: float | None  # when it first touched the ground, if it did


def is_in_water(header: Header) -> bool:
    """Return whether the scene has a line named 'surface', for still water at z = 0."""
    return "surface" in header.scene.get("statics", {})


def is_planar(header: Header) -> bool:
    """Return whether the plant moves only in the x-z plane: then a view from above and a heading are useless."""
    return bool(header.scene.get("is_planar"))


def wants_map(poses: Floats) -> bool:
    """Return whether a path is much wider than high, or turns and extends farther to the north than in height."""
    spread_x, spread_y, spread_z = np.ptp(poses[:, :3], axis=0)
    if max(spread_x, spread_y) > FLAT * max(spread_z, FLAT_M):
        return True
    x, y, z, w = poses[:, 3:].T
    heading = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    return bool(np.ptp(heading) > TURN_RAD and spread_y > spread_z)


def is_on_floor(header: Header) -> bool:
    """Return whether the scene has a shape named 'floor', for a level one."""
    return "floor" in header.scene.get("statics", {})


def is_drive(header: Header, poses: Floats) -> bool:
    """Return whether a vehicle drives about: on a floor, or on ground and farther to the north than up."""
    _, spread_y, spread_z = np.ptp(poses[:, :3], axis=0)
    return is_on_floor(header) or ("ground" in header.scene.get("statics", {}) and spread_z < max(spread_y, LEVEL_M))


def from_above(scene: dict[str, Any], tracks: BodyTracks) -> tuple[dict[str, Any], BodyTracks]:
    """Return a scene in water and its bodies' paths, rotated for a map; meshes are left out."""
    lines = {name: shape for name, shape in scene["statics"].items() if shape.get("kind") == "polyline"}
    statics = {name: shape_from_above(shape) for name, shape in lines.items()}
    tethers = scene.get("tethers", {}).items()
    anchored = {name: {**tether, "anchor_m": _laid(tether["anchor_m"])[0]} for name, tether in tethers}
    return {**scene, "statics": statics, "tethers": anchored}, seen_from_above(tracks)


def seen_from_above(tracks: BodyTracks) -> BodyTracks:
    """Return paths in the world rotated for a map: north is up, up is towards the viewer."""

    def laid_poses(rows: Floats) -> Floats:
        x, y, z, w = rows[:, 3:].T
        turned = math.sqrt(0.5) * np.stack([x + w, y - z, z + y, w - x], axis=1)  # a quarter turn about x
        return np.concatenate([_laid(rows[:, :3]), turned], axis=1)

    return replace(
        tracks,
        poses={body: laid_poses(rows) for body, rows in tracks.poses.items()},
        vectors=[{name: _laid(arrow).ravel().tolist() for name, arrow in one.items()} for one in tracks.vectors],
    )


def shape_from_above(shape: dict[str, Any]) -> dict[str, Any]:
    """Return a static shape in the world rotated for a map."""
    turned: dict[str, Any] = {key: _laid(shape[key]) for key in ("points_m", "vertices_m") if key in shape}
    if shape.get("kind") == "box":
        turned = {"center_m": _laid(shape["center_m"])[0], "half_size_m": np.abs(_laid(shape["half_size_m"])[0])}
    return {**shape, **turned}


def _laid(points: Any) -> Floats:
    return np.asarray(points, float).reshape(-1, 3)[:, [0, 2, 1]] * (1.0, -1.0, 1.0)


def body_tracks_of(header: Header, batch: Batch) -> BodyTracks:
    """Return the paths of the bodies that are in all true states; raise TraceError if there is no such body."""
    truths: list[TruthRecord] = batch.truths
    bodies = [
        body for body in header.scene.get("bodies", {}) if truths and all(body in truth.poses for truth in truths)
    ]
    if not bodies:
        raise TraceError(
            "This trace has no true states of a body, so there is nothing to draw.",
            fix="draw a simulated run; what a real robot believed is in 'snr view'.",
        )
    return BodyTracks(
        times_s=np.array([truth.t for truth in truths]),
        poses={body: np.array([truth.poses[body] for truth in truths], float) for body in bodies},
        vectors=[truth.vectors for truth in truths],
        values=[truth.values for truth in truths],
        touchdown_s=_touchdown_s(batch),
    )


def _touchdown_s(batch: Batch) -> float | None:
    """Return the time of the first page with 'contact', or, without such a page, of the first zero altitude."""
    for _, series in batch.page_values():
        if "contact" in series.path and series.values.any():
            return float(series.when.t_s[np.argmax(series.values > 0)])
    for series in batch.truth_values():
        if series.path == ("altitude_m",) and (series.values <= 0.01).any():
            return float(series.when.t_s[np.argmax(series.values <= 0.01)])
    return None
