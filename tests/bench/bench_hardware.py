"""Outputs behind a microcontroller: cost of a tick, speed of the emulated board, latency of a pin.

Run by `snr bench hardware`.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from statistics import median

from harness import Outcome, Row, Skipped, what_can_run

from snr_sim import Config, Node, TimeoutLoopFactory, WallClock
from snr_sim.devices.emulated.board import PINS, Board, EmulatedPort
from snr_sim.devices.emulated.lock_step import ProcessorInLoopPlant
from snr_sim.devices.emulated.toolchain import firmware_elf
from snr_sim.devices.mcu.mcu import McuPwm
from snr_sim.devices.mcu.mcu_board import McuBoard
from snr_sim.devices.wire.mcu_frames import encode
from snr_sim.devices.wire.mcu_messages import (
    BAUD,
    TYPE_OF,
    AckResult,
    Arm,
    CommandAck,
    FromMcu,
    Ident,
    McuFault,
    McuState,
    ResetCause,
    Telemetry,
)
from snr_sim.devices.wire.serial_port import BytePort, SerialPort
from snr_sim.prelude.signals import PowerReading
from snr_sim.testing.function_components import FunctionLoop, FunctionLoopFactory

FIRMWARE = Path(__file__).parents[2] / "robots" / "urov" / "firmware"
PTY_BOARD = Path(__file__).parents[1] / "devices" / "emulated" / "pty_board.py"
CHANNELS = 8
STILL = [1500.0] * CHANNELS
STEP_S = 0.005
MAX_TICK_US = 150.0
MIN_SPEED = 20.0
MAX_LATENCY_MS = 12.0
LATENCY_HZ = 100.0
# Commands rise by 1 us each, and after this many jump back. Those around the jump are not counted: the first are
# slewed, and the last may be replaced by a smaller one before their pulse is due, so that they are never output.
LOWEST_US, WIDTHS, SETTLED = 1550.0, 300, 12
START_S = 3.0  # delay of the first bytes: long enough to be armed by the first command
SHOWN_S = 0.1  # timeout of a command at the pin, so that the next row is not matched with it
IDENT = Ident(
    0, 1, 1, (1, 0), 8, 1100.0, 1500.0, 1900.0, 25.0, 500, 8000, 200, 1500, 400, 50, "atmega328p", "snr_sim esc"
)


def measure(is_quick: bool) -> Iterator[Outcome]:
    """Yield the rows of the table."""
    ticks, seconds = (500, 3.0) if is_quick else (5000, 30.0)
    yield tick_row("a tick of eight channels, port of a test", ticks, MemoryPort())
    yield from what_can_run("a tick of eight channels, serial port (pty)", lambda: pty_rows(ticks))
    yield from what_can_run("the emulated board", lambda: board_rows(2.0 if is_quick else 10.0, seconds))
    yield from what_can_run("command to pin", lambda: latency_rows(seconds))


def pty_rows(ticks: int) -> Iterator[Row]:
    """Yield what a tick costs on a port of the system's."""
    with tempfile.TemporaryDirectory() as folder:
        yield tick_row("a tick of eight channels, serial port (pty)", ticks, PtyPort(Path(folder) / "port"))


def board_rows(lock_step_s: float, line_s: float) -> Iterator[Row]:
    """Yield how fast the emulated board goes."""
    for mcu in PINS:
        yield lock_step_row(mcu, lock_step_s)
    yield line_row(line_s)


Pulses = list[list[tuple[float, float]]]  # of each channel: start [s] and width [us] of pulses whose width changed


class FarEnd:
    """A board with prepared replies. It is not part of the measurement and costs only the transfer of its bytes."""

    def __init__(self) -> None:
        self.frame_count = 0

    def answers(self) -> bytes:
        """Return an answer to whatever may have been asked, and telemetry."""
        words: list[FromMcu] = [
            Ident(*(getattr(IDENT, field) for field in IDENT.__struct_fields__)),
            CommandAck(0, 1, TYPE_OF[Arm], AckResult.DONE),
            self.telemetry(),
        ]
        return b"".join(map(encode, words))

    def telemetry(self) -> Telemetry:
        """Return the next one, of a board that is armed and stands still."""
        self.frame_count += 1
        known = McuState.ARMED, McuFault(0), ResetCause.EXTERNAL
        return Telemetry(
            self.frame_count % 256,
            1,
            self.frame_count,
            self.frame_count * 20,
            *known,
            0,
            0,
            1345,
            330,
            (1600.5,) * CHANNELS,
        )


