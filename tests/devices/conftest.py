"""The vehicle's firmware on an emulated microcontroller, as a bench for devices on its serial line."""

import fcntl
import os
import select
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from snr_sim.devices.emulated.board import Board, EmulatedPort
from snr_sim.devices.emulated.toolchain import firmware_elf
from snr_sim.devices.mcu.mcu import McuPwm
from snr_sim.devices.mcu.mcu_board import McuBoard
from snr_sim.devices.wire.serial_port import SerialPort
from snr_sim.prelude.errors import DeviceError

STEP_S = 0.001
FIRMWARE = Path(__file__).parents[2] / "robots" / "urov" / "firmware"


class EmulatedBench:
    """A board on a bench with the board's time, and a plug that can be pulled. Implements `PwmBench`."""

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


class DeliveringPort(SerialPort):
    """A real serial port whose bytes arrive at once, in the board's time: a test depends on no other clock."""

    def __init__(self, bench: "PtyBench") -> None:
        super().__init__(str(bench.link))
        self._bench = bench

    def write(self, data: bytes) -> None:
        super().write(data)
        self._bench.take_in(len(data))

    def wait(self, seconds: float) -> bool:
        end_s = self._bench.now_s() + seconds
        while not super().wait(0.0) and self._bench.now_s() < end_s - 1e-6:
            self._bench.advance(STEP_S)
        return super().wait(0.0)


class PtyBench(EmulatedBench):
    """The same behind a pseudo terminal: the system's terminal, pyserial, and a plug that hangs up."""

    def __init__(self, link: Path) -> None:
        super().__init__()
        self.link = link
        self._far = self._near = -1
        self.plug_in()

    def open_port(self) -> SerialPort:  # type: ignore[override]
        return DeliveringPort(self)

    def plug_in(self) -> None:
        self._far, self._near = os.openpty()
        tty.setraw(self._near)
        self.link.symlink_to(os.ttyname(self._near))

    def unplug(self) -> None:
        if self._far >= 0:
            self.link.unlink()
            os.close(self._far)
            os.close(self._near)
            self._far = -1

    def take_in(self, count: int) -> None:
        """Deliver this many bytes to the board, once the system has passed them on."""
        while count:
            assert select.select([self._far], [], [], 60.0)[0], "the terminal keeps the bytes"
            data = os.read(self._far, count)
            self.board.uart_in(data)
            count -= len(data)

    def advance(self, seconds: float) -> None:
        end_us = self.board.now_us + seconds * 1e6
        while (left_us := end_us - self.board.now_us) > 1.0:
            self.board.run_us(min(STEP_S * 1e6, left_us))
            data = self.board.uart_out()
            if data and self._far >= 0:
                there = waiting(self._near)
                os.write(self._far, data)
                while waiting(self._near) < min(4000, there + len(data)):
                    select.select([self._near], [], [], 0.001)  # until the system has passed them on


def waiting(terminal: int) -> int:
    """Return how many bytes can be read there."""
    return int.from_bytes(fcntl.ioctl(terminal, termios.FIONREAD, bytes(4)), sys.byteorder)


@pytest.fixture
def pty_bench(emulators: None, tmp_path: Path) -> Iterator[PtyBench]:
    bench = PtyBench(tmp_path / "ttyUSB0")
    yield bench
    bench.unplug()
    bench.board.close()


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
