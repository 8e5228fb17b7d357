"""The firmware on emulated microcontrollers: how exact at the pins, how soon neutral. All by their time, so of no load.

How fast it runs is in bench_hardware.py. Run by `snr bench firmware`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from harness import Row

from snr_sim.devices.emulated.board import PINS, Board
from snr_sim.devices.emulated.toolchain import firmware_elf, require_tools
from snr_sim.devices.wire.mcu_frames import encode
from snr_sim.devices.wire.mcu_messages import Arm, Hello, SetWidths

FIRMWARE = Path(__file__).parents[2] / "robots" / "urov" / "firmware"
SESSION, CHANNELS = 1, 8
TICK_US = 10_000
NEUTRAL_WITHIN_MS = 250.0


class Driven:
    """A board that is sent eight widths every 10 ms."""

    def __init__(self, mcu: str) -> None:
        self.board = Board(firmware_elf(FIRMWARE, mcu), mcu)
        self.ticks = 0
        self.board.run_us(1.6e6)
        self.board.uart_in(b"\0" + encode(Hello(SESSION)))
        self.tick([1500.0] * CHANNELS)
        self.board.uart_in(encode(Arm(SESSION)))
        self.tick([1500.0] * CHANNELS)

    def tick(self, widths_us: list[float]) -> None:
        self.ticks += 1
        stamp_ms = self.ticks * TICK_US // 1000
        self.board.uart_in(encode(SetWidths(SESSION, self.ticks % 65536, stamp_ms, 0, 200, tuple(widths_us))))
        self.board.run_us(TICK_US)
        self.board.uart_out()


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows of each microcontroller."""
    require_tools()
    ticks = 200 if is_quick else 1000
    for mcu in PINS:
        yield exactness(mcu, ticks)
        yield lease(mcu)


def exactness(mcu: str, ticks: int) -> Row:
    """Return the worst error of any pulse width while commands and telemetry continue."""
    target_us = [1500.0, 1100.0, 1900.0, 1234.0, 1501.0, 1500.5, 1700.0, 1299.5]
    driven = Driven(mcu)
    for _ in range(30):
        driven.tick(target_us)
    driven.board.pulses()
    for _ in range(ticks):
        driven.tick(target_us)
    pulses = driven.board.pulses()
    worst_us = max(abs(pulse.width_us - target_us[pulse.channel]) for pulse in pulses)
    return Row(f"{mcu}: worst width at a pin, of {len(pulses)} pulses", worst_us, "us", limit=1.0)


def lease(mcu: str) -> Row:
    """From the last command at full thrust to the first neutral pulse of the last channel."""
    worst_ms = 0.0
    for shift_us in range(0, 8000, 500):  # over all phases of the pulses' period
        driven = Driven(mcu)
        for _ in range(30):
            driven.tick([1900.0] * CHANNELS)
        driven.board.run_us(shift_us)
        driven.tick([1900.0] * CHANNELS)
        end_us = driven.board.now_us - TICK_US
        driven.board.pulses()
        driven.board.run_us(400_000)
        driven_us = {pulse.channel: pulse.rise_us for pulse in driven.board.pulses() if pulse.width_us > 1501.0}
        worst_ms = max(worst_ms, (max(driven_us.values()) + 8000 - end_us) / 1000)
        driven.board.close()
    return Row(f"{mcu}: silence of the computer to neutral at each pin", worst_ms, "ms", limit=NEUTRAL_WITHIN_MS)