class MemoryPort(FarEnd):
    """A port without a wire."""

    name = "memory"

    def __init__(self) -> None:
        super().__init__()
        self.come = b""

    def feed(self, data: bytes) -> None:
        """Add received bytes."""
        self.come += data

    def open(self) -> BytePort:
        """Return itself."""
        return self

    def write(self, data: bytes) -> None:
        """Take bytes."""

    def read(self) -> bytes:
        """Return what has come."""
        come, self.come = self.come, b""
        return come

    def wait(self, seconds: float) -> bool:
        """Do not wait."""
        return True

    def close(self) -> None:
        """Do nothing: there is no port to close."""


class PtyPort(FarEnd):
    """A port of the operating system, whose other end reads the sent bytes."""

    def __init__(self, link: Path) -> None:
        super().__init__()
        self._far, self._near = os.openpty()
        tty.setraw(self._near)
        os.set_blocking(self._far, False)
        link.symlink_to(os.ttyname(self._near))
        self._link = link

    def feed(self, data: bytes) -> None:
        """Add received bytes, and take those that were sent."""
        with suppress(BlockingIOError):
            os.read(self._far, 4096)
        os.write(self._far, data)

    def open(self) -> BytePort:
        """Open it."""
        return AnsweringPort(self, str(self._link))


class AnsweringPort(SerialPort):
    """A serial port whose other end answers during a wait."""

    def __init__(self, end: PtyPort, path: str) -> None:
        super().__init__(path, BAUD)
        self._end = end

    def wait(self, seconds: float) -> bool:
        """Let the other end answer."""
        self._end.feed(self._end.answers())
        return super().wait(seconds)


def tick_row(name: str, ticks: int, port: MemoryPort | PtyPort) -> Row:
    """Measure write_us: read telemetry and send a command."""
    now_s = 0.0
    port.feed(port.answers())
    out = McuPwm(McuBoard(port.open, lambda: now_s, session=1), lambda: now_s, CHANNELS)
    out.configure()
    out.activate()
    port.feed(port.answers())
    pulses = [1600.5 + i for i in range(CHANNELS)]
    times_s = []
    for i in range(ticks):
        now_s = i * 0.02
        port.feed(encode(port.telemetry()))
        begin_s = time.thread_time()
        out.write_us(pulses, now_s)
        times_s.append(time.thread_time() - begin_s)
    assert out.health().state == "active", out.health()
    out.close()
    times_s.sort()
    note = f"median; p99 {times_s[int(0.99 * ticks)] * 1e6:.0f} us"
    return Row(name, median(times_s) * 1e6, "us CPU", limit=MAX_TICK_US, note=note)


class Battery:
    """A plant that has a battery and nothing else."""

    engine, step_s = "none", STEP_S
    inputs, outputs = ("pwm",), ("power",)
    time_s = 0.0

    def step(self, dt_s: float) -> None:
        """Let time pass."""
        self.time_s += dt_s

    def read(self, name: str) -> PowerReading:
        """Return what the battery gives."""
        return PowerReading(14.8, 12.0, self.time_s)

    def write(self, name: str, command: object) -> None:
        """Take pulses."""


def lock_step_row(mcu: str, seconds: float) -> Row:
    """Measure board, serial line and outputs in lock step at 50 Hz, without the vehicle's physics."""
    elf = firmware_elf(FIRMWARE, mcu)
    battery = Battery()
    plant = ProcessorInLoopPlant(battery, lambda: Board(elf, mcu), CHANNELS, power="power")  # type: ignore[arg-type]
    out = McuPwm(plant.mcu, lambda: battery.time_s, CHANNELS)

    def run(seconds: float, pulses: Callable[[float], list[float]]) -> None:
        for i in range(round(seconds / STEP_S)):
            plant.step(STEP_S)
            if i % 4 == 0:
                out.write_us(pulses(battery.time_s), battery.time_s)

    out.configure()
    out.activate()
    run(2.0, lambda t: STILL)
    assert out.health().state == "active", out.health()
    begin_s = time.process_time()
    run(seconds, lambda t: [1500.0 + 200.0 * math.sin(t + i) for i in range(CHANNELS)])
    speed = seconds / (time.process_time() - begin_s)
    out.close()
    plant.board.close()
    name = f"emulated lock step, eight channels and telemetry, {mcu}"
    return Row(name, speed, "x real time", limit=MIN_SPEED, more_is_better=True, note="CPU time; commands at 50 Hz")


