"""Fork server kept for many cases: each case gets a copy of its process, which has imported what all of them need.

    grader -- "fork", line, output --> fork_server_process.py (nothing of the student's) -- fork --> child.py, per case
           <-- a handle of the copy --

In a sandbox no copy can reach another. It shows a folder of the grader's as the submission: it holds one submission at
a time, and is emptied before the next is copied in. So even a new submission needs no start of Python. Only for root: a
copy that belonged to the same user as its original could end or change that. For other users each case gets a fresh
sandbox.

Without isolation (practice, on Linux) copies differ from fresh processes in nothing but the time that they take.
"""

from __future__ import annotations

import io
import os
import select
import shutil
import signal
import socket
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from snr_sim.grading.lab.verdicts import GraderError
from snr_sim.grading.remote.cpu_timeout import wait_for_hangup
from snr_sim.grading.remote.launch import copy_world_readable, start_process
from snr_sim.grading.remote.protocol import FORK, MAX_WORD_BYTES, NUMBER, USED_UP, WAIT
from snr_sim.grading.reports.results import Isolation
from snr_sim.grading.sandbox.sandbox import SUBMISSION_FOLDER, Limits, is_root

_RESPONSE_TIMEOUT_S = 130.0  # wall time; a copy takes a millisecond, and a start of Python 0.2 s


class ForkedChild:
    """A student's process that is a copy; with the part of `subprocess.Popen` that `StudentProcess` uses."""

    def __init__(self, fork_server: ForkServer, number: int, death: int, output: int) -> None:
        self._fork_server = fork_server
        self._number = number  # for its fork server
        self._death = death  # readable once it is dead
        self.stdout: io.FileIO = io.FileIO(output)
        fdinfo = Path(f"/proc/self/fdinfo/{death}").read_text()
        self.pid: int = int(fdinfo.partition("Pid:")[2].split()[0])  # for /proc only; the handle gets signals

    def kill(self) -> None:
        """End it, with its namespace."""
        if self._death >= 0:
            with suppress(ProcessLookupError):
                signal.pidfd_send_signal(self._death, signal.SIGKILL)

    def poll(self) -> int | None:
        """Return its exit status, in the form of `subprocess`; None if it still runs. Ask once."""
        self.wait(0.0)
        return None if self._death >= 0 else self._fork_server.exit_status(self._number)

    def wait(self, timeout: float | None = None) -> None:
        """Wait until it has ended [s]."""
        if self._death < 0:
            return
        dead = select.poll()
        dead.register(self._death, select.POLLIN)
        if dead.poll(None if timeout is None else timeout * 1000.0):
            os.close(self._death)
            self._death = -1
            self._fork_server.running.discard(self)


class ForkServer:
    """Copies for the cases of one submission after the other. Close it in the end, or use `with`.

    Isolation and limits are those of each copy; a sandbox has one at a time.
    """

    def __init__(self, isolation: Isolation, limits: Limits) -> None:
        self._limits = limits
        self._isolation: Isolation = isolation
        self._is_enabled = is_root() if isolation == "sandbox" else isolation == "none" and _has_handles()
        self._shown: Path | None = None  # the folder that the sandbox shows as the submission
        self._submission: Path | None = None
        self._is_loaded = False
        self._process: subprocess.Popen[bytes] | None = None
        self._socket: socket.socket | None = None
        self.running: set[ForkedChild] = set()  # copies that have not been waited for

    def __enter__(self) -> ForkServer:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    @contextmanager
    def with_submission(self, folder: Path) -> Iterator[None]:
        """Have copies hold the submission in a folder, until the end; then nothing is left of it."""
        self._submission = folder.resolve()
        try:
            yield
        finally:
            self._submission, self._is_loaded = None, False
            if self.running:
                self._end()  # the last copy was not ended by its user
            if self._shown is not None:
                _empty(self._shown)

    def fork(self, folder: Path, isolation: Isolation, line: int, readable: Sequence[Path]) -> ForkedChild | None:
        """Return a new student's process that answers on a line; None if there is none to be had.

        A copy has the isolation of its original; in a sandbox the submission that is held, and no folders besides.

        Raises:
            GraderError: the fork server cannot be started, or does not answer.
        """
        if not self._is_enabled or isolation != self._isolation:
            return None
        if self._isolation == "sandbox":
            if self.running or readable or folder != self._submission:
                return None
            if not self._is_loaded:
                copy_world_readable(folder, self._shown_folder())
                self._is_loaded = True
            folder = SUBMISSION_FOLDER
        reader, output = os.pipe()
        try:
            request = FORK + os.fsencode(folder)
            word, fds = self.request(request, (line, output))
            if word == USED_UP:
                self._end()
                word, fds = self.request(request, (line, output))
            if len(word) != NUMBER.size or len(fds) != 1:
                raise self._fault()
        except BaseException:
            os.close(reader)
            raise
        finally:
            os.close(output)
        (number,) = NUMBER.unpack(word)
        child = ForkedChild(self, number, fds[0], reader)
        self.running.add(child)
        return child

    def _shown_folder(self) -> Path:
        if self._shown is None:
            self._shown = Path(tempfile.mkdtemp(prefix="snr_held_"))
        return self._shown

    def exit_status(self, number: int) -> int:
        """Return the exit status of a copy that has ended, as `subprocess` does; raise GraderError if there is none."""
        if self._socket is None:
            raise self._fault()
        status: int = NUMBER.unpack(self.request(WAIT + NUMBER.pack(number))[0])[0]
        return status

    def request(self, word: bytes, fds: tuple[int, ...] = ()) -> tuple[bytes, list[int]]:
        """Return the answer of the fork server to a command, and the file descriptors sent with it."""
        if self._socket is None:
            self._start()
        assert self._socket is not None
        try:
            socket.send_fds(self._socket, [word], fds)
            answer, received_fds, _, _ = socket.recv_fds(self._socket, MAX_WORD_BYTES, 1)
        except OSError as error:
            raise self._fault() from error
        if not answer:
            raise self._fault()
        return answer, received_fds

    def _start(self) -> None:
        here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        here.settimeout(_RESPONSE_TIMEOUT_S)
        self._socket = here
        folder = self._shown_folder() if self._isolation == "sandbox" else Path("/")
        with there:
            self._process = start_process(folder, self._isolation, there.fileno(), self._limits, is_fork_server=True)

    def _fault(self) -> GraderError:
        """Return the error for a failed copy; end the sandbox."""
        return GraderError(
            f"A student's process could not be started. {self._end()}".rstrip(),
            fix="is the computer out of memory or processes? Grade with fewer --jobs.",
        )

    def close(self) -> None:
        """End the sandbox with all its processes, and remove the submission's folder. Safe to call twice."""
        self._end()
        if self._shown is not None:
            shutil.rmtree(self._shown, ignore_errors=True)
        self._shown, self._is_loaded = None, False

    def _end(self) -> str:
        """End the sandbox with all its processes; return the output of its own process."""
        output = b""
        if self._process is not None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
            output, _ = self._process.communicate()
        if self._socket is not None:
            wait_for_hangup(self._socket)
            self._socket.close()
        for child in tuple(self.running):  # the kernel ends them only after the sandbox's own processes
            child.kill()
            child.wait(_RESPONSE_TIMEOUT_S)
        self.running.clear()
        self._process = self._socket = None
        return output.decode(errors="replace")


def _has_handles() -> bool:
    """Return whether a process can be waited for that is not a child: on Linux, but not in each of its imitations."""
    try:
        os.close(os.pidfd_open(os.getpid()))
    except (AttributeError, OSError):
        return False
    return True


def _empty(folder: Path) -> None:
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()
