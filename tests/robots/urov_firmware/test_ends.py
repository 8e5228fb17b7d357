"""Real processes and a real serial port: what the pins do when the computer's program ends, however it does."""

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
PTY_BOARD = Path(__file__).parents[2] / "devices" / "emulated" / "pty_board.py"
KILLED_WITHIN_MS = 250.0
ENDED_WITHIN_MS = 20.0
WAIT_S = 60.0
FULL_AHEAD = """
import sys, time

from snr_sim import CliRunner, Config, Loop, LoopFactory
from snr_sim.devices.mcu.mcu import McuPwm
from snr_sim.devices.mcu.mcu_board import McuBoard
from snr_sim.devices.pwm.pwm_loop import PwmLoopFactory
from snr_sim.devices.wire.serial_port import SerialPort

PORT, HOW = sys.argv[1:]


class Outputs(PwmLoopFactory):
    def get(self, parent):
        now_s = parent.get_time_s
        self.open_device = lambda: McuPwm(McuBoard(lambda: SerialPort(PORT), now_s), now_s, 8)
        return super().get(parent)


class Ahead(Loop):
    max_tick_rate_hz = 50
    is_there = False

    def loop(self):
        page = self.parent.get_page("pwm_applied")
        state = page.data["state"] if page else ""
        self.store_data("pwm", {"pulses_us": [1900.0 if state == "active" else 1500.0] * 8})
        if page and min(page.data["pulses_us"]) == 1900.0 and not self.is_there:
            self.is_there = True
            print("full ahead", flush=True)
            if HOW == "raise":
                raise RuntimeError("on purpose")
            if HOW == "exit":
                sys.exit(3)


class AheadFactory(LoopFactory):
    def get(self, parent):
        return Ahead(self, parent, "ahead")


if __name__ == "__main__":
    factories = [AheadFactory(), Outputs("pwm", None, 100.0)]
    CliRunner(Config(factories={"robot": factories}), ["ahead", "robot"]).run()
"""
Process = subprocess.Popen[str]


@pytest.fixture
def start(emulators: None) -> Iterator[Callable[..., Process]]:
    started: list[Process] = []

    def start(*arguments: str) -> Process:
        started.append(subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE, text=True))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


def line_of(process: Process) -> str:
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
            if abs(width_us - widths.get(channel, 0.0)) > 1.0:  # else it is as neutral as before
                widths[channel], rises_us[channel] = width_us, rise_us
    is_neutral = len(widths) == 8 and all(abs(width_us - 1500.0) <= 1.0 for width_us in widths.values())
    return max(rises_us.values()) if is_neutral else None


@pytest.mark.wall_clock
@pytest.mark.parametrize(
    ("how", "within_ms"),
    [
        pytest.param(signal.SIGKILL, KILLED_WITHIN_MS, id="h1-killed"),
        pytest.param(signal.SIGTERM, ENDED_WITHIN_MS, id="h8-sigterm"),
        pytest.param(signal.SIGINT, ENDED_WITHIN_MS, id="h8-sigint"),
        pytest.param("raise", ENDED_WITHIN_MS, id="h8-exception"),
        pytest.param("exit", ENDED_WITHIN_MS, id="h8-sys-exit"),
    ],
)
def test_h1_h8_program_ending_at_full_thrust_sets_neutral_in_time(
    start: Callable[..., Process], tmp_path: Path, how: str | signal.Signals, within_ms: float
) -> None:
    link, log = tmp_path / "esc", tmp_path / "log"
    board = start(str(PTY_BOARD), str(FIRMWARE), "--link", str(link), "--log", str(log))
    assert line_of(board) == f"atmega328p at {link}"
    program_file = tmp_path / "ahead.py"
    program_file.write_text(FULL_AHEAD)
    program = start(str(program_file), str(link), str(how))
    assert line_of(program) == "full ahead"
    if isinstance(how, signal.Signals):
        program.send_signal(how)
    program.communicate(timeout=WAIT_S)
    until_s = time.monotonic() + WAIT_S
    while (neutral_us := all_neutral_at_us(log)) is None and time.monotonic() < until_s:
        select.select([], [], [], 0.02)
    assert neutral_us is not None
    last_received_us = max(float(at_us) for at_us, what, *_ in seen(log) if what == "rx")  # its last frame: neutral
    assert (neutral_us - last_received_us) / 1000 <= within_ms
    print(f"{how}: neutral {(neutral_us - last_received_us) / 1000:.1f} ms after the program's last byte")
