"""Student's process where only sockets can be waited for, as on Windows: for practice, as it is not isolated.

It gets requests on its stdin, answers on its stdout, and prints on its stderr; a thread reads each of the two.
"""

from __future__ import annotations

import os
import select
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO

from snr_sim.grading.remote.child_process import CHUNK, ChildProcess
from snr_sim.grading.remote.launch import start_process
from snr_sim.grading.remote.nursery import Nursery
from snr_sim.grading.remote.patience import END_S, LOOK_S, Patience
from snr_sim.grading.remote.protocol import PIPES
from snr_sim.grading.reports.results import Isolation
from snr_sim.grading.sandbox.sandbox import Limits

CAN_POLL_PIPES = hasattr(select, "poll")


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
        self._readers = [
            threading.Thread(target=self._read, args=ends, daemon=True)
            for ends in ((self._piped.stdout, self._answers), (self._piped.stderr, self._prints))
        ]
        for reader in self._readers:
            reader.start()

    def _read(self, pipe: IO[bytes], came: SimpleQueue[bytes]) -> None:
        data = b"-"
        while data:
            try:
                data = os.read(pipe.fileno(), CHUNK)
            except OSError:
                data = b""
            came.put(data)
            self._something.set()

    def _send(self, line: bytes, patience: Patience) -> None:
        assert self._piped.stdin is not None
        with suppress(OSError):  # it has ended; the caller notices when it reads the answer
            self._piped.stdin.write(line)
            self._piped.stdin.flush()

    def _received(self, patience: Patience) -> bytes:
        while True:
            self._something.clear()
            self._hear_output()
            with suppress(Empty):
                return self._answers.get_nowait()
            if not self._something.wait(LOOK_S):
                self._look(patience)

    def _hear_output(self) -> None:
        with suppress(Empty):
            while data := self._prints.get_nowait():
                self._keep(data)

    def kill(self) -> None:
        """End it; processes that it has started continue, as nothing here groups them."""
        self._piped.kill()

    def close(self) -> None:
        """End it and release everything. Safe to call twice.

        Raises:
            Misbehaved: it had printed too much.
        """
        assert self._piped.stdin is not None
        if self._piped.stdin.closed:
            return
        try:
            self.kill()
            self._piped.wait()
            for reader in self._readers:
                reader.join(END_S)
            self._hear_output()
        finally:
            with suppress(OSError):  # the unsent rest of a request is still buffered
                self._piped.stdin.close()


def begin_process(
    folder: Path, isolation: Isolation, limits: Limits, readable: Sequence[Path], nursery: Nursery | None
) -> ChildProcess:
    """Return a process that holds one submission; arguments as of `ChildProcess`.

    Raises:
        LabFault: it cannot be started.
    """
    if CAN_POLL_PIPES:
        return ChildProcess(folder, isolation, limits, readable, nursery)
    return PipedProcess(folder, isolation, limits)
