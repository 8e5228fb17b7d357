"""Drawing of a drive, from above: north is up. The vehicle at several moments of its path, with what moves with it.

Everything else is drawn as it is at the end. What is upright has no area from above: its edges are drawn.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from snr_sim.recording.columns import Floats
from snr_sim.recording.records import Header
from snr_sim.recording.scene import as_mesh, points_of, rgb_of, world_from_body
from snr_sim.view.picture_bodies import body_parts, faces_of
from snr_sim.view.picture_layout import PATH, SCENE, Labels, SheetPosition, SheetProjection, TrackView
from snr_sim.view.picture_sheet import PALE, Part, Rgb, Sheet, mixed
from snr_sim.view.picture_tracks import BodyTracks, seen_from_above, shape_from_above

OUTSIDE: Rgb = (9, 12, 24)
DIMMED = 0.4  # share of the color of what does not move, so that paths and bodies stand out
EDGE_WIDTH = 1.6
AT_ORIGIN = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def draw_drive(sheet: Sheet, header: Header, tracks: BodyTracks) -> None:
    """Draw floor or ground, what stands on it, and the path of the first body."""
    tracks = seen_from_above(tracks)
    main = next(iter(tracks.poses))
    bodies = header.scene["bodies"]
    shapes = {name: shape_from_above(as_mesh(one)) for name, one in header.scene.get("statics", {}).items()}
    statics = list(shapes.values())
    path = tracks.poses[main][:, :3]
    size_m = float(np.ptp(np.concatenate([points_of(shape) for shape in bodies[main]])[:, :2], axis=0).max())
    away_m = {name: np.hypot(*(poses[:, :3] - path)[:, [0, 2]].T).max() for name, poses in tracks.poses.items()}
    carried = [name for name in tracks.poses if away_m[name] < size_m]
    seen = np.concatenate(
        [
            *_around(path, size_m),
            *(end for name in carried for end in _around(tracks.poses[name][:, :3], _reach_m(bodies[name]))),
            *(points_of(shape) for name, shape in shapes.items() if name != "ground"),
        ]
    )
    projection = SheetProjection(seen[:, 0], seen[:, 2], size_m, False)
    projection.fit(seen[:, 0], seen[:, 2])
    track_view = TrackView(projection, path[:, 0], path, size_m, 1.0)
    world = SheetPosition(projection.at(0.0, 0.0), np.zeros(3), projection.z_scale)
    dim = [{**shape, "rgb": mixed(OUTSIDE, rgb_of(shape), DIMMED)} for shape in statics]
    parts = body_parts(world, [(shape, AT_ORIGIN) for shape in dim])
    parts += [part for shape in statics for part in _edges(world, shape, AT_ORIGIN)]
    others = [(shape, tracks.poses[name][-1]) for name in away_m if name not in carried for shape in bodies[name]]
    parts += body_parts(world, others)
    parts += [part for shape, pose in others for part in _edges(world, shape, pose)]
    parts.append(Part(track_view.path, PATH, 1.2))
    for i, position in track_view.strobes:
        parts += body_parts(position, [(shape, tracks.poses[name][i]) for name in carried for shape in bodies[name]])
    projection.draw(sheet, parts, OUTSIDE)
    labels = Labels([position.feet_on_sheet for _, position in track_view.strobes], 0.42 * track_view.size, SCENE)
    r = 0.6 * track_view.size
    for i, position in track_view.strobes:
        x, y = position.feet_on_sheet
        around = [(x + r, y, 0.0), (x - r, y, 1.0), (x, y - r, 0.5), (x, y + r, 0.5)]
        around += [(x + r, y + r, 0.0), (x - r, y - r, 1.0), (x + r, y - r, 0.0), (x - r, y + r, 1.0)]
        labels.write(sheet, f"{tracks.times_s[i]:.0f} s", 9.5, PALE, around)


def _around(places: Floats, radius_m: float) -> tuple[Floats, Floats]:
    """Return the corners of squares around places, seen from above."""
    room_m = np.array([radius_m, 0.0, radius_m])
    return places - room_m, places + room_m


def _reach_m(shapes: list[dict[str, Any]]) -> float:
    """Return how far shapes reach from the origin of their body, seen from above."""
    points = np.concatenate([points_of(shape) for shape in shapes])
    return float(np.hypot(points[:, 0], points[:, 1]).max())


def _edges(position: SheetPosition, shape: dict[str, Any], pose: Any) -> list[Part]:
    """Return lines where the faces of a mesh are upright; `body_parts` leaves them out."""
    if shape.get("kind") != "mesh":
        return []
    faces = world_from_body(pose, faces_of(shape))
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    is_upright = np.abs(normals[:, 1]) < 1e-9 * np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    corners: Floats = position.at(faces[is_upright])
    return [Part(points, rgb_of(shape), EDGE_WIDTH) for points in corners]
