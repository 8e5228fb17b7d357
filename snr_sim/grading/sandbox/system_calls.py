"""System calls that a student's process may make, by their numbers on two processor architectures; others are refused.

A list of allowed calls, not of forbidden ones: calls that a newer kernel adds are refused without being known.

Source: arch/x86/entry/syscalls/syscall_64.tbl and include/uapi/asm-generic/unistd.h of Linux 6.1; a number is never
given to another call.
"""

from __future__ import annotations

import ctypes
import os

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
# Allowed with certain arguments only: seccomp.py names them.
WITH_CONDITIONS: dict[str, tuple[int, int]] = _table(
    "open 2 -, openat 257 56, kill 62 129, tkill 200 130, tgkill 234 131, socketpair 53 199, sendto 44 206"
)
# Refused as the limit of processes refuses it, so that a program gets the same error in either isolation.
STARTS_A_PROCESS: dict[str, tuple[int, int]] = _table("clone 56 220, fork 57 -, vfork 58 -")
SECCOMP: tuple[int, int] = (317, 277)


def number_of(call: str, machine: str) -> int | None:
    """Return a call's number on a kind of computer, "x86_64" or "aarch64"; None if it has none there.

    Example:
        >>> number_of("openat", "aarch64"), number_of("open", "aarch64")
        (56, None)
    """
    number = (ALLOWED | WITH_CONDITIONS | STARTS_A_PROCESS)[call][COLUMN[machine]]
    return None if number == ABSENT else number


def call_kernel(number: int, *args: int | bytes | None) -> int:
    """Make a system call; return what it returns.

    Raises:
        OSError: the kernel refuses it.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    libc.syscall.restype = ctypes.c_long
    words = [ctypes.c_long(one) if isinstance(one, int) else one for one in args]
    done = libc.syscall(ctypes.c_long(number), *words)
    if done < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return int(done)
