"""Confinement of a process by itself where it can make no namespaces: in an ordinary container, as root.

Each mechanism is the kernel's own and cannot be undone. If one of them cannot be set up, the process ends before it
reads the submission. The limits and the filter of system calls come after these (`child_limits.py`).
"""

from __future__ import annotations

import os
import socket
from collections.abc import Sequence
from pathlib import Path

from snr_sim.grading.sandbox import seccomp
from snr_sim.grading.sandbox.child_limits import drop_privileges, end_with_parent, process_control
from snr_sim.grading.sandbox.landlock import READ, SCRATCH, WRITE_FILE, paths_except, restrict

_DEVICES = {"null": READ | WRITE_FILE, "zero": READ, "full": READ, "random": READ, "urandom": READ}
_NO_NEW_PRIVILEGES = 38  # prctl


def confine(line: int, user: int, readable: Sequence[str], hidden: str, scratch: str) -> None:
    """Put up all walls but the last; send the grader the listener that counts new files.

    Args:
        line: the conversation with the grader.
        user: which to become.
        readable: folders.
        hidden: a folder that may be in one of these, and must not be read.
        scratch: the folder to write in.
    """
    parent = os.getppid()
    process_control(_NO_NEW_PRIVILEGES, 1)
    granted = {Path(scratch): SCRATCH}
    for tree in readable:
        granted.update(paths_except(Path(tree), Path(hidden)))
    restrict(granted | {Path("/dev", name): access for name, access in _DEVICES.items()})
    drop_privileges(user)
    end_with_parent()  # now: with another user it would be forgotten
    if os.getppid() != parent:
        os._exit(1)
    listener = seccomp.install(seccomp.file_creation_filter(seccomp.current_machine()), has_listener=True)
    with socket.socket(fileno=os.dup(line)) as sender:
        socket.send_fds(sender, [b"\n"], [listener])
    os.close(listener)
