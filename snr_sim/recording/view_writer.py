"""Puts columns into a rerun stream: which entity each goes to, and what it looks like there. See `view.py`.

Nothing goes in a row at a time: through rerun's own classes, one page costs as much as five hundred rows of a column.
"""

from __future__ import annotations

import gc
import importlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from typing import Any, TypeAlias

import numpy as np

from snr_sim.recording.records import Header, Record
from snr_sim.recording.view_blueprint import Layout, Line, blueprint, color_and_width, name_and_unit
from snr_sim.recording.view_columns import Batch, LogRows, Series, When
from snr_sim.recording.view_scene import Path, mesh_with_normals, points_of, rgb_of, size_of

# Records that are turned into columns together: enough to be quick, few enough that a run of days fits into memory.
BATCH_RECORDS = 100_000
DIVERGENCES_MARKED_MAX = 1_000
CAMERA = "camera"
THRUST_RGB = (255, 140, 30)
PATH_RGB = (120, 200, 255)
DIVERGENCE_RGB = (255, 60, 60)

Divergences: TypeAlias = Sequence[tuple[int, float, str]]


def title_of(header: Header) -> str:
    """Returns what a run is called."""
    return f"{header.scenario}, seed {header.seed}, {header.controller}"


class _Column:
    """A column for rerun, made of an arrow array that is already right."""

    def __init__(self, descriptor: Any, array: Any) -> None:
        self._descriptor, self._array = descriptor, array

    def component_descriptor(self) -> Any:
        return self._descriptor

    def as_arrow_array(self) -> Any:
        return self._array


class _Index:
    """A timeline's column; one is shared by all numbers of a page."""

    def __init__(self, name: str, array: Any) -> None:
        self._name, self._array = name, array

    def timeline_name(self) -> str:
        return self._name

    def as_arrow_array(self) -> Any:
        return self._array


