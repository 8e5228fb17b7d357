"""Drawing of the scene of a flight: the bodies at several moments of their path over the ground, in depth order."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from snr_sim.recording.columns import Floats
from snr_sim.recording.records import Header
from snr_sim.recording.scene import as_mesh, points_of, rgb_of, world_from_body
from snr_sim.view.picture_bodies import FLAME, body_parts, flame_parts, strongest_of
from snr_sim.view.picture_layout import PATH, SCENE, SheetProjection, TrackView, feet_and_size
from snr_sim.view.picture_sheet import FAINT, PALE, Part, Rgb, Sheet, mixed
from snr_sim.view.picture_tracks import BodyTracks

SKY: Rgb = (9, 12, 24)  # plain: metaphor-name
FAR_M = 1e6

Cut: TypeAlias = tuple[Rgb, Floats]  # colour, and segments of shape (n, 2, 2): left and right end, x and z


def draw_scene(sheet: Sheet, header: Header, tracks: BodyTracks) -> None:
    """Draw the whole scene."""
    main = next(iter(tracks.poses))
    bodies = header.scene["bodies"]
    size_m = feet_and_size(bodies)[1]
    feet_m = lowest_m(bodies, {name: poses[0] for name, poses in tracks.poses.items()})
    feet = world_from_body(tracks.poses[main], np.array([0.0, 0.0, feet_m]))
    is_time = bool(np.ptp(feet[:, 0]) < 0.02 * np.ptp(feet[:, 2]))
    along = tracks.times_s if is_time else feet[:, 0]
    projection = SheetProjection(along, feet[:, 2], size_m, is_time)
    track_view = TrackView(projection, along, feet, size_m, math.inf)
    points_per_newton = 0.8 * track_view.size / strongest_of(tracks.vectors)
    parts = [Part(track_view.path, PATH, 1.2)]
    for i, position in track_view.strobes:
        parts += flame_parts(position, tracks.vectors[i], points_per_newton, FLAME)
    cuts = ground_cuts(header.scene.get("statics", {}))
    if is_time:  # only the ground at the landing position
        levels = [(rgb, heights(cut, np.zeros(1))[0]) for rgb, cut in cuts]
        cuts = [(rgb, np.array([[[-FAR_M, z], [FAR_M, z]]])) for rgb, z in levels]
    parts += ground_parts(cuts, projection.at, projection.columns(), projection.area[3], SKY)  # over flames, under feet
    for i, position in track_view.strobes:
        shapes = [(shape, poses[i]) for body, poses in tracks.poses.items() for shape in bodies[body]]
        parts += body_parts(position, shapes)
        x, y = track_view.path[i]
        beside = (x + 0.62 * track_view.size, y - 0.5 * track_view.size)
        sheet.text(beside, f"{tracks.times_s[i]:.0f} s", 9.5, PALE, "lm")
    projection.draw(sheet, parts, SKY)
    if track_view.enlargement > 1.5:
        words = f"{main} drawn {track_view.enlargement:.0f} times its size"
        sheet.text((SCENE[2] - 8, SCENE[1] + 8), words, 9.0, FAINT, "rt")


def lowest_m(bodies: dict[str, list[dict[str, Any]]], poses: dict[str, Any]) -> float:
    """Return the lowest point of all bodies in their poses, in the frame of the first of them [m]."""
    x, y, z, *vector, w = np.asarray(next(iter(poses.values())), float).tolist()
    back = [0.0, 0.0, 0.0, *(-one for one in vector), w]  # turns from the world's axes into the body's
    low = [
        world_from_body(back, world_from_body(poses[body], points_of(shape)) - [x, y, z])[:, 2].min()
        for body in poses
        for shape in bodies[body]
    ]
    return float(min(low))


def ground_cuts(statics: dict[str, Any]) -> list[Cut]:
    """Return the sections of the static meshes with the plane of motion, the widest first: that is the ground."""
    meshes = [shape for shape in map(as_mesh, statics.values()) if shape.get("kind") == "mesh"]
    cuts = [(rgb_of(shape), cut_by_plane(shape)) for shape in meshes]
    return sorted((cut for cut in cuts if len(cut[1])), key=lambda cut: -float(np.ptp(cut[1][..., 0])))


def cut_by_plane(shape: dict[str, Any]) -> Floats:
    """Return the segments in which triangles cut the plane y = 0, shape (n, 2, 2): west and east end, x and z."""
    corners = points_of(shape)[np.array(shape["triangles"], int).reshape(-1, 3)]
    others = np.roll(corners, -1, axis=1)
    crossed = (corners[..., 1] < 0) != (others[..., 1] < 0)  # two edges of a triangle, or none
    a, b = corners[crossed], others[crossed]
    ends = (a + (a[:, 1] / (a[:, 1] - b[:, 1]))[:, None] * (b - a))[:, [0, 2]].reshape(-1, 2, 2)
    return np.take_along_axis(ends, ends[..., :1].argsort(axis=1), axis=1)


def heights(cut: Floats, x: Floats) -> Floats:
    """Return the maximum height of segments, shape (n, 2, 2), at each x, in the shape of x; NaN where there are none.

    >>> heights(np.array([[[0.0, 0.0], [4.0, 2.0]], [[4.0, 2.0], [9.0, 2.0]]]), np.array([-1.0, 2.0, 5.0]))
    array([nan,  1.,  2.])
    """
    (x0, z0), (x1, z1) = cut.transpose(1, 2, 0)[..., None]
    fraction = (x - x0) / np.maximum(x1 - x0, 1e-12)
    found = np.where((x0 <= x) & (x <= x1), z0 + fraction * (z1 - z0), -np.inf).max(axis=0)
    return np.where(np.isfinite(found), found, np.nan)


def ground_parts(
    cuts: Sequence[Cut],
    at: Callable[[Floats, Floats], Floats],
    x: Floats,
    bottom: float,
    background: Rgb,
    width: float = 1.6,
) -> list[Part]:
    """Return the ground, filled down to the bottom, and lines for the sections of other meshes, drawn twice as wide.

    Args:
        cuts: sections of the ground, which is extended beyond its recorded part on both sides, and of other meshes.
        at: converts x and z [m] to positions on the sheet, of which `bottom` is the lowest.
        x: positions at which to evaluate the ground [m], from the left to the right edge.
        background: colour that is mixed into the ground.
    """
    parts = []
    for i, (rgb, cut) in enumerate(cuts):
        z = heights(cut, np.clip(x, cut[..., 0].min(), cut[..., 0].max()) if i == 0 else x)
        line = at(x, z)[np.isfinite(z)]
        if not len(line):
            continue
        if i == 0:
            corners = [(line[-1, 0], bottom), (line[0, 0], bottom)]
            parts.append(Part(np.concatenate([line, corners]), mixed(background, rgb, 0.55)))
        parts.append(Part(line, mixed(rgb, (255, 255, 255), 0.15), width if i == 0 else 2.0 * width))
    return parts
