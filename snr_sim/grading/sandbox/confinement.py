"""Confinement of a process by itself where it can make no namespaces: in an ordinary container, as root.

Each mechanism is the kernel's own and cannot be undone. If one of them cannot be set up, the process ends before it
reads the submission. The limits and the filter of system calls come after these (`child_limits.py`).

Landlock needs no rights and no namespaces: a process lists once for the kernel what it will use, and can open nothing
else afterwards. What it does not cover (asking whether a file is there, and how long it is) is left to the files' own
permissions; network and signals, which newer versions cover, to the filter of system calls.

Source: Documentation/userspace-api/landlock.rst of Linux; linux/landlock.h.
"""

from __future__ import annotations

import os
import socket
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from snr_sim.grading.sandbox import seccomp
from snr_sim.grading.sandbox.child_limits import drop_privileges, end_with_parent, process_control
from snr_sim.grading.sandbox.seccomp import call_kernel

WRITE_FILE, READ_FILE, READ_DIR, REMOVE_FILE, MAKE_FILE, TRUNCATE = 1 << 1, 1 << 2, 1 << 3, 1 << 5, 1 << 8, 1 << 14
READ: int = READ_FILE | READ_DIR
SCRATCH: int = READ | WRITE_FILE | REMOVE_FILE | MAKE_FILE | TRUNCATE
_OF_A_FILE = READ_FILE | WRITE_FILE | TRUNCATE
_FIRST_RIGHTS, _NEWEST_NEEDED = 13, 3  # version 1 knows 13 rights of files, 2 and 3 one more each: links, emptying
_CREATE, _ADD_RULE, _RESTRICT = 444, 445, 446  # system calls, on every kind of computer
_ASK_VERSION = 1
_BENEATH = 1
_DEVICES = {"null": READ | WRITE_FILE, "zero": READ, "full": READ, "random": READ, "urandom": READ}
_NO_NEW_PRIVILEGES = 38  # prctl


def confine(line: int, user: int, readable: Sequence[str], hidden: str, scratch: str) -> None:
    """Put up all walls but the last; send the grader the listener that counts new files.

    `hidden` may be in one of the readable folders, and must not be read; `scratch` is the folder to write in.
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


class LandlockMissingError(Exception):
    """This computer's kernel has no Landlock, or does not let it be used."""


def restrict(granted: Mapping[Path, int]) -> None:
    """Permit this process the granted access only, irrevocably; paths that do not exist are left out.

    It must have given up new privileges. LandlockMissingError is raised if the kernel cannot do that.
    """
    try:
        version = min(call_kernel(_CREATE, None, 0, _ASK_VERSION), _NEWEST_NEEDED)
        known = (1 << _FIRST_RIGHTS + version - 1) - 1
        handled = struct.pack("=Q", known)
        rules = call_kernel(_CREATE, handled, len(handled), 0)
        try:
            for path, access in granted.items():
                _grant(rules, path, access & known)
            call_kernel(_RESTRICT, rules, 0)
        finally:
            os.close(rules)
    except OSError as error:
        raise LandlockMissingError(f"Landlock: {error.strerror}") from error


def _grant(rules: int, path: Path, access: int) -> None:
    try:
        place = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except FileNotFoundError:
        return
    try:
        allowed = access if path.is_dir() else access & _OF_A_FILE
        call_kernel(_ADD_RULE, rules, _BENEATH, struct.pack("=Qi", allowed, place), 0)
    finally:
        os.close(place)


def paths_except(tree: Path, hidden: Path) -> Iterator[tuple[Path, int]]:
    """Yield what to grant for reading all of a tree but one folder in it, of which the names alone can be read.

    A grant reaches all that is below, so the way down to the folder is granted piece by piece.
    """
    if not hidden.is_relative_to(tree):
        yield tree, READ
    elif hidden != tree:
        yield tree, READ_DIR
        for path in tree.iterdir():
            yield from paths_except(path, hidden)