def latency_rows(seconds: float) -> Iterator[Outcome]:
    """Measure from the moment a loop on a thread computed a command to the first pulse at each pin that shows it.

    In wall time; and without the emulated board's waits for a processor, which a real board does not have: another
    board receives the same bytes at exactly the times at which they were written.
    """
    with tempfile.TemporaryDirectory() as folder:
        link, log = Path(folder) / "esc", Path(folder) / "log"
        arguments = [str(FIRMWARE), "--link", str(link), "--log", str(log)]
        command = [sys.executable, str(PTY_BOARD), *arguments]
        written: list[tuple[float, bytes]] = []
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as board:
            assert board.stdout is not None
            board.stdout.readline()
            try:
                sent, shares_ms = drive(lambda: TimedPort(str(link), written), seconds)
            finally:
                board.terminate()
                board.communicate()
        seen = seen_in(log.read_text())
    how = f"{LATENCY_HZ:g} Hz over a pty at {BAUD} baud"
    yield latency_row("command to pin, p99, wall time", sent, seen, how)
    yield latency_row("command to pin, p99, the emulator never late", sent, seen_by_another(written), how)
    shares_ms.sort()
    note = f"from command to port, but for standing in line for a core; median {median(shares_ms):.2f} ms"
    yield Row("of that the computer's share, p99", shares_ms[int(0.99 * len(shares_ms))], "ms", note=note)


def latency_row(name: str, sent: list[tuple[float, float]], seen: Pulses, how: str) -> Outcome:
    """Return the row of what was sent and seen."""
    latencies_ms = sorted(latencies(sent, seen))
    counted = CHANNELS * sum(is_counted(width) for _, width in sent)
    if not latencies_ms:
        return Skipped(name, "no command was shown at a pin in time: this computer is too busy for the emulator")
    middle, longest = median(latencies_ms), latencies_ms[-1]
    missed = 100.0 * (1.0 - len(latencies_ms) / counted)
    note = f"{how}; median {middle:.1f}, most {longest:.1f} ms; {missed:.1f} % never shown"
    return Row(name, latencies_ms[int(0.99 * len(latencies_ms))], "ms", limit=MAX_LATENCY_MS, note=note)


class TimedPort(SerialPort):
    """A serial port that records the written bytes and their times."""

    def __init__(self, path: str, written: list[tuple[float, bytes]]) -> None:
        super().__init__(path, BAUD)
        self._written = written

    def write(self, data: bytes) -> None:
        """Send bytes."""
        super().write(data)
        self._written.append((time.monotonic(), data))


def seen_by_another(written: list[tuple[float, bytes]]) -> Pulses:
    """Return what pins show that get the same bytes, each at the time when it was written."""
    board = Board(firmware_elf(FIRMWARE, "atmega328p"))
    pulses: Pulses = [[] for _ in range(CHANNELS)]
    start_s = written[0][0] - START_S
    for time_s, data in [*written, (written[-1][0] + SHOWN_S, b"")]:
        board.run_until_us((time_s - start_s) * 1e6)
        board.uart_in(data)
        board.uart_out()
        for pulse in board.pulses():
            pulses[pulse.channel].append((start_s + pulse.rise_us * 1e-6, pulse.width_us))
    board.close()
    return pulses


def stood_in_line_s() -> float:
    """Return how long this thread was ready to run but had no core; 0 where the kernel does not report it."""
    try:
        return int(Path("/proc/thread-self/schedstat").read_text().split()[1]) * 1e-9
    except OSError:
        return 0.0


