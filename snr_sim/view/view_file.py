"""File of a view. It begins with the layout, so that a viewer applies it while still reading the rest."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import Any

from snr_sim.prelude.errors import TraceError
from snr_sim.recording.records import Record
from snr_sim.view.view_writer import Writer

# Records that are converted to columns together: enough for speed, and few enough to process a run of days in memory.
BATCH_RECORDS = 100_000


class ViewFile:
    """Writer of runs with the layout at the beginning of the file.

    A viewer shows a default grid until it reads a layout, and a viewer in a browser may read a long run for minutes.
    But the layout is known only when the run has been processed. Therefore the stream has no sink at first, so that
    rerun buffers the data until a batch is full or the run is over. A longer run begins with the layout of its first
    batch, and ends with that of the whole run.

    Args:
        stream: a recording stream that has no sink yet.
        path: of the file.
    """

    def __init__(self, stream: Any, path: str | Path) -> None:
        self._stream, self._path = stream, path
        self._records = 0
        self._begun = False

    def send(self, writer: Writer, records: Iterable[Record]) -> None:
        """Send a whole run in batches of records."""
        remaining = iter(records)
        while some := list(islice(remaining, BATCH_RECORDS)):
            if self._records and self._records + len(some) > BATCH_RECORDS:
                self._begin(writer)
            self._records += len(some)
            writer.batch.extend(some)
            writer.flush()

    def end(self, writer: Writer) -> None:
        """Write the layout of everything that was sent to the file.

        Raises:
            TraceError: the file cannot be written.
        """
        if self._begun:
            self._stream.send_blueprint(writer.blueprint())
        self._begin(writer)

    def _begin(self, writer: Writer) -> None:
        if self._begun:
            return
        self._begun = True
        try:
            self._stream.save(str(self._path), default_blueprint=writer.blueprint())
        except (OSError, RuntimeError) as error:
            raise TraceError(f"The view cannot be written to {self._path}: {error}.") from error
