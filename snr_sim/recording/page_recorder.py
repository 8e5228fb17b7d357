"""Recorder: writes the pages of some keys into a text file, a page on each line, as they are stored.

A small tool in addition to the trace, for data that you want to keep, plot, or replay (`recording/replayers.py`). The
trace of a run has everything and does not need a recorder.

A recording is only appended to. A reload continues in the same file, and so does the next start of the program, which
first writes a line `{"$":"start","node":"urov_node"}` before its pages. If a crash truncated the last line, the next
start begins on a new line, and readers skip the truncated one. To start over, remove the file or use another name.

In lock step a line is written while its page is stored. On the wall clock a thread writes, so that a disk that answers
late delays no handler; when `MAX_UNWRITTEN_BYTES` wait for it, the recording ends, and the robot continues.
"""

from __future__ import annotations

import os
import threading
import weakref
from collections import Counter
from collections.abc import Iterable, Sequence
from io import FileIO
from pathlib import Path
from queue import SimpleQueue

import msgspec

from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.prelude.errors import ConfigError, RecordingError, SnrError, ValueEncodingError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import DataKey, Page, SomeTasks, Task, TaskId, TaskType
from snr_sim.prelude.values import TAG
from snr_sim.recording.page_reader import START

MAX_UNWRITTEN_BYTES = 16_000_000
CLOSE_TIMEOUT_S = 1.0  # for a disk that hangs, at the end of a run or at a reload
_TOO_SLOW = "the disk is too slow, or does not answer"
_OBJECT = b'"$":"object"'  # tag of a value that cannot be decoded; inside a text the quotes are escaped


class RecorderEndpointFactory(EndpointFactory):
    """Factory of an endpoint that records the pages of some keys.

    Args:
        file: path of the recording; created if it does not exist, else appended to.
        keys: of the pages: a list, or one key.
        name: of the endpoint; unique among the recorders of a node.

    Raises:
        ConfigError: a key is not a string.
    """

    def __init__(self, file: str | Path, keys: Sequence[DataKey] | DataKey, name: str = "recorder") -> None:
        super().__init__()
        self.path: Path = Path(file)
        self.keys: list[DataKey] = _as_keys(keys)
        self.name: str = name
        self._newest: weakref.ref[NodeApi] | None = None

    def get(self, parent: NodeApi) -> RecorderEndpoint:
        """Return the endpoint."""
        return RecorderEndpoint(self, parent, self.name)

    def is_new(self, node: NodeApi) -> bool:
        """Return whether this node has not recorded here yet: then it is a new run, not a reload in the same one."""
        known = self._newest is not None and self._newest() is node
        self._newest = weakref.ref(node)
        return not known


class _LineWriter:
    """Writer of whole lines to a file, each in one system call, so that lines of two recorders do not mix.

    Args:
        file: open, to be appended to; closed by `close`.
        on_thread: whether a thread of its own writes.

    Attributes:
        failure: why no more lines are written, or an empty text.
    """

    def __init__(self, file: FileIO, on_thread: bool) -> None:
        self.failure: str = ""
        self._file = file
        self._queue: SimpleQueue[bytes | None] = SimpleQueue()
        self._put_bytes = self._written_bytes = 0  # each is counted by one thread
        self._thread: threading.Thread | None = None
        if on_thread:
            self._thread = threading.Thread(target=self._write_queued, name="page-recorder", daemon=True)
            self._thread.start()

    def put(self, line: bytes) -> None:
        """Write a line, or queue it for the thread; then look at `failure`."""
        if self._thread is None:
            self._write(line)
        elif self._put_bytes - self._written_bytes > MAX_UNWRITTEN_BYTES:
            self.failure = self.failure or _TOO_SLOW
        else:
            self._put_bytes += len(line)
            self._queue.put(line)

    def close(self) -> None:
        """Write what is queued and close the file; after a failure, or if the disk hangs, the thread does so later."""
        if self._thread is None:
            self._file.close()
            return
        self._queue.put(None)
        if not self.failure:
            self._thread.join(CLOSE_TIMEOUT_S)
            if self._thread.is_alive():
                self.failure = _TOO_SLOW

    def _write_queued(self) -> None:
        while (line := self._queue.get()) is not None:
            if not self.failure:
                self._write(line)
            self._written_bytes += len(line)
        self._file.close()

    def _write(self, line: bytes) -> None:
        try:
            if self._file.write(line + b"\n") != len(line) + 1:
                self.failure = "there is no room left"
        except OSError as error:
            self.failure = str(error.strerror)


