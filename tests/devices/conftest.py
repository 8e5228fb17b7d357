"""The vehicle's firmware on an emulated microcontroller, as a bench for what talks to it over its serial line."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from snr_sim.devices.emulated.board import Board
from snr_sim.devices.emulated.port import EmulatedPort
from snr_sim.devices.emulated.toolchain import firmware_elf
from snr_sim.devices.mcu import McuPwm
from snr_sim.devices.mcu_board import McuBoard
from snr_sim.prelude.errors import DeviceError

FIRMWARE = Path(__file__).parents[2] / "robots" / "urov" / "firmware"


class EmulatedBench:
    """A board on a bench whose time is the board's, with a plug that can be pulled. Keeps the promise of PwmBench."""

    can_unplug = True

    def __init__(self, mcu: str = "atmega328p", channels: int = 8) -> None:
        self.board = Board(firmware_elf(FIRMWARE, mcu), mcu)
        self.channels = channels
        self._port: EmulatedPort | None = None
        self._is_in = True

    def open_port(self) -> EmulatedPort:
        if not self._is_in:
            raise DeviceError("There is no serial port /dev/board.", fix="plug it in.")
        self._port = EmulatedPort(self.board, "/dev/board")
        return self._port

    def open_board(self, session: int = 1) -> McuBoard:
        return McuBoard(self.open_port, self.now_s, self.now_s, session=session)

    def open(self) -> McuPwm:
        return McuPwm(self.open_board(), self.now_s, self.channels)

    def now_s(self) -> float:
        return self.board.now_us * 1e-6

    def advance(self, seconds: float) -> None:
        self.board.run_us(seconds * 1e6)

    def pins_us(self) -> list[float]:
        return [pin.width_us for pin in self.board.pins()[: self.channels]]

    def unplug(self) -> None:
        self._is_in = False
        if self._port is not None:
            self._port.close()

    def plug_in(self) -> None:
        self._is_in = True


@pytest.fixture
def make_bench(emulators: None) -> Iterator[Callable[..., EmulatedBench]]:
    benches: list[EmulatedBench] = []

    def make(mcu: str = "atmega328p", channels: int = 8) -> EmulatedBench:
        benches.append(EmulatedBench(mcu, channels))
        return benches[-1]

    yield make
    for bench in benches:
        bench.board.close()


@pytest.fixture
def bench(make_bench: Callable[..., EmulatedBench]) -> EmulatedBench:
    return make_bench()
