"""The rerun view of a run: the body in its scene, thrust as arrows, plots of true and estimated values, a task log.

A view is derived from the records of a trace and can be derived again, so it is never the only copy of any data.
Angles are in degrees in it, and a depth is negative, named `-depth`, so that its line goes down with the vehicle.
All data are on two timelines: `seq`, the order of the records, and `sim_time`.

    /world/<name>                          static objects
    /world/<body>                          shapes of a body; its pose (rerun keeps poses in float32)
    /world/follower                        follows the first body: target of the close-up camera
    /world/arrows/<name>/newtons           forces [N], scaled so that the longest is as long as the body
    /world/arrows/current/newtons          velocity of the water, with a scale of its own
    /world/<tether>                        with a sag if it is slack; redder for a larger force
    /world/broken/<arrow>                  position of a broken thruster's force
    /truth/<value>, /truth/poses/<body>    true states of the plant, in float64
    /<node>/pages/<key>/<field>            values in the node's pages; camera images
    /<node>/contents                       all its pages as text, once a second: fields, units, time and source
    /<node>/links/<key>/<field>            pages per second and round trip [ms], from the page of a link
    /<node>/tasks, /<node>/events          task log, one line per executed task; begin, errors and end

This is the only file that imports rerun, because rerun's interface changes with most releases. It guarantees that a
`.rrd` can be read over one release only.
"""

from __future__ import annotations

import contextlib
import importlib
import os
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from threading import Thread
from typing import Any

from snr_sim.prelude.errors import MissingExtraError, TraceError
from snr_sim.prelude.values import no_garbage_collection
from snr_sim.recording.folder import VIEW_NAME, trace_path
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import Header, Record
from snr_sim.view.handler_lines import handler_lines
from snr_sim.view.view_blueprint import Layout
from snr_sim.view.view_writer import Divergences, Writer, title_of

# Records that are converted to columns together: enough for speed, and few enough to process a run of days in memory.
BATCH_RECORDS = 100_000
# A view is as long as its trace to half as long again, more for a short run: see `_atomic_file`.
MAX_VIEW_RATIO = 3
MIN_VIEW_BYTES = 1_000_000
LIVE_TIMEOUT_S = 5.0  # for a live view that does not read; rerun itself has no timeout


def write_view(
    header: Header,
    records: Iterable[Record],
    path: Path,
    trace_bytes: int,
    lines: Mapping[str, str] | None = None,
) -> None:
    """Write the view of one run, with its layout.

    Args:
        trace_bytes: length of the trace of these records; the disk must have space for its view.
        lines: of handlers, by name: see `handler_lines.py`.

    Raises:
        MissingExtraError: rerun is not installed.
        TraceError: the file cannot be written.
    """
    with _atomic_file(path, trace_bytes) as part, _stream("run", title_of(header)) as (rr, stream):
        writer, file = Writer(rr, stream, header, lines=lines), ViewFile(stream, part)
        file.send(writer, records)
        file.end(writer)


def view_of(run: Path) -> Path:
    """Return the .rrd of a run folder, a trace or an .rrd; it is derived if it is missing or the trace has grown since.

    Raises:
        MissingExtraError: it has to be derived and rerun is not installed.
        TraceError: there is no such run, or the file cannot be written.
    """
    if run.suffix == ".rrd" and run.is_file():
        return run
    path = trace_path(run)
    rrd = path.parent / VIEW_NAME
    if not rrd.is_file() or rrd.stat().st_mtime_ns < path.stat().st_mtime_ns:
        trace = read_trace(path)
        write_view(trace.header, trace.records, rrd, path.stat().st_size, handler_lines(path.parent))
    return rrd


def write_comparison(
    recorded_header: Header,
    recorded_records: Iterable[Record],
    replayed_records: Iterable[Record],
    divergences: Divergences,
    path: Path,
    trace_bytes: int,
    roots: tuple[str, str] = ("recorded", "replayed"),
    other_header: Header | None = None,
) -> None:
    """Write two runs on one timeline, each under its own root, with their differences marked.

    Args:
        recorded_header, recorded_records: of the original run.
        replayed_records: of the run with other code.
        divergences: seq, time [s] and a sentence for each difference.
        trace_bytes: total length of both traces; the disk must have space for the view.
        roots: path prefix of each run.
        other_header: of the replayed run, if its nodes and its scene differ.

    Raises:
        MissingExtraError: rerun is not installed.
        TraceError: the file cannot be written.
    """
    with _atomic_file(path, trace_bytes) as part, _stream("comparison", title_of(recorded_header)) as (rr, stream):
        file, layout = ViewFile(stream, part), Layout(title_of(recorded_header), roots=[f"/{root}" for root in roots])
        recorded = Writer(rr, stream, recorded_header, roots[:1], layout)
        file.send(recorded, recorded_records)
        replayed = Writer(rr, stream, other_header or recorded_header, roots[1:], layout)
        file.send(replayed, replayed_records)
        if divergences:
            recorded.send_divergences(divergences)
        file.end(recorded)


