"""Grader's end of a student's process: starts it, sends requests, reads what it prints, and ends it.

Every wait has a limit and all data from the process are bounded: by bytes and by the CPU time that the kernel counts,
so that a program ends in the same way on a slow computer; wall time is only the last resort.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from snr_sim.grading.lab.verdicts import GraderError, SubmissionError
from snr_sim.grading.remote import protocol
from snr_sim.grading.remote.cpu_timeout import END_TIMEOUT_S, CpuTimeout, process_state, wait_for_hangup
from snr_sim.grading.remote.fork_server import ForkedChild, ForkServer
from snr_sim.grading.remote.launch import start_process
from snr_sim.grading.remote.sent_code import code_to_send
from snr_sim.grading.reports.results import Isolation
from snr_sim.grading.sandbox.child_limits import TIME_UP_STATUS
from snr_sim.grading.sandbox.confiner import Confiner
from snr_sim.grading.sandbox.sandbox import Limits

CALL_CPU_S = 10.0  # for a call of a lab's check, or a parser
KEPT_BYTES = 8_000  # of its output
MAX_PRINTED_BYTES = 1 << 20
CHUNK = 1 << 16
_NEWLINE = 10
_START_CPU_S = 10.0  # of Python with snr_sim: about 0.2


class StudentProcess:
    """A process that holds one submission, whose folder is its current folder.

    Args:
        limits: CPU time, memory and files that it may use.
        readable: further folders it may read: of robots.
        fork_server: fork server that copies it, if it can.
    """

    def __init__(
        self,
        folder: Path,
        isolation: Isolation,
        limits: Limits,
        readable: Sequence[Path] = (),
        fork_server: ForkServer | None = None,
    ) -> None:
        self._prepare(limits, Confiner() if isolation == "confined" else None)
        here, there = socket.socketpair()
        self._socket = here
        self._process: subprocess.Popen[bytes] | ForkedChild
        here.setblocking(False)
        with there:
            try:
                forked = fork_server and fork_server.fork(folder, isolation, there.fileno(), readable)
                self._process = forked or start_process(
                    folder, isolation, there.fileno(), limits, readable, self._confiner
                )
            except BaseException:
                here.close()
                if self._confiner is not None:
                    self._confiner.close()
                raise
        # A copy in a sandbox is the first process of a namespace, which ends with it.
        self._has_group = isolation != "sandbox" or forked is None
        assert self._process.stdout is not None
        self._output = self._process.stdout.fileno()
        os.set_blocking(self._output, False)
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)
        self._poll.register(self._output, select.POLLIN)
        self._is_output_open = True
        self._line = here.fileno()
        self._event = select.POLLIN

    def _prepare(self, limits: Limits, confiner: Confiner | None) -> None:
        self._limits = limits
        self._n = 0
        self._received_bytes = bytearray()
        self._kept = bytearray()
        self._printed_bytes = 0
        self._confiner = confiner

    @property
    def printed(self) -> str:
        """Its output, up to the limit."""
        text = bytes(self._kept).decode(errors="replace")
        return text + "\n..." if self._printed_bytes > len(self._kept) else text

    @property
    def cpu_time_s(self) -> float | None:
        """CPU time that the kernel has counted for it, in steps of about 10 ms; None where it is not reported."""
        state = process_state(self._process.pid)
        return None if state is None else state[1]

    def ask(self, verb: protocol.Verb, cpu_s: float) -> protocol.CallResponse:
        """Send a request, return the answer; the child itself counts its CPU time, and the kernel enforces the limit.

        Raises:
            SubmissionError: it ended, was too slow, printed too much, or sent an answer to another request.
            ProtocolError: the answer is not valid.
            GraderError: it could not be started.
        """
        if self._n == 0:
            self._handshake()
        return self._exchange(verb, cpu_s)

    def parse(self, parser: Callable[[bytes], Any], data: bytes) -> Any:
        """Return the result of a parser of snr_sim or the lab; errors as of `ask`."""
        return protocol.plain_value(self.ask(protocol.Parse(code_to_send(parser), data), CALL_CPU_S).result())

    def _handshake(self) -> None:
        """Wait for its first answer, before it reads anything of the student's: a failure here is the grader's."""
        try:
            if self._confiner is not None:
                self._receive_listener(self._confiner)
            self._exchange(protocol.Hello(), _START_CPU_S)
        except SubmissionError as error:
            raise GraderError(
                f"A student's process could not be started. {error.message} {self.printed}".rstrip(),
                fix="is the computer out of memory or processes? Grade with fewer --jobs.",
            ) from error

    def _receive_listener(self, confiner: Confiner) -> None:
        """Take the descriptor that a confined process sends when its walls are up: of its requests for new files."""
        timeout = CpuTimeout(self._limits.wall_s(_START_CPU_S), _START_CPU_S, self._process.pid)
        self._wait(timeout, select.POLLIN)
        data, sent, _, _ = socket.recv_fds(self._socket, 1, 1)
        if data != b"\n" or len(sent) != 1:
            raise self._exit_error()
        (confiner.listener,) = sent
        self._poll.register(confiner.listener, select.POLLIN)

    def _exchange(self, verb: protocol.Verb, cpu_s: float) -> protocol.CallResponse:
        self._n += 1
        timeout = CpuTimeout(self._limits.wall_s(cpu_s), cpu_s, self._process.pid)
        self._send(protocol.encode(protocol.CallRequest(self._n, cpu_s, verb)) + b"\n", timeout)
        answer = protocol.decode_response(self._receive(timeout))
        if answer.n != self._n:
            self.kill()
            raise SubmissionError(
                f"{protocol.BROKEN}: it answered another request.",
                "Do not use file descriptors that your program has not opened.",
            )
        return answer

    def _send(self, line: bytes, timeout: CpuTimeout) -> None:
        view = memoryview(line)
        while True:
            try:
                view = view[self._socket.send(view) :]
            except BlockingIOError:
                self._wait(timeout, select.POLLOUT)
            except OSError:
                return  # it has ended; the caller notices when it reads the answer
            if not view:
                return

    def _receive(self, timeout: CpuTimeout) -> bytes:
        buffer = self._received_bytes
        while True:
            data = self._receive_some(timeout)
            if not data:
                raise self._exit_error()
            buffer += data
            if data[-1] == _NEWLINE:
                line = bytes(buffer)
                buffer.clear()
                return line
            if len(buffer) > protocol.MAX_RESPONSE_BYTES:
                self.kill()
                raise SubmissionError(
                    f"It answered with more than {protocol.MAX_RESPONSE_BYTES} bytes.",
                    "Return what was asked for, and no more.",
                )

    def _receive_some(self, timeout: CpuTimeout) -> bytes:
        """Return the bytes received of an answer, as soon as there are some; b"" if the process has ended."""
        while True:
            self._wait(timeout, select.POLLIN)
            try:
                return self._socket.recv(CHUNK)
            except BlockingIOError:
                continue
            except OSError:
                return b""

    def _wait(self, timeout: CpuTimeout, event: int) -> None:
        """Wait until the socket is ready, reading the output meanwhile; raise SubmissionError to give up."""
        if event != self._event:
            self._event = event
            self._poll.modify(self._socket, event)
        while True:
            ready = self._poll.poll(timeout.poll_period_s * 1000.0)
            if len(ready) == 1 and ready[0][0] == self._line:
                return
            for fd, events in ready:
                if fd == self._output:
                    self._read_output()
                elif fd != self._line:
                    self._on_listener(fd, events)
            if any(fd == self._line for fd, _ in ready):
                return
            self._check_timeout(timeout)

    def _check_timeout(self, timeout: CpuTimeout) -> None:
        """End a process that does not answer when waiting longer is useless; raise SubmissionError then."""
        if not timeout.is_over():
            return
        self.kill()
        if timeout.is_cpu_used_up:
            raise _cpu_limit_error()
        raise SubmissionError(
            "It has not answered, and was ended.",
            "Your program waits for something that does not come: an input, a lock, a line that is never sent?",
            expected="an answer",
            actual="none",
        )

    def _on_listener(self, listener: int, events: int) -> None:
        assert self._confiner is not None
        if not events & select.POLLIN or not self._confiner.answer():
            self._poll.unregister(listener)

    def _read_output(self) -> None:
        while self._is_output_open:
            try:
                data = os.read(self._output, CHUNK)
            except BlockingIOError:
                return
            if not data:
                self._poll.unregister(self._output)
                self._is_output_open = False
                return
            self._keep(data)

    def _keep(self, data: bytes) -> None:
        """Keep the start of its output, and count the rest; raise SubmissionError, once, if it printed too much."""
        was_within_limit = self._printed_bytes <= MAX_PRINTED_BYTES
        self._printed_bytes += len(data)
        self._kept += data[: max(0, KEPT_BYTES - len(self._kept))]
        if was_within_limit and self._printed_bytes > MAX_PRINTED_BYTES:
            self._is_output_open = False
            self.kill()
            raise SubmissionError(
                "It printed more than a megabyte, and was ended.",
                "Take out the print in what is called again and again.",
                expected=f"at most {MAX_PRINTED_BYTES} bytes",
            )

    def _exit_error(self) -> SubmissionError:
        """Return the error for a process that ended instead of answering."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(END_TIMEOUT_S)
        status = self._process.poll()
        with suppress(SubmissionError):
            self._read_output()
        self.kill()
        number = -status if status is not None and status < 0 else (status or 0) - 128
        name = signal.Signals(number).name if number in set(signal.Signals) else ""
        if name in ("SIGXCPU", "SIGPROF", "SIGKILL") or status == TIME_UP_STATUS:
            return _cpu_limit_error()
        if name in ("SIGSEGV", "SIGABRT", "SIGBUS", "SIGFPE"):
            return SubmissionError(f"It crashed with {name}.", "Did it run out of memory?")
        return SubmissionError(
            f"It ended with exit status {status} instead of answering.",
            "Do not end the program: no exit() and no quit(). Return from your function instead.",
        )

    def kill(self) -> None:
        """End it, with all that it started."""
        if self._has_group:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
        with suppress(ProcessLookupError):
            self._process.kill()

    def close(self) -> None:
        """End it and release everything, safe to call twice; raise SubmissionError if it had printed too much."""
        if self._socket.fileno() < 0:
            return
        try:
            self.kill()
            self._process.wait()
            wait_for_hangup(self._socket)  # with a sandbox, its namespace is dead then
            if self._confiner is not None:
                self._confiner.close()
            self._read_output()
        finally:
            self._socket.close()
            assert self._process.stdout is not None
            self._process.stdout.close()


def _cpu_limit_error() -> SubmissionError:
    return SubmissionError(
        "It used up its CPU time or its memory, and was ended.",
        "Is there a loop without an end, or a list that grows?",
    )
