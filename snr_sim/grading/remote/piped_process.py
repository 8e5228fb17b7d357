"""Student's process where only sockets can be waited for, as on Windows: for practice, as it is not isolated.

It gets requests on its stdin and answers on its stdout, which a thread reads. What it prints goes to a file: all that
was printed before an answer is there when the answer comes.
"""

from __future__ import annotations

import io
import os
import tempfile
import threading
from contextlib import suppress
from pathlib import Path
from queue import Empty

from snr_sim.grading.remote.cpu_timeout import CpuTimeout
from snr_sim.grading.remote.launch import start_process
from snr_sim.grading.remote.protocol import PIPES
from snr_sim.grading.remote.student_process import CHUNK, StudentProcess
from snr_sim.grading.sandbox.sandbox import Limits
from snr_sim.prelude.waiting import TimedQueue


class PipedProcess(StudentProcess):
    """A process that holds one submission. It counts its CPU time itself; its memory is not limited."""

    def __init__(self, folder: Path, limits: Limits) -> None:
        self._prepare(limits, None)
        number, self._file = tempfile.mkstemp(prefix="snr-printed-")
        self._printing = io.FileIO(self._file)  # a place of its own in the file
        with open(number, "ab") as printing:
            self._piped = self._process = start_process(folder, "none", PIPES, limits, prints_to=printing)
        self._answers: TimedQueue[bytes] = TimedQueue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self._piped.stdout is not None
        with self._piped.stdout as answers, suppress(OSError):
            while data := os.read(answers.fileno(), CHUNK):
                self._answers.put(data)
        self._answers.put(b"")

    def _send(self, line: bytes, timeout: CpuTimeout) -> None:
        assert self._piped.stdin is not None
        with suppress(OSError):  # it has ended; the caller notices when it reads the answer
            self._piped.stdin.write(line)
            self._piped.stdin.flush()

    def _receive_some(self, timeout: CpuTimeout) -> bytes:
        while True:
            try:
                return self._answers.get(timeout.poll_period_s)
            except Empty:
                self._check_timeout(timeout)
            finally:
                self._read_output()

    def _read_output(self) -> None:
        while data := self._printing.read(CHUNK):
            self._keep(data)

    def kill(self) -> None:
        """End it; processes that it has started continue, as nothing here groups them."""
        self._piped.kill()

    def close(self) -> None:
        """End it and release everything, safe to call twice; raise SubmissionError if it had printed too much."""
        if self._printing.closed:
            return
        try:
            self.kill()
            self._piped.wait()
            self._read_output()
        finally:
            self._printing.close()
            with suppress(OSError):  # a process that it has started may still print; the rest of a request is unsent
                Path(self._file).unlink()
                assert self._piped.stdin is not None
                self._piped.stdin.close()
