"""Student's process where only sockets can be waited for, as on Windows: for practice, as it is not isolated.

It gets requests on its stdin, answers on its stdout, and prints on its stderr; a thread reads each of the two. A mark
in the output says that all of it which comes before an answer has been read.
"""

from __future__ import annotations

import os
import select
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO

from snr_sim.grading.remote.child_process import CHUNK, ChildProcess
from snr_sim.grading.remote.cpu_timeout import END_TIMEOUT_S, POLL_PERIOD_S, CpuTimeout
from snr_sim.grading.remote.fork_server import ForkServer
from snr_sim.grading.remote.launch import start_process
from snr_sim.grading.remote.protocol import END_OF_OUTPUT, PIPES
from snr_sim.grading.reports.results import Isolation
from snr_sim.grading.sandbox.sandbox import Limits

MARK_TIMEOUT_S = 1.0  # for a mark that a program has prevented
CAN_POLL_PIPES: bool = hasattr(select, "poll")


class PipedProcess(ChildProcess):
    """A process that holds one submission.

    Args:
        folder: of the submission; it is the process' current folder.
        limits: CPU time, memory and files that it may use. It counts its CPU time itself; its memory is not limited.
    """

    def __init__(self, folder: Path, isolation: Isolation, limits: Limits) -> None:
        assert isolation == "none"
        self._prepare(limits, None)
        self._piped = start_process(folder, "none", PIPES, limits)
        self._process = self._piped
        assert self._piped.stdout is not None
        assert self._piped.stderr is not None
        self._answers: SimpleQueue[bytes] = SimpleQueue()
        self._prints: SimpleQueue[bytes] = SimpleQueue()
        self._something = threading.Event()
        self._unmarked = b""  # the end of the output, which may be the beginning of a mark
        self._marks = 0  # that have come, less answers
        self._has_marks = True  # until one does not come: a program may close its output
        self._readers = [
            threading.Thread(target=self._read, args=ends, daemon=True)
            for ends in ((self._piped.stdout, self._answers), (self._piped.stderr, self._prints))
        ]
        for reader in self._readers:
            reader.start()

    def _read(self, pipe: IO[bytes], queue: SimpleQueue[bytes]) -> None:
        data = b"-"
        while data:
            try:
                data = os.read(pipe.fileno(), CHUNK)
            except OSError:
                data = b""
            queue.put(data)
            self._something.set()

    def _send(self, line: bytes, timeout: CpuTimeout) -> None:
        assert self._piped.stdin is not None
        with suppress(OSError):  # it has ended; the caller notices when it reads the answer
            self._piped.stdin.write(line)
            self._piped.stdin.flush()

    def _receive_some(self, timeout: CpuTimeout) -> bytes:
        while True:
            self._something.clear()
            self._read_output()
            with suppress(Empty):
                data = self._answers.get_nowait()
                if data.endswith(b"\n"):
                    self._wait_for_output()
                return data
            if not self._something.wait(POLL_PERIOD_S):
                self._check_timeout(timeout)

    def _wait_for_output(self) -> None:
        """Wait until the output before an answer has been read."""
        self._marks -= 1
        until_s = time.monotonic() + MARK_TIMEOUT_S
        while self._has_marks and self._marks < 0:
            self._something.clear()
            self._read_output()
            if self._marks < 0 and not self._something.wait(POLL_PERIOD_S):
                self._has_marks = time.monotonic() < until_s

    def _read_output(self) -> None:
        with suppress(Empty):
            while data := self._prints.get_nowait():
                *parts, rest = (self._unmarked + data).split(END_OF_OUTPUT)
                self._marks += len(parts)
                held = next((n for n in range(len(END_OF_OUTPUT) - 1, 0, -1) if rest.endswith(END_OF_OUTPUT[:n])), 0)
                self._unmarked = rest[len(rest) - held :]
                self._keep(b"".join([*parts, rest[: len(rest) - held]]))
            self._has_marks = False  # the output is closed
            self._keep(self._unmarked)
            self._unmarked = b""

    def kill(self) -> None:
        """End it; processes that it has started continue, as nothing here groups them."""
        self._piped.kill()

    def close(self) -> None:
        """End it and release everything. Safe to call twice.

        Raises:
            SubmissionError: it had printed too much.
        """
        assert self._piped.stdin is not None
        if self._piped.stdin.closed:
            return
        try:
            self.kill()
            self._piped.wait()
            for reader in self._readers:
                reader.join(END_TIMEOUT_S)
            self._read_output()
        finally:
            with suppress(OSError):  # the unsent rest of a request is still buffered
                self._piped.stdin.close()


def begin_process(
    folder: Path, isolation: Isolation, limits: Limits, readable: Sequence[Path], fork_server: ForkServer | None
) -> ChildProcess:
    """Return a process that holds one submission; arguments as of `ChildProcess`.

    Raises:
        GraderError: it cannot be started.
    """
    if CAN_POLL_PIPES:
        return ChildProcess(folder, isolation, limits, readable, fork_server)
    return PipedProcess(folder, isolation, limits)