class Writer:
    """Sends one run into a stream.

    Args:
        rr: the module rerun, which only `view.py` imports.
        stream: a recording stream of it.
        header: of the run.
        root: what its entities begin with, when there are two runs in the stream.
        layout: shared by the runs in the stream; without it, the run has one of its own.
    """

    def __init__(
        self, rr: Any, stream: Any, header: Header, root: tuple[str, ...] = (), layout: Layout | None = None
    ) -> None:
        self._rr, self._arrow = rr, importlib.import_module("pyarrow")
        self._stream, self._header, self._root = stream, header, root
        self.batch = Batch()
        self.layout = layout or Layout(title_of(header))
        self._known: set[tuple[str, ...]] = set()
        self._main_body = ""
        self._path = Path()
        self._longest_n = 0.0
        self._scaled_for = (0.0, 0)
        self._index_of: tuple[When | None, list[_Index]] = (None, [])
        rr = self._rr
        self._descriptors = {
            column.component_descriptor().component: column.component_descriptor()
            for column in (
                *rr.Scalars.columns(scalars=[0.0]),
                *rr.Arrows3D.columns(vectors=[[0.0, 0.0, 0.0]], origins=[[0.0, 0.0, 0.0]]),
                *rr.TextLog.columns(text=["a"], level=["a"]),
                *rr.SeriesLines.columns(names=["a"], colors=[0], widths=[0.0]),
            )
        }
        self._send_run()
        self._send_scene()

    def send_all(self, records: Iterable[Record]) -> None:
        """Sends all of a run, some records at a time."""
        remaining = iter(records)
        while some := list(islice(remaining, BATCH_RECORDS)):
            with _no_garbage_collection():
                self.batch.extend(some)
                self.flush()

    def flush(self) -> None:
        """Sends the records in the batch, and empties it."""
        batch = self.batch
        for body, when, poses in batch.poses():
            self._send_poses(body, when, poses)
        for name, when, arrows in batch.arrows():
            self._send_arrows(name, when, arrows)
        self._scale_arrows()
        for series in batch.truth_values():
            self._send_series(("truth", *series.path), series, is_truth=True)
        for node, series in batch.page_values():
            self._send_series((node, "pages", *series.path), series, is_truth=False)
        for place, logs in (("tasks", batch.executed()), ("events", batch.events())):
            for node, rows in logs:
                self._send_log((node, place), rows)
        batch.clear()
        self._send_path()

    def blueprint(self, follow_time: bool = False) -> Any:
        """Returns how the view opens, given what has been sent so far."""
        return blueprint(self._rr.blueprint, self.layout, follow_time)

    def send_divergences(self, divergences: Divergences) -> None:
        """Marks where two runs differ: as text, in the plots, and on the path of each body."""
        seqs, times, texts = zip(*divergences, strict=True)
        when = When(np.array(seqs, np.int64), np.array(times, np.float64))
        self._send_log(("divergences",), LogRows(when, list(texts), ["WARN"] * len(texts)), at_top=True)
        marked = when[:DIVERGENCES_MARKED_MAX]
        marks = self._rr.SeriesPoints(colors=DIVERGENCE_RGB, markers="diamond", marker_sizes=4.0, names="differs")
        self._stream.log("/divergences/marks", marks, static=True)
        self._send("/divergences/marks", marked, [self._numbers(np.zeros(len(marked)))])
        self.layout.has_divergences = True

    def _entity(self, *parts: str) -> str:
        return str(self._rr.new_entity_path([*self._root, *parts]))

    def _send(self, entity: str, when: When, columns: Iterable[Any]) -> None:
        self._stream.send_columns(entity, self._index(when), columns)

    def _index(self, when: When) -> list[_Index]:
        if self._index_of[0] is not when:
            nanoseconds = np.rint(when.t_s * 1e9).astype("timedelta64[ns]")
            seqs, times = self._arrow.array(when.seq), self._arrow.array(nanoseconds, self._arrow.duration("ns"))
            self._index_of = (when, [_Index("seq", seqs), _Index("sim_time", times)])
        return self._index_of[1]

    def _column(self, component: str, flat: Any, offsets: Any = None) -> _Column:
        """Returns a column, one element per row unless `offsets` say otherwise."""
        if offsets is None:
            offsets = np.arange(len(flat) + 1, dtype=np.int32)
        return _Column(self._descriptors[component], self._arrow.ListArray.from_arrays(offsets, flat))

    def _numbers(self, values: Any, per_row: int = 1) -> _Column:
        offsets = np.arange(0, len(values) + 1, per_row, dtype=np.int32)
        return self._column("Scalars:scalars", self._arrow.array(values), offsets)

    def _words(self, component: str, words: list[str]) -> _Column:
        return self._column(component, self._arrow.array(words, self._arrow.string()))

    def _send_run(self) -> None:
        header = self._header
        lines = [f"# {title_of(header)}", "", "| | |", "|---|---|"]
        for name in ("scenario", "seed", "robot", "controller", "engine", "io", "clock", "kit", "python", "platform"):
            lines.append(f"| {name} | {getattr(header, name)} |")
        lines += [f"| {name} | {version} |" for name, version in header.packages.items()]
        document = self._rr.TextDocument("\n".join(lines), media_type="text/markdown")
        self._stream.log(self._entity("run"), document, static=True)

    def _send_scene(self) -> None:
        statics, bodies = self._header.scene.get("statics", {}), self._header.scene.get("bodies", {})
        self._stream.log("/", self._rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for name, shape in statics.items():
            self._send_shapes(self._entity("world", name), [shape])
        for name, shapes in bodies.items():
            self._send_shapes(self._entity("world", name, "shapes"), shapes)
        self.layout.body_size_m = max([size_of(shapes) for shapes in bodies.values()], default=1.0)

    def _send_shapes(self, entity: str, shapes: Sequence[dict[str, Any]]) -> None:
        """Sends shapes that move together, those of one kind together: each thing sent costs a quarter millisecond.

        A kind of a later version is left out, for the rest is still worth seeing.
        """
        rr = self._rr
        kinds = {kind: [shape for shape in shapes if shape.get("kind") == kind] for kind in ("box", "polyline", "mesh")}
        if boxes := kinds["box"]:
            sizes, centers = [box["half_size_m"] for box in boxes], [box["center_m"] for box in boxes]
            colors = [rgb_of(box) for box in boxes]
            solid = rr.Boxes3D(half_sizes=sizes, centers=centers, colors=colors, fill_mode="solid")
            self._stream.log(entity, solid, static=True)
        if lines := kinds["polyline"]:
            radii, colors = [line.get("radius_m", 0.1) for line in lines], [rgb_of(line) for line in lines]
            strips = rr.LineStrips3D([points_of(line).astype(np.float32) for line in lines], radii=radii, colors=colors)
            self._stream.log(entity, strips, static=True)
        if meshes := kinds["mesh"]:
            parts = [mesh_with_normals(points_of(mesh), np.array(mesh["triangles"], int)) for mesh in meshes]
            vertices, normals = (np.concatenate(part).astype(np.float32) for part in zip(*parts, strict=True))
            counts = [len(part[0]) for part in parts]
            rgb = np.repeat(np.array([rgb_of(mesh) for mesh in meshes], np.uint8), counts, axis=0)
            mesh = rr.Mesh3D(vertex_positions=vertices, vertex_normals=normals, vertex_colors=rgb)
            self._stream.log(entity, mesh, static=True)

    def _send_poses(self, body: str, when: When, poses: Any) -> None:
        entity, positions = self._entity("world", body), poses[:, :3]
        if ("poses", body) not in self._known:
            self._known.add(("poses", body))
            self._see_body(body, entity, positions)
        translation, quaternion = positions.astype(np.float32), poses[:, 3:].astype(np.float32)
        self._send(entity, when, self._rr.Transform3D.columns(translation=translation, quaternion=quaternion))
        self._send(self._entity("truth", "poses", body), when, [self._numbers(poses.ravel(), 7)])
        if body == self._main_body:
            # Moves, but does not turn: seen from here the body stays in the middle and the ground stays level.
            camera = self._rr.Transform3D.columns(translation=translation)
            self._send(self._entity("world", CAMERA), when, camera)
            self._path.extend(positions)
            self.layout.low_m = np.minimum(self.layout.low_m, positions.min(axis=0)).tolist()
            self.layout.high_m = np.maximum(self.layout.high_m, positions.max(axis=0)).tolist()

    def _see_body(self, body: str, entity: str, positions: Any) -> None:
        """The first body of a plant is the one that the camera follows; the others, such as legs, go along with it."""
        if self._main_body:
            return
        self._main_body = body
        if not self.layout.bodies:
            self.layout.low_m = self.layout.high_m = positions[0].tolist()
        self.layout.bodies.append(entity)
        self.layout.cameras.append(self._entity("world", CAMERA))
        rr = self._rr
        marker = rr.Points3D([[0, 0, 0]], radii=rr.Radius.ui_points(5.0), colors=THRUST_RGB)
        self._stream.log(self._entity("world", body, "marker"), marker, static=True)

    def _send_arrows(self, name: str, when: When, arrows: Any) -> None:
        entity, rr = self._entity("world", "arrows", name), self._rr
        newtons, vectors = f"{entity}/newtons", arrows[:, 3:]
        lengths = np.linalg.norm(vectors, axis=1)
        if ("arrows", name) not in self._known:
            self._known.add(("arrows", name))
            style = rr.Arrows3D.from_fields(radii=rr.Radius.ui_points(3.0), colors=THRUST_RGB)
            self._stream.log(newtons, style, static=True)
        self._longest_n = max(self._longest_n, float(lengths.max()))
        pushes = lengths > 0  # a force of nothing is no arrow, not even a dot
        triples = rr.components.Vector3DBatch(vectors[pushes].astype(np.float32)).as_arrow_array()
        # It pushes: its tip, not its tail, is where the force acts. Drawn up from the nozzle, the hull would hide it.
        tails = rr.components.Position3DBatch(-vectors[pushes].astype(np.float32)).as_arrow_array()
        offsets = np.concatenate(([0], np.cumsum(pushes))).astype(np.int32)
        self._send(entity, when, rr.Transform3D.columns(translation=arrows[:, :3].astype(np.float32)))
        columns = [self._column("Arrows3D:vectors", triples, offsets), self._column("Arrows3D:origins", tails, offsets)]
        self._send(newtons, when, columns)

    def _scale_arrows(self) -> None:
        """Newtons to metres: a static scale, so that the file keeps newtons and a live run can find its own scale."""
        names = [name for kind, name, *_ in self._known if kind == "arrows"]
        if not names or self._scaled_for == (self._longest_n, len(names)):
            return
        self._scaled_for = (self._longest_n, len(names))
        scale = self._rr.Transform3D(scale=self.layout.body_size_m / (self._longest_n or 1.0))
        for name in names:
            self._stream.log(self._entity("world", "arrows", name, "newtons"), scale, static=True)

    def _send_series(self, parts: tuple[str, ...], series: Series, is_truth: bool) -> None:
        entity = self._entity(*parts)
        if parts not in self._known:
            self._known.add(parts)
            name, unit = name_and_unit(series.path)
            line = Line(entity, " ".join([*self._root, *(["true"] if is_truth else []), name]), unit, is_truth)
            color, width = color_and_width(line, self.layout.lines)
            if is_truth or self._is_plotted(parts):
                self.layout.lines.append(line)
            self._send_style(entity, line.name, color, width)
        self._send(entity, series.when, [self._numbers(series.values)])

    def _is_plotted(self, parts: tuple[str, ...]) -> bool:
        """Of two runs side by side, only what drives the actuators: all lines of both would hide where they differ."""
        commands = self._header.commands
        return not self._root or not commands or parts[2] in commands.get(parts[0], ())

    def _send_style(self, entity: str, name: str, rgba: tuple[int, int, int, int], width: float) -> None:
        """Says how a line looks; as arrow arrays, because rr.SeriesLines costs more than the numbers themselves."""
        red, green, blue, opacity = rgba
        color = np.array([red << 24 | green << 16 | blue << 8 | opacity], np.uint32)
        columns = [
            self._words("SeriesLines:names", [name]),
            self._column("SeriesLines:colors", self._arrow.array(color)),
            self._column("SeriesLines:widths", self._arrow.array(np.array([width], np.float32))),
        ]
        self._stream.send_columns(entity, [], columns)  # without a timeline: static

    def _send_log(self, parts: tuple[str, ...], rows: LogRows, at_top: bool = False) -> None:
        entity = "/" + parts[0] if at_top else self._entity(*parts)
        columns = [self._words("TextLog:text", rows.texts), self._words("TextLog:level", rows.levels)]
        self._send(entity, rows.when, columns)
        log = self._entity(parts[0])
        if log not in self.layout.logs and not at_top:
            self.layout.logs.append(log)

    def _send_path(self) -> None:
        """Static, and sent again when it has grown: the whole way is seen at any time."""
        if self._main_body:
            line = self._rr.LineStrips3D([self._path.points()], radii=self._rr.Radius.ui_points(1.0), colors=PATH_RGB)
            self._stream.log(self._entity("world", "path", self._main_body), line, static=True)


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    """Columns are made of a hundred thousand small objects that refer to nothing: looking for circles among them, and
    among all the records of the run, costs a tenth of the time and finds none.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