class LiveView:
    """View of a run in progress; viewers connect to `url`, from this machine only."""

    def __init__(self, header: Header) -> None:
        from snr_sim.view.view_server import LOOPBACK, free_port

        rr = _rerun()
        self._stream = rr.RecordingStream("snr_sim_live", send_properties=False)
        sink = rr.GrpcServerSink(bind_ip=LOOPBACK, port=free_port())
        self._stream.set_sinks(sink)
        self.url: str = sink.uri
        self._writer = Writer(rr, self._stream, header)
        self._shown = 0

    def add(self, record: Record) -> None:
        """Add a record; it is sent by `flush`."""
        self._writer.batch.extend((record,))

    def flush(self) -> None:
        """Send the added records; raise if the server does not accept them in time. Ten calls a second are enough."""
        self._writer.flush()
        layout = self._writer.layout
        shown = len(layout.lines) + len(layout.logs) + len(layout.contents)
        if shown != self._shown:  # something that is not in the layout yet
            self._shown = shown
            self._stream.send_blueprint(self._writer.blueprint(follow_time=True))
        self._stream.flush(timeout_sec=LIVE_TIMEOUT_S)

    def close(self) -> None:
        """Send the rest and end the server; return after twice LIVE_TIMEOUT_S at most. Safe to call twice."""
        if self._shown >= 0:
            with contextlib.suppress(Exception):  # a failure here has occurred before and was reported
                self.flush()
            self._shown = -1
            closing = Thread(target=self._stream.disconnect, name="live-view-close", daemon=True)
            closing.start()  # a viewer that does not read holds it without limit
            closing.join(LIVE_TIMEOUT_S)


class ViewFile:
    """Writer of runs with the layout at the beginning of the file, so that a viewer applies it while still reading.

    A viewer shows a default grid until it reads a layout, and a viewer in a browser may read a long run for minutes.
    But the layout is known only when the run has been processed. Therefore the stream has no sink at first, so that
    rerun buffers the data until a batch is full or the run is over. A longer run begins with the layout of its first
    batch, and ends with that of the whole run.

    Args:
        stream: a recording stream that has no sink yet.
        path: of the file.
    """

    def __init__(self, stream: Any, path: Path) -> None:
        self._stream, self._path = stream, path
        self._records = 0
        self._has_begun = False

    def send(self, writer: Writer, records: Iterable[Record]) -> None:
        """Send a whole run in batches of records."""
        remaining = iter(records)
        while some := list(islice(remaining, BATCH_RECORDS)):
            if self._records and self._records + len(some) > BATCH_RECORDS and not self._has_begun:
                self._begin(writer)
            self._records += len(some)
            writer.batch.extend(some)
            writer.flush()

    def end(self, writer: Writer) -> None:
        """Write the layout of everything that was sent to the file; raise TraceError if the file cannot be written."""
        if self._has_begun:
            self._stream.send_blueprint(writer.blueprint())
        else:
            self._begin(writer)

    def _begin(self, writer: Writer) -> None:
        self._has_begun = True
        try:
            self._stream.save(str(self._path), default_blueprint=writer.blueprint())
        except (OSError, RuntimeError) as error:
            raise TraceError(f"The view cannot be written to {self._path}: {error}.") from error


@contextlib.contextmanager
def _atomic_file(path: Path, trace_bytes: int) -> Iterator[Path]:
    """Yield a temporary file name that is renamed at the end, so an interruption does not leave half a view.

    Raises:
        TraceError: the disk is full, or the file cannot be written.
    """
    part = path.with_name(f"part-{path.name}")
    try:
        _reserve_space(part, MAX_VIEW_RATIO * trace_bytes + MIN_VIEW_BYTES)
        yield part
        part.replace(path)
    except OSError as error:
        raise TraceError(
            f"The view {path} cannot be written: {error.strerror}.", fix="make room on the disk, or use another folder."
        ) from error
    finally:
        with contextlib.suppress(OSError):  # the folder itself may be unusable
            part.unlink()


def _reserve_space(path: Path, size_bytes: int) -> None:
    """Make sure that a file of this size can be written: rerun (0.41) never returns from a disk that is full.

    Raises:
        OSError: there is not enough space.
    """
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
    try:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(descriptor, 0, size_bytes)
            os.ftruncate(descriptor, 0)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def _stream(kind: str, title: str) -> Iterator[tuple[Any, Any]]:
    rr = _rerun()
    stream = rr.RecordingStream(f"snr_sim_{kind}", send_properties=False)
    try:
        with no_garbage_collection():
            stream.send_recording_name(title)
            yield rr, stream
    finally:
        stream.disconnect()


def _rerun() -> Any:
    """Return the module rerun, imported at first use: it takes a third of a second and 89 MB."""
    try:
        return importlib.import_module("rerun")
    except ImportError as error:
        raise MissingExtraError("rerun-sdk", "view") from error
