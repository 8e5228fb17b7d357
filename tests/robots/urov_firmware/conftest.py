"""The vehicle's firmware on an emulated microcontroller, and the client at the other end of its line."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

import pytest

from snr_sim.devices.emulated.board import PINS, Board, Pulse
from snr_sim.devices.emulated.toolchain import firmware_elf
from snr_sim.devices.wire.mcu_frames import McuFrames, encode
from snr_sim.devices.wire.mcu_messages import (
    AckResult,
    Arm,
    CommandAck,
    FromMcu,
    Hello,
    SetWidths,
    Telemetry,
    ToMcu,
)

FIRMWARE = Path(__file__).parents[3] / "robots" / "urov" / "firmware"
CHANNELS = 8
NEUTRAL = (1500.0,) * CHANNELS
SESSION = 77
START_MS = 1550
TICK_MS = 10
Message = TypeVar("Message")


class Bench:
    """A board under test. Commands are computed when they are sent, unless stated otherwise."""

    def __init__(self, mcu: str, **settings: int) -> None:
        self.board = Board(firmware_elf(FIRMWARE, mcu, settings), mcu)
        self.frames = McuFrames()
        self.received: list[FromMcu | ToMcu] = []
        self.pulses: list[Pulse] = []
        self.seq = 0

    @property
    def now_ms(self) -> float:
        return self.board.now_us / 1000

    def run(self, ms: float) -> None:
        self.board.run_us(ms * 1000)
        self.received += self.frames.feed(self.board.uart_out())
        self.pulses += self.board.pulses()

    def send(self, *messages: ToMcu) -> None:
        for message in messages:
            assert self.board.uart_in(encode(message))

    def last(self, kind: type[Message]) -> Message:
        return next(message for message in reversed(self.received) if isinstance(message, kind))

    @property
    def telemetry(self) -> Telemetry:
        return self.last(Telemetry)

    def ask(self, message: ToMcu) -> AckResult:
        self.received.clear()
        self.send(message)
        self.run(TICK_MS)
        return self.last(CommandAck).result

    def command(self, widths_us: tuple[float, ...], stamp_ms: int | None = None, age_ms: int = 0) -> SetWidths:
        self.seq = (self.seq + 1) % 65536
        stamp_ms = int(self.now_ms) - age_ms if stamp_ms is None else stamp_ms
        return SetWidths(SESSION, self.seq, stamp_ms, age_ms, 200, widths_us)

    def drive(self, widths_us: tuple[float, ...], ms: float = TICK_MS) -> None:
        """A new command every 10 ms, for so long."""
        until_ms = self.now_ms + ms
        while self.now_ms < until_ms - 0.5:
            self.send(self.command(widths_us))
            self.run(TICK_MS)

    def ready(self) -> None:
        """Greeted, and the speed controllers have been shown neutral for long enough."""
        self.run(START_MS)
        self.send(Hello(SESSION))
        self.run(TICK_MS)

    def armed(self) -> None:
        self.ready()
        self.drive(NEUTRAL)
        assert self.ask(Arm(SESSION)) is AckResult.DONE

    def widths(self, ms: float = 17) -> list[set[float]]:
        """The widths of each channel's pulses that begin and end in the next milliseconds."""
        begin_us = self.board.now_us
        self.pulses.clear()
        self.run(ms)
        found: list[set[float]] = [set() for _ in range(CHANNELS)]
        for pulse in self.pulses:
            if pulse.rise_us >= begin_us:
                found[pulse.channel].add(pulse.width_us)
        return found


@pytest.fixture(params=list(PINS))
def mcu(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def make_bench(emulators: None) -> Iterator[Callable[..., Bench]]:
    benches: list[Bench] = []

    def make(mcu: str, **settings: int) -> Bench:
        benches.append(Bench(mcu, **settings))
        return benches[-1]

    yield make
    for bench in benches:
        bench.board.close()


@pytest.fixture
def bench(make_bench: Callable[..., Bench], mcu: str) -> Bench:
    return make_bench(mcu)
