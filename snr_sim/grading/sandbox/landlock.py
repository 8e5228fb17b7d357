"""Landlock: a process tells the kernel once which folders it will use, and can open nothing else any more.

It needs no rights and no namespaces. What it does not cover (asking whether a file is there, and how long it is) is
left to the files' own permissions.

Source: Documentation/userspace-api/landlock.rst of Linux; linux/landlock.h.
"""

from __future__ import annotations

import ctypes
import os
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path

WRITE_FILE, READ_FILE, READ_DIR, REMOVE_FILE, MAKE_FILE, TRUNCATE = 1 << 1, 1 << 2, 1 << 3, 1 << 5, 1 << 8, 1 << 14
READ = READ_FILE | READ_DIR
SCRATCH = READ | WRITE_FILE | REMOVE_FILE | MAKE_FILE | TRUNCATE
_OF_A_FILE = READ_FILE | WRITE_FILE | TRUNCATE
# What of files each version of Landlock knows, as the lowest bits: programs, links across folders, emptying, devices.
_HANDLED_FILES = {1: 13, 2: 14, 3: 15, 4: 15, 5: 16}
_TCP, _TCP_SINCE = 0b11, 4  # bind, connect
_SCOPES, _SCOPES_SINCE = 0b11, 6  # sockets without a path, signals
_CREATE, _ADD_RULE, _RESTRICT = 444, 445, 446  # system calls, on every kind of computer
_ASK_VERSION = 1
_BENEATH = 1


class LandlockMissing(Exception):
    """This computer's kernel has no Landlock, or does not let it be used."""


def version() -> int:
    """Returns which version of Landlock the kernel has.

    Raises:
        LandlockMissing: none.
    """
    return _call(_CREATE, None, 0, _ASK_VERSION)


def restrict(granted: Mapping[Path, int]) -> None:
    """Allows this process what is granted, and nothing else, for good. It must have given up new privileges.

    Args:
        granted: what may be done in a folder and below, or with a file. What is not there is left out.

    Raises:
        LandlockMissing: the kernel cannot do that.
    """
    newest = version()
    files = (1 << _HANDLED_FILES[min(newest, max(_HANDLED_FILES))]) - 1
    tcp = _TCP if newest >= _TCP_SINCE else 0
    scopes = _SCOPES if newest >= _SCOPES_SINCE else 0
    handled = struct.pack("=QQQ", files, tcp, scopes)
    rules = _call(_CREATE, handled, len(handled), 0)
    try:
        for path, access in granted.items():
            _grant(rules, path, access & files)
        _call(_RESTRICT, rules, 0)
    finally:
        os.close(rules)


def _grant(rules: int, path: Path, access: int) -> None:
    try:
        place = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except FileNotFoundError:
        return
    try:
        allowed = access if path.is_dir() else access & _OF_A_FILE
        _call(_ADD_RULE, rules, _BENEATH, struct.pack("=Qi", allowed, place), 0)
    finally:
        os.close(place)


def but_for(tree: Path, hidden: Path) -> Iterator[tuple[Path, int]]:
    """Yields what to grant for reading all of a tree but one folder in it, of which the names alone can be read.

    A grant reaches all that is below, so the way down to the folder is granted piece by piece.
    """
    if not hidden.is_relative_to(tree):
        yield tree, READ
    elif hidden != tree:
        yield tree, READ_DIR
        for path in tree.iterdir():
            yield from but_for(path, hidden)


def _call(number: int, *args: int | bytes | None) -> int:
    libc = ctypes.CDLL(None, use_errno=True)
    libc.syscall.restype = ctypes.c_long
    words = [ctypes.c_long(one) if isinstance(one, int) else one for one in args]
    done = libc.syscall(ctypes.c_long(number), *words)
    if done < 0:
        raise LandlockMissing(f"Landlock: {os.strerror(ctypes.get_errno())}")
    return int(done)
