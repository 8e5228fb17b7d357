"""Seccomp: a small program in the kernel that checks each system call of a process, and decides what it returns.

One checks each student's process and knows what is allowed: a list of allowed calls, not of forbidden ones, so calls
that a newer kernel adds are refused without being known. A sandbox needs it, too: no namespace divides the kernel's
keyrings and the other cores, no limit counts shared memory and files in memory, and a process that may make namespaces
of its own is root in them. A confined process has a second one, which has the grader asked about each new file
(`confiner.py`). They see numbers only, so nothing can be changed behind them.

Source: Documentation/userspace-api/seccomp_filter.rst of Linux 6.1; struct sock_filter in linux/filter.h; numbers of
calls, which are never given to other ones: arch/x86/entry/syscalls/syscall_64.tbl, include/uapi/asm-generic/unistd.h.

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

KILL, ERRNO, ASK, ALLOW = 0x80000000, 0x00050000, 0x7FC00000, 0x7FFF0000  # SECCOMP_RET_...
_LOAD, _AND, _IF_EQUAL, _RETURN = 0x20, 0x54, 0x15, 0x06  # BPF: 32 bits of the call; and, jumps
_NUMBER_AT, _ARCHITECTURE_AT, _ARGUMENTS_AT = 0, 4, 16  # in struct seccomp_data
_SET_FILTER, _NEW_LISTENER = 1, 1 << 3
_CREATES = os.O_CREAT | 0o20000000  # O_CREAT, __O_TMPFILE
_FAMILY_UNIX, _STREAM, _SOCKET_TYPE = 1, 1, 0xF
_ALL_BITS = 0xFFFFFFFF

Instruction: TypeAlias = tuple[int, int, int, int]  # code, jump if true, jump if false, constant
ARCHITECTURES: dict[str, int] = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}  # AUDIT_ARCH_... of linux/audit.h
COLUMN: dict[str, int] = {"x86_64": 0, "aarch64": 1}
ABSENT = -1


def _table(text: str) -> dict[str, tuple[int, int]]:
    """Return the numbers in a table of "name number-on-x86-64 number-on-aarch64, ..."; "-": it has none there."""
    rows = (row.replace("-", str(ABSENT)).split() for row in text.split(","))
    return {name: (int(intel), int(arm)) for name, intel, arm in rows}


# The kernel checks the list from the top: reading and writing come first.
_DATA = """
    read 0 63, write 1 64, lseek 8 62, fstat 5 80, stat 4 -, lstat 6 -, newfstatat 262 79, statx 332 291,
    close 3 57, mmap 9 222, munmap 11 215, mprotect 10 226, mremap 25 216, madvise 28 233, brk 12 214,
    mincore 27 232, msync 26 227
"""
# Which files these may be used on is decided by the file system that is shown, or by Landlock.
_FILES = """
    close_range 436 436, access 21 -, faccessat 269 48, faccessat2 439 439, pread64 17 67, pwrite64 18 68,
    readv 19 65, writev 20 66, preadv 295 69, pwritev 296 70, sendfile 40 71, getdents64 217 61, getcwd 79 17,
    chdir 80 49, fchdir 81 50, dup 32 23, dup2 33 -, dup3 292 24, fcntl 72 25, ioctl 16 29, readlink 89 -,
    readlinkat 267 78, mkdir 83 -, mkdirat 258 34, rename 82 -, renameat 264 38, renameat2 316 276, unlink 87 -,
    unlinkat 263 35, ftruncate 77 46, fallocate 285 47, fsync 74 82, fdatasync 75 83, flock 73 32, umask 95 166,
    chmod 90 -, fchmod 91 52, fchmodat 268 53, statfs 137 43, fstatfs 138 44, fadvise64 221 223
"""
_WAITING_AND_SIGNALS = """
    poll 7 -, ppoll 271 73, select 23 -, pselect6 270 72, epoll_create1 291 20, epoll_ctl 233 21, epoll_wait 232 -,
    epoll_pwait 281 22, eventfd2 290 19, pipe 22 -, pipe2 293 59, wait4 61 260, waitid 247 95, recvfrom 45 207,
    getsockopt 55 209, setsockopt 54 208, shutdown 48 210, rt_sigaction 13 134, rt_sigprocmask 14 135,
    rt_sigreturn 15 139, rt_sigpending 127 136, rt_sigtimedwait 128 137, rt_sigsuspend 130 133, sigaltstack 131 132,
    restart_syscall 219 128, pause 34 -, alarm 37 -, setitimer 38 103, getitimer 36 102, clock_gettime 228 113,
    clock_getres 229 114, clock_nanosleep 230 115, nanosleep 35 101, gettimeofday 96 169, time 201 -, times 100 153
"""
_ITSELF = """
    exit 60 93, exit_group 231 94, getpid 39 172, getppid 110 173, gettid 186 178, getuid 102 174, geteuid 107 175,
    getgid 104 176, getegid 108 177, getresuid 118 148, getresgid 120 150, getgroups 115 158, getpgrp 111 -,
    getpgid 121 155, getsid 124 156, uname 63 160, sysinfo 99 179, getrusage 98 165, getrlimit 97 163,
    setrlimit 160 164, prlimit64 302 261, getpriority 140 141, sched_yield 24 124, sched_getaffinity 204 123,
    getcpu 309 168, futex 202 98, set_tid_address 218 96, set_robust_list 273 99, rseq 334 293, arch_prctl 158 -,
    membarrier 324 283, getrandom 318 278
"""
ALLOWED: dict[str, tuple[int, int]] = _table(_DATA) | _table(_FILES) | _table(_WAITING_AND_SIGNALS) | _table(_ITSELF)
# Allowed with certain arguments only: see `conditions`.
WITH_CONDITIONS: dict[str, tuple[int, int]] = _table(
    "open 2 -, openat 257 56, kill 62 129, tkill 200 130, tgkill 234 131, socketpair 53 199, sendto 44 206"
)
# Refused as the limit of processes refuses it, so that a program gets the same error in either isolation.
STARTS_A_PROCESS: dict[str, tuple[int, int]] = _table("clone 56 220, fork 57 -, vfork 58 -")
SECCOMP: tuple[int, int] = (317, 277)


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
    """Return the program that allows what a student's process of this number may do, on "x86_64" or "aarch64".

    It may send signals to itself alone.
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
    """Return what kind of computer this is; raise SeccompMissingError if its system calls are not known."""
    machine = os.uname().machine
    if machine not in COLUMN:
        raise SeccompMissingError(f"seccomp: the system calls of the processor '{machine}' are not known")
    return machine


def number_of(call: str, machine: str) -> int | None:
    """Return a call's number on a kind of computer, "x86_64" or "aarch64"; None if it has none there.

    Example:
        >>> number_of("openat", "aarch64"), number_of("open", "aarch64")
        (56, None)
    """
    number = (ALLOWED | WITH_CONDITIONS | STARTS_A_PROCESS)[call][COLUMN[machine]]
    return None if number == ABSENT else number


def call_kernel(number: int, *args: int | bytes | None) -> int:
    """Make a system call and return its result; raise OSError if the kernel refuses it."""
    libc = ctypes.CDLL(None, use_errno=True)
    libc.syscall.restype = ctypes.c_long
    words = [ctypes.c_long(one) if isinstance(one, int) else one for one in args]
    done = libc.syscall(ctypes.c_long(number), *words)
    if done < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return int(done)
