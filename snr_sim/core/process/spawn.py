"""A new Python process that runs one function of snr_sim: start, send, receive, end.

Loops, roles and graders in processes use it, and supervisors of outputs. It uses `subprocess` and
not `multiprocessing` for three reasons: the output is captured from the first byte, even if the imports fail; there is
no additional tracker process; and the process starts with signals blocked, in its own process group, so that Ctrl-C
at a terminal reaches only the parent, which shuts it down gracefully. The two exchange bytes on a socket pair. If
either side dies for any reason, the other one reads the end of that stream. Linux and macOS.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection, Pipe, wait

from snr_sim.core.process import spawned
from snr_sim.core.process.messages import MessageLine
from snr_sim.core.standard_streams import forward_line, open_closed_streams
from snr_sim.prelude.errors import ConfigError

LAST_LINES = 20
_MAX_LINE_BYTES = 64 * 1024  # a longer line is forwarded in pieces
# Time for a process to end after it has closed its connection.
_END_S = 1.0


class OutputReader:
    """Reader of one output of a process; `forward` gets each line, without its end."""

    def __init__(self, pipe: int, forward: Callable[[str], None]) -> None:
        self._pipe = pipe
        self._forward = forward
        self._rest = b""

    def fileno(self) -> int:
        """Return the pipe, to wait for."""
        return self._pipe

    def read(self) -> bool:
        """Forward the available output; return False at its end."""
        data = os.read(self._pipe, _MAX_LINE_BYTES)
        *lines, self._rest = (self._rest + data).split(b"\n")
        if self._rest and (not data or len(self._rest) >= _MAX_LINE_BYTES):
            lines.append(self._rest)
            self._rest = b""
        for line in lines:
            self._forward(line.decode(errors="replace").rstrip("\r"))
        return bool(data)


class SpawnedProcess:
    """A running child process that executes a function of snr_sim.

    Args:
        target: "module:function" of snr_sim; called there with the `Connection` to the parent.
        fds: further file descriptors that it inherits, under the same numbers.
        out: gets its lines on stdout; if not given, they go unchanged to our own stdout.
        err: gets its lines on stderr; if not given, they go to our own stderr.

    Raises:
        ConfigError: processes cannot be started here.
    """

    def __init__(
        self,
        target: str,
        fds: Sequence[int] = (),
        out: Callable[[str], None] | None = None,
        err: Callable[[str], None] | None = None,
    ) -> None:
        self.last: deque[str] = deque(maxlen=LAST_LINES)
        self._err = err or partial(forward_line, sys.stderr)
        self._process, line = start_process(
            target, fds, stdout=None if out is None else subprocess.PIPE, stderr=subprocess.PIPE
        )
        # Without pidfd only the end of the connection shows it, which a forked grandchild may keep open.
        self._pidfd = os.pidfd_open(self.pid) if hasattr(os, "pidfd_open") else None
        self.line: MessageLine = MessageLine(line, pidfd=self._pidfd)
        self._outputs = [
            OutputReader(pipe.fileno(), forward)
            for pipe, forward in ((self._process.stdout, out), (self._process.stderr, self._keep))
            if pipe is not None and forward is not None
        ]

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def _keep(self, line: str) -> None:
        self.last.append(line)
        self._err(line)

    def send(self, message: bytes) -> bool:
        """Send a message; return whether the process was running to receive it. Waits while the buffer is full."""
        return self.line.send_bytes(message)

    def receive_loop(self, on_message: Callable[[bytes], None]) -> int:
        """Pass on messages until the process has ended; return its exit status, or minus a signal's number."""
        line, outputs = self.line.fileno(), {output.fileno(): output for output in self._outputs}
        ends = [line] if self._pidfd is None else [line, self._pidfd]
        while True:
            ready = wait([*ends, *outputs])
            for pipe in [pipe for pipe in outputs if pipe in ready]:
                if not outputs[pipe].read():
                    del outputs[pipe]
            if line in ready:
                try:
                    message = self.line.receive_bytes()
                except (EOFError, OSError):
                    break
                try:
                    on_message(message)
                except EOFError:  # it ended in the middle of an array
                    break
            elif self._pidfd in ready:
                break
        return self._reap()

    def _reap(self) -> int:
        try:
            status = self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self.kill()
            status = self._process.wait()
        # Its last output. Do not read until the end of the pipe: a process that it has started may hold that open.
        for output in self._outputs:
            while wait([output.fileno()], 0) and output.read():
                pass
        self.line.close()
        for pipe in (self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()
        if self._pidfd is not None:
            os.close(self._pidfd)
        return status

    def kill(self) -> None:
        """Kill it at once."""
        with suppress(ProcessLookupError):
            self._process.kill()


def start_process(
    target: str, fds: Sequence[int] = (), stdout: int | None = None, stderr: int | None = None
) -> tuple[subprocess.Popen[bytes], Connection]:
    """Return a new Python process that runs one function of snr_sim, and our end of the connection to it.

    Arguments are as for `SpawnedProcess` and `subprocess.Popen`.

    Raises:
        ConfigError: processes cannot be started here.
    """
    if spawned.is_reading_program:
        raise ConfigError(
            "The program starts a process again while that process still reads the program.",
            fix="let what runs the robot stand under: if __name__ == '__main__':",
        )
    if os.name != "posix":
        raise ConfigError("Loops and roles in processes need Linux or macOS.", fix="let them be threads here.")
    open_closed_streams()  # else the connection would get their numbers
    near, far = Pipe()
    # With signals blocked: see `spawned.unblock_signals`.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, spawned.BLOCKED_SIGNALS)
    try:
        with far:
            process = subprocess.Popen(
                [sys.executable, "-c", spawned.command(target, far.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=stdout,
                stderr=stderr,
                pass_fds=(far.fileno(), *fds),
                process_group=0,
            )
    except BaseException:
        near.close()
        raise
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return process, near


def describe_exit(status: int) -> str:
    """Return an exit status as text.

    >>> describe_exit(3), describe_exit(-9)
    ('ended with exit status 3', 'was ended by SIGKILL')
    """
    if status >= 0:
        return f"ended with exit status {status}"
    try:
        return f"was ended by {signal.Signals(-status).name}"
    except ValueError:
        return f"was ended by signal {-status}"
