"""Standard output and error that wait for 0.05 s at most.

A robot must not stop because its terminal was stopped with Ctrl-S, or because its output is a pipe that is not read.
"""

from __future__ import annotations

import io
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO

MAX_CHARS = 1 << 20  # that wait; more is dropped
WAIT_S = 0.05  # maximum time that a flush waits, once until the output is taken again
LINGER_S = 0.5  # maximum time that the end of a run waits for what is still to be printed
RETRY_S = 0.01  # for a terminal that does not block but refuses


@contextmanager
def unblocked_output() -> Iterator[None]:
    """Let a thread write what is printed in the block. Text that a terminal or a pipe does not take is dropped."""
    if isinstance(sys.stdout, UnblockedStream) or isinstance(sys.stderr, UnblockedStream):
        yield  # of a node on another thread
        return
    writer = _Writer()
    own = {
        name: UnblockedStream(stream, writer)
        for name in ("stdout", "stderr")
        if _has_file(stream := getattr(sys, name))
    }
    for name, stream in own.items():
        setattr(sys, name, stream)
    try:
        yield
    finally:
        for name, stream in own.items():
            if getattr(sys, name) is stream:
                setattr(sys, name, stream.target)
        writer.close(own.values())


def _has_file(stream: TextIO | None) -> bool:
    """Return whether a stream has a file that can block; others are in memory."""
    try:
        return stream is not None and stream.fileno() >= 0
    except (OSError, ValueError, AttributeError):
        return False


class UnblockedStream(io.TextIOBase):
    """Stream that passes text to the thread of a writer; to its target after the run, and in forked processes."""

    def __init__(self, target: TextIO, writer: _Writer) -> None:
        self.target: TextIO = target
        self.dropped_lines: int = 0
        self.is_dropping: bool = False  # up to the end of a line
        self.is_in_line: bool = False  # the text so far does not end with the end of a line
        self._is_line_buffered: bool = getattr(target, "line_buffering", False)
        self._writer = writer
        target.flush()

    def write(self, text: str) -> int:
        """Print text later; return the number of characters."""
        if self._writer.is_working:
            self._writer.put(self, text)
            if self._is_line_buffered and text.endswith("\n"):
                self._writer.wait()
            return len(text)
        return self.target.write(text)

    def flush(self) -> None:
        """Wait until the text is written, so that the last words of a program that crashes are not lost."""
        if self._writer.is_working:
            self._writer.wait()
        else:
            self.target.flush()

    def close(self) -> None:
        """Do nothing: the target belongs to the program."""

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Return the target's encoding, which libraries read before they draw."""
        return self.target.encoding

    def __getattr__(self, name: str) -> Any:  # buffer, reconfigure: what is written there may block
        return getattr(self.target, name)

    def fileno(self) -> int:
        """Return the descriptor, as some libraries ask for it."""
        return self.target.fileno()

    def isatty(self) -> bool:
        """Return whether it is a terminal."""
        return self.target.isatty()


class _Writer:
    """Thread that writes text of several streams in order.

    It writes to their descriptors: while a stream's own `write` blocks it holds a lock, at which Python aborts at exit.
    """

    def __init__(self) -> None:
        self._waiting: deque[tuple[TextIO, str]] = deque()
        self._chars = 0
        self._is_blocked = False
        self._is_closed = False
        self._changed = threading.Condition()
        self._process = os.getpid()
        self._thread = threading.Thread(target=self._run, name="output", daemon=True)
        self._thread.start()

    @property
    def is_working(self) -> bool:
        """Whether there is a thread that writes."""
        return not self._is_closed and os.getpid() == self._process

    def put(self, stream: UnblockedStream, text: str) -> None:
        """Add text of a stream, or drop it and count its lines. A line that has begun is dropped only if it is long.

        Once lines are dropped, they are until half of the text that waits is written: few long gaps, each noted once.
        """
        max_chars = MAX_CHARS * (2 if stream.is_in_line else 0.5 if stream.dropped_lines else 1)
        with self._changed:
            if stream.is_dropping or self._chars + len(text) > max_chars:
                stream.dropped_lines += text.count("\n")
                stream.is_dropping = not text.endswith("\n")
            else:
                self._note_dropped(stream)
                stream.is_in_line = not text.endswith("\n")
                self._add(stream, text)

    def wait(self) -> None:
        """Wait until everything is written, at most `WAIT_S`; not at all if the output was blocked the last time."""
        with self._changed:
            if not self._is_blocked:
                self._is_blocked = not self._changed.wait_for(lambda: not self._chars, WAIT_S)

    def _add(self, stream: UnblockedStream, text: str) -> None:
        self._chars += len(text)
        self._waiting.append((stream.target, text))
        self._changed.notify_all()

    def _note_dropped(self, stream: UnblockedStream) -> None:
        if stream.dropped_lines:
            self._add(stream, f"({stream.dropped_lines} lines are missing here: the output was blocked.)\n")
            stream.dropped_lines = 0

    def close(self, streams: Iterable[UnblockedStream]) -> None:
        """Stop to take text, and wait until the rest is written, at most `LINGER_S`."""
        with self._changed:
            for stream in streams:
                self._note_dropped(stream)
            self._is_closed = True
            self._changed.notify_all()
        self._thread.join(LINGER_S)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._is_closed)
                if not self._waiting:
                    return
                stream, text = self._waiting.popleft()
            _write(stream, text)
            with self._changed:
                self._chars -= len(text)
                if not self._chars:
                    self._is_blocked = False
                    self._changed.notify_all()


def _write(stream: TextIO, text: str) -> None:
    """Write to the file of a stream; do nothing if it does not take the text."""
    try:
        data = text.replace("\n", os.linesep).encode(stream.encoding, stream.errors or "strict")
        while data:
            try:
                data = data[os.write(stream.fileno(), data) :]
            except BlockingIOError:
                time.sleep(RETRY_S)
    except (OSError, ValueError):
        pass  # as in `print_line`: a full disk, a reader that has gone