class RecorderEndpoint(Endpoint):
    """Writes one line for each page, unbuffered. In a replay it does not write."""

    factory: RecorderEndpointFactory

    def __init__(self, factory: RecorderEndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self._writer: _LineWriter | None = None
        self._refused: Counter[DataKey] = Counter()
        self.task_handlers = {(TaskType.store_page, key): self.record for key in factory.keys}

    def begin(self) -> None:
        """Open the file.

        Raises:
            RecordingError: the file cannot be written.
        """
        if self.parent.is_replay:
            return
        path = self.factory.path
        try:
            file = path.open("ab+", buffering=0)
            _finish_cut_line(file)
        except OSError as error:
            raise RecordingError(
                f"The recording {path} cannot be written: {error.strerror}.", fix="a file in a folder that is there."
            ) from error
        self._writer = _LineWriter(file, on_thread=not self.parent.is_in_lock_step)
        if self.factory.is_new(self.parent):
            self._write(msgspec.json.encode({TAG: START, "node": self.parent.name}))

    def record(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Write the page; report one that cannot be written and continue with the next."""
        page: Page = task.val_list[0]
        if self._writer is not None:
            try:
                self._write(_as_line(page))
            except SnrError as error:
                self._refuse(page, error)
        return None

    def terminate(self) -> None:
        """Close the file."""
        if self._writer is not None:
            self._writer.close()
            if self._writer.failure:
                self._report(self._writer.failure)
            self._writer = None
        for key, count in self._refused.items():
            if count > 1:
                self.parent.add_note(f"'{self.name}' could not record {count} pages '{key}'.")

    def _write(self, line: bytes) -> None:
        """Write a line; a disk that fails ends the recording, but not the node."""
        if self._writer is not None:
            self._writer.put(line)
            if self._writer.failure:
                self._report(self._writer.failure)
                self._writer.close()
                self._writer = None

    def _report(self, reason: str) -> None:
        text = f"'{self.name}' ended its recording {self.factory.path} at t = {self.get_time_s():.3f} s: {reason}."
        self.log.error(text)
        self.parent.add_note(text)

    def _refuse(self, page: Page, error: SnrError) -> None:
        self._refused[page.key] += 1
        if self._refused[page.key] == 1:  # logged once per key: the next page would fail in the same way
            text = f"'{self.name}' could not record page '{page.key}' at t = {self.get_time_s():.3f} s: {error}"
            self.log.error(text)
            self.parent.add_note(text)


def _as_keys(keys: object) -> list[DataKey]:
    if isinstance(keys, str):
        return [keys]
    fix = '"depth" or ["depth", "heading"].'
    if not isinstance(keys, Iterable):
        raise ConfigError(f"A RecorderEndpointFactory's keys are {repr(keys)[:80]}.", fix=fix)
    listed = list(keys)
    for key in listed:
        if not isinstance(key, str):
            raise ConfigError(f"A RecorderEndpointFactory's keys hold {repr(key)[:80]}, which is not a key.", fix=fix)
    return listed


def _finish_cut_line(file: FileIO) -> None:
    """End a truncated last line, so that the next write starts a new line."""
    if file.seek(0, os.SEEK_END):
        file.seek(-1, os.SEEK_END)
        if file.read(1) != b"\n":
            file.write(b"\n")


def _as_line(page: Page) -> bytes:
    """Return the page as JSON that decodes to an equal page.

    Raises:
        ValueEncodingError: the page contains a value that cannot be encoded.
    """
    try:
        line = page.serialize()
    except SnrError:
        raise
    except Exception as error:  # an object that cannot even be inspected
        raise ValueEncodingError(f"Its data cannot be read: {type(error).__name__}: {error}.") from error
    if _OBJECT in line:
        Page.deserialize(line)  # raises an error that names the class and what to store instead
    return line
