"""The programs in the kernel, gone through step by step here: so those of the other kind of computer are tried, too."""

import errno
import os
import re
import struct
from pathlib import Path

import pytest

from snr_sim.grading.sandbox.seccomp import (
    ABSENT,
    ALLOW,
    ALLOWED,
    ARCHITECTURES,
    ASK,
    COLUMN,
    ERRNO,
    KILL,
    SECCOMP,
    STARTS_A_PROCESS,
    WITH_CONDITIONS,
    Instruction,
    file_creation_filter,
    system_call_filter,
)

PID = 4711
O_TMPFILE = 0o20000000
MACHINES = pytest.mark.parametrize("machine", sorted(ARCHITECTURES))


def run(program: list[Instruction], machine: str, number: int, *arguments: int) -> int:
    """What the kernel would come to; the four instructions of BPF that are used."""
    arguments = (*arguments, *[0] * (6 - len(arguments)))
    data = struct.pack("<iIQ6Q", number, ARCHITECTURES[machine], 0, *[one & (2**64 - 1) for one in arguments])
    at = accumulator = 0
    while True:
        code, if_true, if_false, constant = program[at]
        at += 1
        match code:
            case 0x20:
                (accumulator,) = struct.unpack_from("<I", data, constant)
            case 0x54:
                accumulator &= constant
            case 0x15:
                at += if_true if accumulator == constant else if_false
            case 0x06:
                return constant
            case _:
                raise AssertionError(code)


def number(call: str, machine: str) -> int:
    return (ALLOWED | WITH_CONDITIONS | STARTS_A_PROCESS)[call][COLUMN[machine]]


@MACHINES
def test_only_listed_system_calls_are_allowed(machine: str) -> None:
    program = system_call_filter(machine, PID)
    allowed = {number(call, machine) for call in ALLOWED} - {ABSENT}
    starts = {number(call, machine) for call in STARTS_A_PROCESS} - {ABSENT}
    conditional = {number(call, machine) for call in WITH_CONDITIONS} - {ABSENT}
    for call in set(range(600)) - conditional:
        expected = ALLOW if call in allowed else ERRNO | (errno.EAGAIN if call in starts else errno.ENOSYS)
        assert run(program, machine, call) == expected, call
    assert all(0 <= jump < 256 for _, *jumps, _ in program for jump in jumps)
    assert len(program) < 4096


@MACHINES
def test_foreign_architecture_kills_the_process(machine: str) -> None:
    other = next(one for one in ARCHITECTURES if one != machine)
    for program in (system_call_filter(machine, PID), file_creation_filter(machine)):
        assert run(program, other, number("read", other)) == KILL


def test_32_bit_system_calls_return_enosys() -> None:
    assert (
        run(system_call_filter("x86_64", PID), "x86_64", 0x40000000 | number("read", "x86_64")) == ERRNO | errno.ENOSYS
    )


@MACHINES
def test_signals_to_others_and_addressed_sends_are_rejected(machine: str) -> None:
    def result_of(call: str, *arguments: int) -> int:
        return run(system_call_filter(machine, PID), machine, number(call, machine), *arguments)

    refused = ERRNO | errno.EPERM
    for call in ("kill", "tkill", "tgkill"):
        assert result_of(call, PID, PID) == ALLOW
        assert {result_of(call, pid) for pid in (0, 1, -1, -PID, PID + 1)} == {refused}
    assert result_of("socketpair", 1, 1) == result_of("socketpair", 1, 1 | os.O_CLOEXEC) == ALLOW
    assert {result_of("socketpair", *sort) for sort in ((1, 2), (1, 5), (2, 1), (16, 3))} == {refused}
    assert result_of("sendto", 3, 0x7F00, 1, 0, 0) == ALLOW
    assert {result_of("sendto", 3, 0x7F00, 1, 0, address) for address in (0x7F00, 0x7F00_0000_0000)} == {refused}


@MACHINES
def test_file_creation_asks_the_listener_and_truncation_is_rejected(machine: str) -> None:
    for call, at in (("open", 1), ("openat", 2)):
        if number(call, machine) == ABSENT:
            continue
        for flags, asks, refuses in (
            (os.O_RDONLY, False, False),
            (os.O_WRONLY | os.O_TRUNC, False, False),
            (os.O_WRONLY | os.O_CREAT | os.O_TRUNC, True, False),
            (os.O_RDWR | O_TMPFILE, True, False),
            (os.O_RDONLY | os.O_TRUNC, False, True),
        ):
            arguments = [7] * at + [flags]
            asked = run(file_creation_filter(machine), machine, number(call, machine), *arguments)
            allowed = run(system_call_filter(machine, PID), machine, number(call, machine), *arguments)
            assert (asked, allowed) == (ASK if asks else ALLOW, ERRNO | errno.EPERM if refuses else ALLOW), oct(flags)


@pytest.mark.parametrize(
    ("machine", "header"),
    [("x86_64", "/usr/include/x86_64-linux-gnu/asm/unistd_64.h"), ("aarch64", "/usr/include/asm-generic/unistd.h")],
)
def test_system_call_numbers_equal_the_linux_headers(machine: str, header: str) -> None:
    if not Path(header).is_file():
        pytest.skip("the kernel's headers are not here (linux-libc-dev)")
    found = re.findall(r"#define __NR(?:3264)?_(\w+)\s+(\d+)\s*$", Path(header).read_text(), re.MULTILINE)
    numbers = {name: int(text) for name, text in found}
    numbers.setdefault("newfstatat", numbers.get("fstatat", ABSENT))  # its name where nothing is older
    known = ALLOWED | WITH_CONDITIONS | STARTS_A_PROCESS | {"seccomp": SECCOMP}
    assert {name: numbers.get(name, ABSENT) for name in known} == {
        name: pair[COLUMN[machine]] for name, pair in known.items()
    }
