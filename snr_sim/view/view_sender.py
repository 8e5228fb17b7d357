"""Columnar access to a rerun stream: the only module that converts arrow arrays to rerun components.

Data are never sent row by row: through rerun's own classes, one page costs as much as five hundred rows of a column.
Numbers, vectors and texts are packed here: rerun's own columns (0.41) take 1.5 to 3 times as long.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from snr_sim.recording.columns import When


def pack_colors(colors: Any) -> Any:
    """Return colours in rerun's format, one number each; rerun's own conversion of other formats is slower.

    Args:
        colors: red, green, blue and perhaps opacity of each, shape (n, 3) or (n, 4).
    """
    red, green, blue, *opacity = np.asarray(colors, np.uint32).T
    return red << 24 | green << 16 | blue << 8 | (opacity[0] if opacity else np.uint32(255))


class _Column:
    """A column for rerun, from an arrow array that already has the right type."""

    def __init__(self, descriptor: Any, array: Any) -> None:
        self._descriptor, self._array = descriptor, array

    def component_descriptor(self) -> Any:
        return self._descriptor

    def as_arrow_array(self) -> Any:
        return self._array


class _Index:
    """A timeline's column, shared by all numbers of a page."""

    def __init__(self, name: str, array: Any) -> None:
        self._name, self._array = name, array

    def timeline_name(self) -> str:
        return self._name

    def as_arrow_array(self) -> Any:
        return self._array


class Sender:
    """Sender of columns and static data to the entities of one run.

    Args:
        rr: the module rerun, which only `view.py` imports.
        stream: a recording stream of it.
        root: prefix of the run's entities.
    """

    def __init__(self, rr: Any, stream: Any, root: tuple[str, ...]) -> None:
        self.rr, self.arrow, self.root = rr, importlib.import_module("pyarrow"), root
        self._stream = stream
        self._index_of: tuple[When | None, list[_Index]] = (None, [])
        vectors = (
            *rr.Arrows3D.columns(vectors=[[0.0, 0.0, 0.0]], origins=[[0.0, 0.0, 0.0]]),
            *rr.Transform3D.columns(translation=[[0.0, 0.0, 0.0]], quaternion=[[0.0, 0.0, 0.0, 1.0]]),
            *rr.Points3D.columns(positions=[[0.0, 0.0, 0.0]]),
        )
        self._vector_types = {
            column.component_descriptor().component: column.as_arrow_array().type.value_type for column in vectors
        }
        self._descriptors = {
            column.component_descriptor().component: column.component_descriptor()
            for column in (
                *vectors,
                *rr.Scalars.columns(scalars=[0.0]),
                *rr.TextDocument.columns(text=["a"]),
                *rr.TextLog.columns(text=["a"], level=["a"]),
            )
        }

    def entity(self, *parts: str) -> str:
        """Return the path of an entity."""
        return str(self.rr.new_entity_path([*self.root, *parts]))

    def log(self, entity: str, *things: Any) -> None:
        """Send static data."""
        self._stream.log(entity, *things, static=True)

    def send(self, entity: str, when: When, columns: Iterable[Any]) -> None:
        """Send columns on both timelines."""
        self._stream.send_columns(entity, self._index(when), columns)

    def column(self, component: str, flat: Any, offsets: Any = None) -> Any:
        """Return a column, one element per row unless `offsets` are given."""
        if offsets is None:
            offsets = np.arange(len(flat) + 1, dtype=np.int32)
        return _Column(self._descriptors[component], self.arrow.ListArray.from_arrays(offsets, flat))

    def numbers(self, values: Any, per_row: int = 1) -> Any:
        """Return a column of float64."""
        offsets = np.arange(0, len(values) + 1, per_row, dtype=np.int32)
        return self.column("Scalars:scalars", self.arrow.array(values), offsets)

    def words(self, component: str, words: list[str]) -> Any:
        """Return a column of texts."""
        return self.column(component, self.arrow.array(words, self.arrow.string()))

    def vectors(self, component: str, values: Any, offsets: Any = None) -> Any:
        """Return a column of float32 vectors, shape (n, k); one per row unless `offsets` are given."""
        flat = self.arrow.array(np.ascontiguousarray(values, np.float32).ravel())
        vectors = self.arrow.FixedSizeListArray.from_arrays(flat, type=self._vector_types[component])
        return self.column(component, vectors, offsets)

    def _index(self, when: When) -> list[_Index]:
        if self._index_of[0] is not when:
            nanoseconds = np.rint(when.t_s * 1e9).astype("timedelta64[ns]")
            seqs, times = self.arrow.array(when.seq), self.arrow.array(nanoseconds, self.arrow.duration("ns"))
            self._index_of = (when, [_Index("seq", seqs), _Index("sim_time", times)])
        return self._index_of[1]
