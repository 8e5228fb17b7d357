"""The file of a view. It begins with the layout, so the view stands tidy while a viewer still reads the rest."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import Any

from snr_sim.prelude.errors import TraceError
from snr_sim.recording.records import Record
from snr_sim.view.view_writer import Writer

# Records that are turned into columns together: enough to be quick, few enough that a run of days fits into memory.
BATCH_RECORDS = 100_000


class ViewFile:
    """Takes runs, and puts the layout before them.

    A viewer shows a grid of its own making until it comes to a layout, and a viewer in a browser may read a long run
    for minutes. But what there is to lay out is known only when the run has been looked through. So rerun keeps what
    it is sent (a stream that goes nowhere yet does) until a batch is full or the run is over. A longer run begins with
    the layout of its first batch, and ends with that of all of it.

    Args:
        stream: a recording stream that has no sink yet.
        path: of the file.
    """

    def __init__(self, stream: Any, path: str | Path) -> None:
        self._stream, self._path = stream, path
        self._records = 0
        self._begun = False

    def send(self, writer: Writer, records: Iterable[Record]) -> None:
        """Send all of a run, some records at a time."""
        remaining = iter(records)
        while some := list(islice(remaining, BATCH_RECORDS)):
            if self._records and self._records + len(some) > BATCH_RECORDS:
                self._begin(writer)
            self._records += len(some)
            writer.batch.extend(some)
            writer.flush()

    def end(self, writer: Writer) -> None:
        """See to it that the file has the layout of all that was sent.

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