def drive(open_port: Callable[[], BytePort], seconds: float) -> tuple[list[tuple[float, float]], list[float]]:
    """Let a loop on a thread command another width in each tick.

    Returns:
        When [s, monotonic] and which; and how long each took to be written [ms], of which it had a core.
    """
    sent: list[tuple[float, float]] = []
    shares_ms: list[float] = []

    def open_board(loop: FunctionLoop) -> None:
        board = McuBoard(open_port, loop.get_time_s)
        loop.out = McuPwm(board, loop.get_time_s, CHANNELS)  # type: ignore[attr-defined]
        loop.out.configure()  # type: ignore[attr-defined]
        loop.out.activate()  # type: ignore[attr-defined]

    def command(loop: FunctionLoop) -> None:
        out: McuPwm = loop.out  # type: ignore[attr-defined]
        width = 1500.0
        if out.health().state == "active":
            width = LOWEST_US + len(sent) % WIDTHS
            sent.append((time.monotonic(), width))
        begun_s, stood_s = time.monotonic(), stood_in_line_s()
        out.write_us([width] * CHANNELS, loop.get_time_s())
        shares_ms.append((time.monotonic() - begun_s - (stood_in_line_s() - stood_s)) * 1e3)

    ticker = FunctionLoopFactory(
        command, "pilot", LATENCY_HZ, setup=open_board, terminate=lambda loop: loop.out.close()
    )  # type: ignore[attr-defined]
    Node("r", Config(factories={"r": [ticker, TimeoutLoopFactory(seconds=seconds + 2.5)]}), clock=WallClock()).loop()
    return sent[50:-5], shares_ms[50:]  # the first go from 1500 up


def line_row(seconds: float) -> Row:
    """Measure the same by the board's time alone: what line and firmware take, without the computer's share."""
    board = Board(firmware_elf(FIRMWARE, "atmega328p"))

    def now_s() -> float:
        return board.now_us * 1e-6

    out = McuPwm(McuBoard(lambda: EmulatedPort(board), now_s, now_s, session=1), now_s, CHANNELS)
    out.configure()
    out.activate()
    sent: list[tuple[float, float]] = []
    seen: Pulses = [[] for _ in range(CHANNELS)]
    end_s = now_s() + seconds + 2.5
    while now_s() < end_s:
        board.run_us(1e6 / LATENCY_HZ + 130.0)  # so that all phases of the pulses occur
        for pulse in board.pulses():
            seen[pulse.channel].append((pulse.rise_us * 1e-6, pulse.width_us))
        width = 1500.0
        if out.health().state == "active":
            width = LOWEST_US + len(sent) % WIDTHS
            sent.append((now_s(), width))
        out.write_us([width] * CHANNELS, now_s())
    out.close()
    board.close()
    return latency_row("command to pin, p99, line and firmware alone", sent[50:-5], seen, "time of the emulated board")


def seen_in(log: str) -> Pulses:
    """Return the pulses in the log of a board, by the computer's clock."""
    start_s = 0.0
    pulses: Pulses = [[] for _ in range(CHANNELS)]
    for line in log.splitlines():
        _, what, *values = line.split()
        if what == "start":
            start_s = float(values[0])
        elif what == "pulse":
            channel, width, rise_us = int(values[0]), float(values[1]), float(values[2])
            pulses[channel].append((start_s + rise_us * 1e-6, width))
    return pulses


def is_counted(width_us: float) -> bool:
    """Return whether a command is one that must be shown before another takes its place."""
    return LOWEST_US + SETTLED <= width_us <= LOWEST_US + WIDTHS - SETTLED


def latencies(sent: list[tuple[float, float]], pulses: Pulses) -> Iterator[float]:
    """Yield how long each command took to the first pulse that shows it [ms], at each pin."""
    for channel in pulses:
        place = 0
        for sent_s, width in sent:
            if not is_counted(width):
                continue
            while place < len(channel) and channel[place][0] < sent_s:
                place += 1
            for rise_s, seen_us in channel[place:]:
                if rise_s > sent_s + SHOWN_S:
                    break
                if seen_us > width - 0.5:
                    yield (rise_s - sent_s) * 1e3
                    break
