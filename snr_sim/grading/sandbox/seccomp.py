"""Seccomp: a small program in the kernel that looks at each request of a process to it, and says what comes of it.

One stands before each student's process and knows what is allowed (`system_calls.py`). A sandbox needs it, too: no
namespace divides the kernel's keyrings and the other cores, no limit counts shared memory and files in memory, and who
may make namespaces of his own is root in there. Before a confined process stands a second one, which has each new file
asked about, and somebody else counts (`scratch.py`). They see numbers only, so nothing can be changed behind them.

Source: Documentation/userspace-api/seccomp_filter.rst of Linux; struct sock_filter in linux/filter.h.
"""

from __future__ import annotations

import ctypes
import errno
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass

from snr_sim.grading.sandbox.system_calls import (
    ALLOWED,
    ARCHITECTURES,
    COLUMN,
    SECCOMP,
    STARTS_A_PROCESS,
    number_of,
)

KILL, ERRNO, ASK, ALLOW = 0x80000000, 0x00050000, 0x7FC00000, 0x7FFF0000  # SECCOMP_RET_...
_LOAD, _AND, _IF_EQUAL, _RETURN = 0x20, 0x54, 0x15, 0x06  # BPF: 32 bits of what is asked; and, jumps
_NUMBER_AT, _ARCHITECTURE_AT, _ARGUMENTS_AT = 0, 4, 16  # in struct seccomp_data
_SET_FILTER, _NEW_LISTENER = 1, 1 << 3
_CREATES = os.O_CREAT | 0o20000000  # O_CREAT, __O_TMPFILE
_FAMILY_UNIX, _STREAM, _SORT_OF_SOCKET = 1, 1, 0xF

Instruction = tuple[int, int, int, int]  # code, jump if true, jump if false, constant


class SeccompMissing(Exception):
    """This computer's kernel has no seccomp filters, or its kind is unknown."""


@dataclass(frozen=True)
class Test:
    """Whether a part of an argument has a value.

    Args:
        argument: which, from 0.
        mask: what of its lower 32 bits.
        value: what these must be.
        is_equal: or must not be, if False.
        half: 1 for the upper 32 bits.
    """

    __test__ = False  # pytest would take it for one of its own

    argument: int
    mask: int
    value: int
    is_equal: bool = True
    half: int = 0


def conditions(pid: int) -> dict[str, tuple[Test, ...]]:
    """Returns with which arguments a call is allowed, to the process of this number."""
    # Emptying what it may only read: Landlock knows of that since Linux 6.2.
    empties = {"mask": os.O_TRUNC | os.O_ACCMODE, "value": os.O_TRUNC, "is_equal": False}
    itself = (Test(0, 0xFFFFFFFF, pid),)
    to_nobody = (Test(4, 0xFFFFFFFF, 0), Test(4, 0xFFFFFFFF, 0, half=1))  # but to whom it is connected with
    return {
        "open": (Test(1, **empties),),  # type: ignore[arg-type]
        "openat": (Test(2, **empties),),  # type: ignore[arg-type]
        "kill": itself,
        "tkill": itself,
        "tgkill": itself,
        "socketpair": (Test(0, 0xFFFFFFFF, _FAMILY_UNIX), Test(1, _SORT_OF_SOCKET, _STREAM)),
        "sendto": to_nobody,
    }


def allowing(machine: str, pid: int) -> list[Instruction]:
    """Returns the program that allows what a student's process may do.

    Args:
        machine: "x86_64" or "aarch64".
        pid: of the process, which may send signals to itself alone.
    """
    program = [*_begin(machine)]
    for call in ALLOWED:
        program += _if_call(call, machine, [(_RETURN, 0, 0, ALLOW)])
    for call, tests in conditions(pid).items():
        body = [*_all(tests), (_RETURN, 0, 0, ALLOW), (_RETURN, 0, 0, ERRNO | errno.EPERM)]
        program += _if_call(call, machine, body)
    for call in STARTS_A_PROCESS:
        program += _if_call(call, machine, [(_RETURN, 0, 0, ERRNO | errno.EAGAIN)])
    # As if the kernel did not know it: then libraries take the older way, if there is one.
    return [*program, (_RETURN, 0, 0, ERRNO | errno.ENOSYS)]


def asking(machine: str) -> list[Instruction]:
    """Returns the program that has somebody asked whether a file may be made."""
    program = [*_begin(machine)]
    for call, argument in (("open", 1), ("openat", 2)):
        flags = Test(argument, _CREATES, 0)
        program += _if_call(call, machine, [*_all((flags,)), (_RETURN, 0, 0, ALLOW), (_RETURN, 0, 0, ASK)])
    return [*program, (_RETURN, 0, 0, ALLOW)]


def _begin(machine: str) -> Iterator[Instruction]:
    """Yields what ends a process that speaks another computer's numbers, and loads the number."""
    yield _LOAD, 0, 0, _ARCHITECTURE_AT
    yield _IF_EQUAL, 1, 0, ARCHITECTURES[machine]
    yield _RETURN, 0, 0, KILL
    yield _LOAD, 0, 0, _NUMBER_AT


def _if_call(call: str, machine: str, body: list[Instruction]) -> list[Instruction]:
    number = number_of(call, machine)
    return [] if number is None else [(_IF_EQUAL, 0, len(body), number), *body]


def _all(tests: tuple[Test, ...]) -> Iterator[Instruction]:
    """Yields what goes on if all tests hold, and else jumps over the instruction behind them."""
    for i, test in enumerate(tests):
        away = 3 * (len(tests) - i - 1) + 1
        yield _LOAD, 0, 0, _ARGUMENTS_AT + 8 * test.argument + 4 * test.half  # both kinds are little-endian
        yield _AND, 0, 0, test.mask
        yield (_IF_EQUAL, 0, away, test.value) if test.is_equal else (_IF_EQUAL, away, 0, test.value)


def install(program: list[Instruction], has_listener: bool = False) -> int:
    """Has the kernel look at this process through a program, for good; returns the listener's descriptor, or 0.

    Raises:
        SeccompMissing: it cannot.
    """
    code = b"".join(struct.pack("<HBBI", *instruction) for instruction in program)
    kept = ctypes.create_string_buffer(code, len(code))
    head = struct.pack("HxxxxxxP", len(program), ctypes.addressof(kept))
    libc = ctypes.CDLL(None, use_errno=True)
    libc.syscall.restype = ctypes.c_long
    number = SECCOMP[COLUMN[machine_here()]]
    flags = _NEW_LISTENER if has_listener else 0
    done = libc.syscall(ctypes.c_long(number), ctypes.c_long(_SET_FILTER), ctypes.c_long(flags), head)
    if done < 0:
        raise SeccompMissing(f"seccomp: {os.strerror(ctypes.get_errno())}")
    return int(done)


def machine_here() -> str:
    """Returns what kind of computer this is, as far as the kit knows its system calls.

    Raises:
        SeccompMissing: it does not.
    """
    machine = os.uname().machine
    if machine not in COLUMN:
        raise SeccompMissing(f"seccomp: the system calls of a computer '{machine}' are not known")
    return machine
