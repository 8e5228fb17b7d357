"""The world of a run in the viewer: static objects, bodies, forces, tethers, and paths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from snr_sim.recording.columns import BROKEN, Batch, When
from snr_sim.recording.records import TruthRecord
from snr_sim.recording.scene import (
    HARD_PULL_N,
    SLACK,
    TAUT,
    TETHER_LINE,
    Path,
    Points,
    as_mesh,
    meshes_with_normals,
    points_of,
    rgb_of,
    size_of,
    tether_frames,
)
from snr_sim.view.view_blueprint import Layout
from snr_sim.view.view_sender import Sender, pack_colors

FOLLOWER = "follower"  # entity that the close-up camera follows; not the robot's own camera
THRUST_RGB = (255, 140, 30)
FLOW_RGB = (110, 225, 150)
PATH_RGB = (120, 200, 255)
SHEET_RGBA = (90, 170, 225, 70)  # of a surface of water
LABEL_RISE = 0.5  # height of a label above an object, as a fraction of the object's longest edge
FLOW = "current"  # the arrow with this name is a velocity, not a force


class SceneSender:
    """Sender of the world of one run, of whose header `scene` is; `layout` receives what the world contains."""

    def __init__(self, sender: Sender, scene: dict[str, Any], layout: Layout) -> None:
        self._sender, self._layout = sender, layout
        self._known: set[tuple[str, str]] = set()
        self._main_body = ""
        self._path = Path()
        self._longest = {False: 0.0, True: 0.0}  # of all arrows, without and with those of flow
        self._scaled_for: tuple[float, float, int] = (0.0, 0.0, 0)
        self._tethers: dict[str, dict[str, Any]] = scene.get("tethers", {})
        self._send_scene(scene.get("statics", {}), scene.get("bodies", {}))

    def send(self, batch: Batch) -> None:
        """Send the motion of everything in a batch."""
        arrows = {name: (when, values) for name, when, values in batch.vectors()}
        for body, when, poses in batch.poses():
            self._send_poses(body, when, poses)
            for name, tether in self._tethers.items():
                if tether["body"] == body:
                    self._send_tether(name, tether, when, poses, arrows.get(name))
        for name, (when, values) in arrows.items():
            if name not in self._tethers:
                self._send_arrows(name, when, values)
        self._scale_arrows()
        self._send_broken(batch.truths)
        self._send_path()

    def _send_scene(self, statics: dict[str, Any], bodies: dict[str, Any]) -> None:
        self._sender.log("/", self._sender.rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        for name, shape in statics.items():
            self._send_shapes(self._sender.entity("world", name), [shape])
            if "label" in shape:
                self._send_label(name, shape)
        for name, shapes in bodies.items():
            self._send_shapes(self._sender.entity("world", name, "shapes"), shapes)
        self._layout.body_size_m = max([size_of(shapes) for shapes in bodies.values()], default=1.0)
        self._layout.is_in_water = "surface" in statics

    def _send_label(self, name: str, shape: dict[str, Any]) -> None:
        """Send an object's label above it; the water surface is drawn as a sheet with its label at a corner."""
        rr, points, is_surface = self._sender.rr, points_of(shape), name == "surface"
        if is_surface:
            at = points[np.lexsort(points.T)[-1]]
        else:  # the viewer writes down from there
            low, high = points.min(axis=0), points.max(axis=0)
            at = np.array([*(low + high)[:2] / 2, high[2] + LABEL_RISE * size_of([shape])])
        look = {"radii": rr.Radius.ui_points(0.5), "colors": [rgb_of(shape)]}
        label = rr.Points3D([at], **look, labels=[shape["label"]], show_labels=True)
        self._sender.log(self._sender.entity("world", name, "label"), label)
        if is_surface:
            triangles = [[0, 1, 2], [0, 2, 3]]
            sheet = rr.Mesh3D(vertex_positions=points[:4], triangle_indices=triangles, albedo_factor=SHEET_RGBA)
            self._sender.log(self._sender.entity("world", name, "sheet"), sheet)
        else:
            self._layout.landmarks.extend(points.tolist())

    def _send_shapes(self, entity: str, shapes: Sequence[dict[str, Any]]) -> None:
        """Send shapes that move together, grouped by kind: each call costs a quarter of a millisecond.

        A kind of a later version is skipped; the rest is still useful.
        """
        rr, shapes = self._sender.rr, [as_mesh(shape) for shape in shapes]
        kinds = {kind: [shape for shape in shapes if shape.get("kind") == kind] for kind in ("box", "polyline", "mesh")}
        if boxes := kinds["box"]:
            sizes, centers = [box["half_size_m"] for box in boxes], [box["center_m"] for box in boxes]
            colors = pack_colors([rgb_of(box) for box in boxes])
            solid = rr.Boxes3D(half_sizes=sizes, centers=centers, colors=colors, fill_mode="solid")
            self._sender.log(entity, solid)
        if lines := kinds["polyline"]:
            radii, colors = [line.get("radius_m", 0.1) for line in lines], pack_colors([rgb_of(line) for line in lines])
            strips = rr.LineStrips3D([points_of(line).astype(np.float32) for line in lines], radii=radii, colors=colors)
            self._sender.log(entity, strips)
        if meshes := kinds["mesh"]:
            vertices, normals = (corners.astype(np.float32) for corners in meshes_with_normals(meshes))
            counts = [3 * len(mesh["triangles"]) for mesh in meshes]
            colors = np.repeat(pack_colors([rgb_of(mesh) for mesh in meshes]), counts)
            mesh = rr.Mesh3D(vertex_positions=vertices, vertex_normals=normals, vertex_colors=colors)
            self._sender.log(entity, mesh)

    def _send_poses(self, body: str, when: When, poses: Any) -> None:
        entity, positions = self._sender.entity("world", body), poses[:, :3]
        if not self._main_body:  # others, such as legs, move with it
            self._follow(body, entity, positions)
        transform = self._sender.rr.Transform3D
        self._sender.send(entity, when, transform.columns(translation=positions, quaternion=poses[:, 3:]))
        self._sender.send_numbers(self._sender.entity("truth", "poses", body), when, poses.ravel(), per_row=7)
        if body == self._main_body:
            # Moves without rotating: in this view the body stays in the middle and the ground stays level.
            self._sender.send(self._sender.entity("world", FOLLOWER), when, transform.columns(translation=positions))
            self._path.extend(positions)
            self._layout.low_m = np.minimum(self._layout.low_m, positions.min(axis=0)).tolist()
            self._layout.high_m = np.maximum(self._layout.high_m, positions.max(axis=0)).tolist()

    def _follow(self, body: str, entity: str, positions: Any) -> None:
        """Let the camera follow the first body."""
        self._main_body = body
        if not self._layout.bodies:
            self._layout.low_m = self._layout.high_m = positions[0].tolist()
        self._layout.bodies.append(entity)
        self._layout.cameras.append(self._sender.entity("world", FOLLOWER))
        rr = self._sender.rr
        marker = rr.Points3D([[0, 0, 0]], radii=rr.Radius.ui_points(5.0), colors=THRUST_RGB)
        self._sender.log(self._sender.entity("world", body, "marker"), marker)

    def _send_tether(
        self, name: str, tether: dict[str, Any], when: When, poses: Points, pull: tuple[When, Points] | None
    ) -> None:
        """Send a static line, and for each moment its transform and its colour, redder for a larger force."""
        rr, entity = self._sender.rr, self._sender.entity("world", name)
        if ("tether", name) not in self._known:
            self._known.add(("tether", name))
            self._sender.log(entity, rr.LineStrips3D([TETHER_LINE.astype(np.float32)], radii=rr.Radius.ui_points(1.5)))
        frames = tether_frames(tether, poses).astype(np.float32)
        anchors = np.tile(np.array(tether["anchor_m"], np.float32), (len(poses), 1))
        self._sender.send(entity, when, rr.Transform3D.columns(translation=anchors, mat3x3=frames))
        pulls = np.zeros(len(poses))
        if pull is not None:
            pulls = np.interp(when.t_s, pull[0].t_s, np.linalg.norm(pull[1][:, 3:], axis=1))
        fraction = np.minimum(1.0, pulls / HARD_PULL_N)[:, None]
        rgb = np.array(SLACK) + fraction * (np.array(TAUT) - np.array(SLACK))
        self._sender.send(entity, when, rr.LineStrips3D.columns(colors=pack_colors(rgb)))

    def _send_arrows(self, name: str, when: When, arrows: Any) -> None:
        """Send a force, or the current, as an arrow whose tip is at the point where it acts."""
        is_flow = name == FLOW
        entity, rr = self._sender.entity("world", "arrows", name), self._sender.rr
        newtons, vectors = f"{entity}/newtons", arrows[:, 3:]
        lengths = np.linalg.norm(vectors, axis=1)
        if ("arrows", name) not in self._known:
            self._known.add(("arrows", name))
            look: dict[str, Any] = {"colors": FLOW_RGB, "labels": [name], "show_labels": True} if is_flow else {}
            style = rr.Arrows3D.from_fields(**{"radii": rr.Radius.ui_points(3.0), "colors": THRUST_RGB, **look})
            self._sender.log(newtons, style)
        self._longest[is_flow] = max(self._longest[is_flow], float(lengths.max()))
        pushes = lengths > 0  # a zero force is not drawn, not even as a dot
        self._sender.send(entity, when, rr.Transform3D.columns(translation=arrows[:, :3]))
        # The tip, not the tail, is where the force acts. Drawn upwards from the nozzle, the hull would hide it.
        tips = rr.Arrows3D.columns(vectors=vectors[pushes], origins=-vectors[pushes]).partition(pushes)
        self._sender.send(newtons, when, tips)

    def _send_broken(self, truths: Sequence[TruthRecord]) -> None:
        """Mark broken thrusters at the points where their forces act."""
        for name in truths[-1].values if truths else ():
            thruster = name.removeprefix(BROKEN)
            if thruster == name or thruster not in truths[-1].vectors:
                continue
            rr, entity = self._sender.rr, self._sender.entity("world", "broken", thruster)
            if ("broken", name) not in self._known:
                self._known.add(("broken", name))
                look = {"radii": rr.Radius.ui_points(7.0), "colors": TAUT}
                style = rr.Points3D.from_fields(**look, labels=[f"{thruster} is broken"], show_labels=True)
                self._sender.log(entity, style)
            is_broken = [bool(truth.values.get(name)) for truth in truths]
            spots = [truth.vectors[thruster][:3] for truth, is_so in zip(truths, is_broken, strict=True) if is_so]
            marks = rr.Points3D.columns(positions=np.reshape(spots, (-1, 3)))
            self._sender.send(entity, When.of(truths), marks.partition(is_broken))

    def _scale_arrows(self) -> None:
        """Send the scale from newtons to metres: static, so the data stay in newtons and a live run can adapt it."""
        names = [name for kind, name in self._known if kind == "arrows"]
        scaled_for = (self._longest[False], self._longest[True], len(names))
        if not names or self._scaled_for == scaled_for:
            return
        self._scaled_for = scaled_for
        for name in names:
            scale = self._layout.body_size_m / (self._longest[name == FLOW] or 1.0)
            entity = self._sender.entity("world", "arrows", name, "newtons")
            self._sender.log(entity, self._sender.rr.Transform3D(scale=scale))

    def _send_path(self) -> None:
        """Send the whole path again when it has grown; it is static, so it is visible at any time."""
        rr = self._sender.rr
        if self._main_body:
            line = rr.LineStrips3D([self._path.points()], radii=rr.Radius.ui_points(1.0), colors=PATH_RGB)
            self._sender.log(self._sender.entity("world", "path", self._main_body), line)
