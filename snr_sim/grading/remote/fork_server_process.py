"""Fork server's process: it forks a copy of itself per case.

It has imported what a student's process needs, and reads nothing of the student's; each copy begins where `child.py`
begins. So a case costs a fork, and not a start of Python with all its imports.

In a sandbox a copy is the first process of a PID namespace of its own: it ends alone, has the same number in every
case, and whatever it leaves in shared memory is removed with it. It could leave files in the sandbox's scratch folder:
then that sandbox is used up, and the next case gets a fresh one.
"""

from __future__ import annotations

import ctypes
import gc
import os
import socket
from contextlib import suppress

from snr_sim.grading.remote import child
from snr_sim.grading.remote.protocol import FORK, MAX_WORD_BYTES, NUMBER, USED_UP, WAIT
from snr_sim.grading.sandbox import seccomp  # noqa: F401  every copy has it

SCRATCH = "/tmp"
# Numbers of Linux (linux/sched.h).
_NEW_IPC, _NEW_PID = 0x08000000, 0x20000000


def main(line: int, limits: tuple[int, int, int, int], is_alone: bool, user: int | None) -> None:
    """Fork a copy for each request, until the grader closes the line of requests. Does not return.

    The other arguments are those of each copy, as for `child.main`.
    """
    requests = socket.socket(fileno=line)
    ended: dict[int, int] = {}  # exit statuses
    initial_scratch = _scratch() if is_alone else None
    if not is_alone:  # in a sandbox, a program with components needs a robot's folder, and so no copy
        from snr_sim.grading.remote import child_node  # noqa: F401  every copy has it
    gc.collect()
    gc.freeze()  # the collector in a copy skips the objects that exist now
    while True:
        word, fds, _, _ = socket.recv_fds(requests, MAX_WORD_BYTES, 2)
        if not word:
            os._exit(0)
        if word.startswith(WAIT):
            (forked,) = NUMBER.unpack(word.removeprefix(WAIT))
            _reap(ended)
            requests.send(NUMBER.pack(ended.pop(forked)))
        elif is_alone and _scratch() != initial_scratch:
            requests.send(USED_UP)
            os._exit(0)
        else:
            line, output = fds
            _reap(ended)
            if is_alone:
                _enter_namespaces()
            forked = os.fork()
            if forked == 0:
                requests.close()
                os.chdir(word.removeprefix(FORK))
                _run_child(line, output, limits, is_alone, user)
            death = os.pidfd_open(forked)
            socket.send_fds(requests, [NUMBER.pack(forked)], [death])
            for fd in (line, output, death):
                os.close(fd)


def _reap(ended: dict[int, int]) -> None:
    """Note the exit statuses of the copies that have ended."""
    with suppress(ChildProcessError):  # there is none
        while (found := os.waitpid(-1, os.WNOHANG))[0]:
            ended[found[0]] = os.waitstatus_to_exitcode(found[1])


def _run_child(line: int, output: int, limits: tuple[int, int, int, int], is_alone: bool, user: int | None) -> None:
    os.setsid()
    for printed in (1, 2):
        os.dup2(output, printed)
    os.close(output)
    try:
        child.main(line, limits, is_alone, user)
    finally:
        os._exit(1)


def _enter_namespaces() -> None:
    """Have the next copy begin in namespaces of its own: of processes, and of what they share."""
    libc = ctypes.CDLL(None, use_errno=True)
    own = os.pidfd_open(os.getpid())
    try:  # back to our own first: from the one of the copy before, which is dead, none could be made
        if libc.setns(own, _NEW_PID) or libc.unshare(_NEW_PID | _NEW_IPC):
            raise OSError(ctypes.get_errno(), f"no namespace for a copy: {os.strerror(ctypes.get_errno())}")
    finally:
        os.close(own)


def _scratch() -> tuple[list[str], tuple[int, ...]]:
    """Return the state of the scratch folder, which differs if a process has written there, but not if it only read."""
    names = os.listdir(SCRATCH)  # first: listing changes the access time, once
    seen = os.stat(SCRATCH)  # noqa: PTH116 - a Path costs an import here
    return names, (seen.st_mode, seen.st_nlink, seen.st_atime_ns, seen.st_mtime_ns, seen.st_ctime_ns)
