"""The walls that a process puts up around itself where nobody may make namespaces: in an ordinary container, as root.

    a user of its own      files, signals and limits of nobody else; all of root's rights are gone
    no new privileges      no program gives any back
    Landlock               reads Python, the kit without its labs, and the submission; writes in its scratch folder
    seccomp                no processes, threads, programs, sockets, shared memory, or looks at other processes
    limits                 as in the sandbox

Each is the kernel's own and cannot be taken down. If one of them cannot be put up, the process ends before it has read
the submission.
"""

from __future__ import annotations

import os
import socket
from pathlib import Path
from typing import NamedTuple

from snr_sim.grading.sandbox import seccomp
from snr_sim.grading.sandbox.child_limits import become, end_with_parent, process_control
from snr_sim.grading.sandbox.landlock import READ, SCRATCH, WRITE_FILE, but_for, restrict

_DEVICES = {"null": READ | WRITE_FILE, "zero": READ, "full": READ, "random": READ, "urandom": READ}
_NO_NEW_PRIVILEGES = 38  # prctl


class Walls(NamedTuple):
    """What a confined process is told of itself.

    Args:
        user: whom to become.
        readable: folders.
        hidden: a folder that may be in one of these, and must not be read.
        scratch: the folder to write in.
    """

    user: int
    readable: tuple[str, ...]
    hidden: str
    scratch: str


def confine(walls: Walls, line: int) -> None:
    """Puts up all but the limits and the last filter; sends the grader the listener that counts new files.

    Args:
        walls: what for.
        line: the conversation with the grader.
    """
    parent = os.getppid()
    process_control(_NO_NEW_PRIVILEGES, 1)
    granted = {Path(walls.scratch): SCRATCH}
    for tree in walls.readable:
        granted.update(but_for(Path(tree), Path(walls.hidden)))
    restrict(granted | {Path("/dev", name): access for name, access in _DEVICES.items()})
    become(walls.user)
    end_with_parent()  # now: with another user it would be forgotten
    if os.getppid() != parent:
        os._exit(1)
    listener = seccomp.install(seccomp.asking(seccomp.machine_here()), has_listener=True)
    with socket.socket(fileno=os.dup(line)) as sender:
        socket.send_fds(sender, [b"\n"], [listener])
    os.close(listener)
