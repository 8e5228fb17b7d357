"""Real processes and a real serial port: what the pins do when the computer's program is killed in the middle of it."""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from .conftest import FIRMWARE

pytest.importorskip("serial")
NEUTRAL_WITHIN_MS = 250.0
WAIT_S = 60.0
FULL_AHEAD = """
import sys, time
import serial
from snr_sim.devices.wire.mcu_frames import McuFrames, encode
from snr_sim.devices.wire.mcu_messages import Arm, Hello, SetWidths, State, Telemetry

port, frames = serial.Serial(sys.argv[1], 115200, timeout=0, exclusive=True), McuFrames()
seq, widths_us, said = 0, 1500.0, ""
port.write(b"\\0" + encode(Hello(9)))
while True:
    time.sleep(0.01)
    seq += 1
    port.write(encode(SetWidths(9, seq % 65536, time.monotonic_ns() // 1_000_000, 0, 200, (widths_us,) * 8)))
    for message in frames.feed(port.read(4096)):
        if isinstance(message, Telemetry) and message.session == 9:
            if message.state is State.DISARMED:
                port.write(encode(Arm(9)))
            widths_us = 1900.0 if message.state is State.ARMED else 1500.0
            if min(message.widths_us) == 1900.0 and not said:
                said = "full ahead"
                print(said, flush=True)
"""


@pytest.fixture
def start(emulators: None) -> Iterator[Callable[..., "subprocess.Popen[str]"]]:
    started: list[subprocess.Popen[str]] = []

    def start(*arguments: str) -> "subprocess.Popen[str]":
        started.append(subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE, text=True))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


def line_of(process: "subprocess.Popen[str]") -> str:
    assert process.stdout is not None
    assert select.select([process.stdout], [], [], WAIT_S)[0], "it said nothing"
    return process.stdout.readline().strip()


def seen(log: Path) -> list[list[str]]:
    return [line.split() for line in log.read_text().rpartition("\n")[0].splitlines()]


def all_neutral_at_us(log: Path) -> float | None:
    """When the last channel that was not neutral became so, by the board's time; None while one is not."""
    rises_us, widths = {}, {}
    for _, what, *values in seen(log):
        if what == "pulse":
            channel, width_us, rise_us = int(values[0]), float(values[1]), float(values[2])
            widths[channel], rises_us[channel] = width_us, rise_us
    is_neutral = len(widths) == 8 and all(abs(width_us - 1500.0) <= 1.0 for width_us in widths.values())
    return max(rises_us.values()) if is_neutral else None


def test_h1_all_outputs_are_neutral_250_ms_after_the_program_was_killed_at_full_thrust(
    start: Callable[..., "subprocess.Popen[str]"], tmp_path: Path
) -> None:
    link, log = tmp_path / "esc", tmp_path / "log"
    board = start("-m", "snr_sim.devices.emulated.pty_board", str(FIRMWARE), "--link", str(link), "--log", str(log))
    assert line_of(board) == f"atmega328p at {link}"
    program = start("-c", FULL_AHEAD, str(link))
    assert line_of(program) == "full ahead"
    os.kill(program.pid, signal.SIGKILL)
    program.wait()
    until_s = time.monotonic() + WAIT_S
    while (neutral_us := all_neutral_at_us(log)) is None and time.monotonic() < until_s:
        select.select([], [], [], 0.02)
    assert neutral_us is not None
    last_heard_us = max(float(at_us) for at_us, what, *_ in seen(log) if what == "rx")
    assert 0.0 < (neutral_us - last_heard_us) / 1000 <= NEUTRAL_WITHIN_MS
    print(f"neutral after {(neutral_us - last_heard_us) / 1000:.1f} ms")
