"""Seccomp: a small program in the kernel that checks each system call of a process, and decides what it returns.

One checks each student's process and knows what is allowed (`system_calls.py`). A sandbox needs it, too: no namespace
divides the kernel's keyrings and the other cores, no limit counts shared memory and files in memory, and a process
that may make namespaces of its own is root in them. A confined process has a second one, which has the grader asked
about each new file (`confiner.py`). They see numbers only, so nothing can be changed behind them.

Source: Documentation/userspace-api/seccomp_filter.rst of Linux; struct sock_filter in linux/filter.h.

libseccomp's binding is not used. pyseccomp 0.1.2 finds the library by `ldconfig -p`, which finds nothing in a sandbox
without /etc and raises "Unable to find libseccomp". Its import takes 4 ms of CPU time, ours 1.7; both build and load a
program within 1 ms. The library comes with apt, and its version decides which system calls it knows.
"""

from __future__ import annotations

import ctypes
import errno
import os
import struct
from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

from snr_sim.grading.sandbox.system_calls import (
    ALLOWED,
    ARCHITECTURES,
    COLUMN,
    SECCOMP,
    STARTS_A_PROCESS,
    call_kernel,
    number_of,
)

KILL, ERRNO, ASK, ALLOW = 0x80000000, 0x00050000, 0x7FC00000, 0x7FFF0000  # SECCOMP_RET_...
_LOAD, _AND, _IF_EQUAL, _RETURN = 0x20, 0x54, 0x15, 0x06  # BPF: 32 bits of the call; and, jumps
_NUMBER_AT, _ARCHITECTURE_AT, _ARGUMENTS_AT = 0, 4, 16  # in struct seccomp_data
_SET_FILTER, _NEW_LISTENER = 1, 1 << 3
_CREATES = os.O_CREAT | 0o20000000  # O_CREAT, __O_TMPFILE
_FAMILY_UNIX, _STREAM, _SOCKET_TYPE = 1, 1, 0xF
_ALL_BITS = 0xFFFFFFFF

Instruction: TypeAlias = tuple[int, int, int, int]  # code, jump if true, jump if false, constant


class SeccompMissingError(Exception):
    """This computer's kernel has no seccomp filters, or its kind is unknown."""


class Condition(NamedTuple):
    """What an argument must be."""

    argument: int  # which, from 0
    value: int  # of its 32 bits, as far as they are in `mask`
    mask: int = _ALL_BITS
    is_equal: bool = True  # False if it must be any other value
    half: int = 0  # 1 for the upper 32 bits


def conditions(pid: int) -> dict[str, tuple[Condition, ...]]:
    """Return with which arguments a call is allowed, to the process of this number."""
    # Emptying what it may only read: Landlock knows of that since Linux 6.2.
    empties = (os.O_TRUNC, os.O_TRUNC | os.O_ACCMODE, False)
    return {
        "open": (Condition(1, *empties),),
        "openat": (Condition(2, *empties),),
        **dict.fromkeys(("kill", "tkill", "tgkill"), (Condition(0, pid),)),
        "socketpair": (Condition(0, _FAMILY_UNIX), Condition(1, _STREAM, _SOCKET_TYPE)),
        "sendto": (Condition(4, 0), Condition(4, 0, half=1)),  # without an address: to the other end of a pair
    }


def system_call_filter(machine: str, pid: int) -> list[Instruction]:
    """Return the program that allows what a student's process may do.

    Args:
        machine: "x86_64" or "aarch64".
        pid: of the process, which may send signals to itself alone.
    """
    program = [*_begin(machine)]
    for call in ALLOWED:
        program += _if_call(call, machine, (), ALLOW)
    for call, required in conditions(pid).items():
        program += _if_call(call, machine, required, ERRNO | errno.EPERM)
    for call in STARTS_A_PROCESS:
        program += _if_call(call, machine, (), ERRNO | errno.EAGAIN)
    # As if the kernel did not know it: then libraries take the older way, if there is one.
    return [*program, (_RETURN, 0, 0, ERRNO | errno.ENOSYS)]


def file_creation_filter(machine: str) -> list[Instruction]:
    """Return the program that has the listener asked whether a file may be made."""
    program = [*_begin(machine)]
    for call, argument in (("open", 1), ("openat", 2)):
        program += _if_call(call, machine, (Condition(argument, 0, _CREATES),), ASK)
    return [*program, (_RETURN, 0, 0, ALLOW)]


def _begin(machine: str) -> Iterator[Instruction]:
    """Yield what ends a process that uses another computer's numbers, and loads the number."""
    yield _LOAD, 0, 0, _ARCHITECTURE_AT
    yield _IF_EQUAL, 1, 0, ARCHITECTURES[machine]
    yield _RETURN, 0, 0, KILL
    yield _LOAD, 0, 0, _NUMBER_AT


def _if_call(call: str, machine: str, required: tuple[Condition, ...], otherwise: int) -> list[Instruction]:
    """Return what ends a call: allowed if it has conditions and all hold, else with `otherwise`."""
    number = number_of(call, machine)
    if number is None:
        return []
    body: list[Instruction] = []
    for one in required:
        at = _ARGUMENTS_AT + 8 * one.argument + 4 * one.half  # both kinds are little-endian
        body += (_LOAD, 0, 0, at), (_AND, 0, 0, one.mask)
        body += (_IF_EQUAL, one.is_equal, not one.is_equal, one.value), (_RETURN, 0, 0, otherwise)
    body.append((_RETURN, 0, 0, ALLOW if required else otherwise))
    return [(_IF_EQUAL, 0, len(body), number), *body]


def install(program: list[Instruction], has_listener: bool = False) -> int:
    """Have the kernel run this program on this process, for good; return the listener's descriptor, or 0.

    Raises:
        SeccompMissingError: it cannot.
    """
    code = b"".join(struct.pack("<HBBI", *instruction) for instruction in program)
    kept = ctypes.create_string_buffer(code, len(code))
    head = struct.pack("HxxxxxxP", len(program), ctypes.addressof(kept))
    flags = _NEW_LISTENER if has_listener else 0
    try:
        return call_kernel(SECCOMP[COLUMN[current_machine()]], _SET_FILTER, flags, head)
    except OSError as error:
        raise SeccompMissingError(f"seccomp: {error.strerror}") from error


def current_machine() -> str:
    """Return what kind of computer this is.

    Raises:
        SeccompMissingError: its system calls are not known.
    """
    machine = os.uname().machine
    if machine not in COLUMN:
        raise SeccompMissingError(f"seccomp: the system calls of the processor '{machine}' are not known")
    return machine
