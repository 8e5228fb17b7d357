"""Columnar access to a rerun stream.

Data are never sent row by row: through rerun's own classes, one page costs as much as five hundred rows of a column.
Numbers are packed here: there are many columns of them, and rerun's own (0.41) take 1.5 to 3 times as long.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from snr_sim.recording.columns import When


def pack_colors(colors: Any) -> Any:
    """Return colours, shape (n, 3) or (n, 4) with opacity, in rerun's format, one number each.

    rerun's own conversion of other formats is slower.
    """
    red, green, blue, *opacity = np.asarray(colors, np.uint32).T
    return red << 24 | green << 16 | blue << 8 | (opacity[0] if opacity else np.uint32(255))


@dataclass(frozen=True)
class _Column:
    """A column for rerun, from an arrow array that already has the right type."""

    descriptor: Any
    array: Any

    def component_descriptor(self) -> Any:
        return self.descriptor

    def as_arrow_array(self) -> Any:
        return self.array


class Sender:
    """Sender of columns and static data to the entities of one run, of which `root` is the prefix.

    `rr` is the module rerun, which only `view.py` imports, and the stream is a recording stream of it.
    """

    def __init__(self, rr: Any, stream: Any, root: tuple[str, ...]) -> None:
        self.rr: Any = rr
        self._stream = stream
        self._root = root
        self._arrow = importlib.import_module("pyarrow")
        (column,) = rr.Scalars.columns(scalars=[0.0])
        self._scalars = column.component_descriptor()
        self._index_of: tuple[When | None, list[Any]] = (None, [])

    def entity(self, *parts: str) -> str:
        """Return the path of an entity."""
        return str(self.rr.new_entity_path([*self._root, *parts]))

    def log(self, entity: str, *things: Any) -> None:
        """Send static data."""
        self._stream.log(entity, *things, static=True)

    def send(self, entity: str, when: When, columns: Iterable[Any]) -> None:
        """Send columns on both timelines."""
        if self._index_of[0] is not when:  # all numbers of a page have the same times
            nanoseconds = np.rint(when.t_s * 1e9).astype("timedelta64[ns]")
            times = self.rr.TimeColumn("sim_time", duration=nanoseconds)
            self._index_of = (when, [self.rr.TimeColumn("seq", sequence=when.seq), times])
        self._stream.send_columns(entity, self._index_of[1], columns)

    def send_numbers(self, entity: str, when: When, values: Any, per_row: int = 1) -> None:
        """Send a column of float64."""
        offsets = np.arange(0, len(values) + 1, per_row, dtype=np.int32)
        array = self._arrow.ListArray.from_arrays(offsets, self._arrow.array(values))
        self.send(entity, when, [_Column(self._scalars, array)])
