"""A microcontroller with its firmware, in simavr: time advances only on request, and equal calls give equal results.

board = Board(firmware_elf(folder, "atmega328p"), "atmega328p")
board.uart_in(encode(Hello(1)))
board.run_us(10_000)
frames.feed(board.uart_out()); board.pulses()
"""

from __future__ import annotations

import ctypes
import struct
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from snr_sim.devices.emulated.toolchain import APT, runner_library
from snr_sim.devices.wire.mcu_messages import BAUD
from snr_sim.prelude.errors import DeviceError, ParameterError, suggest

CLOCK_HZ = 16_000_000
_CYCLES_PER_US = CLOCK_HZ // 1_000_000
# Port and bit of each channel; the same as in the firmware's pulses_*.c.
PINS: dict[str, str] = {
    "atmega328p": "D2 D3 D4 D5 D6 D7 B0 B1",
    "atmega2560": "E4 E5 E3 H3 H4 H5 B5 B6",
}
_ROOM = 65_536
_PULSES = 16_384
_RECORD = struct.Struct("=QII")  # rise, width, count or channel: takes a third of the time of ctypes
_WAIT_STEP_US = 500.0  # a byte takes 87
_CYCLE_US = 1.0 / _CYCLES_PER_US


class Pulse(NamedTuple):
    """A pulse that has ended."""

    channel: int
    rise_us: float  # its rising edge, since power on
    width_us: float


class Pin(NamedTuple):
    """Last state of a channel's pin."""

    rise_us: float  # rising edge of the last pulse, since power on; it may not have ended
    width_us: float  # of the last pulse that has ended; 0 if there was none
    pulses: int  # that have ended


@cache
def _library(path: Path) -> Any:
    try:
        library = ctypes.CDLL(str(path))
    except OSError as error:
        path.unlink(missing_ok=True)  # it was made for another version of simavr: the next call compiles it again
        raise DeviceError(
            f"The emulator cannot be loaded: {error}.", fix=f"try again; if it fails again: {APT}"
        ) from error
    pointer, size, number = ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint32
    library.board_open.restype = pointer
    library.board_open.argtypes = (ctypes.c_char_p, ctypes.c_char_p, number, number, ctypes.c_char_p)
    library.board_run.restype = size
    library.board_run.argtypes = (pointer, size)
    library.board_put.argtypes = (pointer, ctypes.c_char_p, number)
    library.board_millivolts.argtypes = (pointer, number, number)
    for name in ("board_get", "board_pulses"):
        getattr(library, name).argtypes = (pointer, pointer, number)
    library.board_supply.argtypes = (pointer, number)
    library.board_pins.argtypes = (pointer, pointer)
    for name in ("board_close", "board_reset", "board_resets", "board_waiting"):
        getattr(library, name).argtypes = (pointer,)
    for name in ("board_put", "board_get", "board_pulses", "board_resets", "board_waiting"):
        getattr(library, name).restype = number
    return library


class _ClosedBoard:
    """Replacement for calls to a board that is off: the library would end the program."""

    def __getattr__(self, name: str) -> Any:
        raise DeviceError("The emulated board was switched off.", fix="create another Board.")


class Board:
    """One microcontroller, from power on.

    Args:
        elf: its firmware.
        mcu: "atmega328p" or "atmega2560".
        baud: of the program at the other end; the firmware has its own.

    Raises:
        ToolsMissingError: the packages that the emulator is made with are not installed.
        DeviceError: simavr cannot read the file, or does not know the microcontroller.
    """

    def __init__(self, elf: Path, mcu: str = "atmega328p", baud: int = BAUD) -> None:
        if mcu not in PINS:
            raise ParameterError(f"There is no emulated microcontroller '{mcu}'.", fix=suggest(mcu, PINS))
        self.mcu: str = mcu
        self._library = _library(runner_library())
        pins = PINS[mcu].replace(" ", "").encode()
        self._board = self._library.board_open(str(elf).encode(), mcu.encode(), CLOCK_HZ, baud, pins)
        if not self._board:
            raise DeviceError(f"simavr cannot run {elf} on an {mcu}.", fix="compile it again: `make` in its folder.")
        self.channels: int = len(pins) // 2
        self._until_us = 0.0
        self._now = 0  # cycles
        self._bytes = ctypes.create_string_buffer(_ROOM)
        self._pulses = ctypes.create_string_buffer(_RECORD.size * _PULSES)
        self._pins = ctypes.create_string_buffer(_RECORD.size * self.channels)

    @property
    def now_us(self) -> float:
        """Time since power on."""
        return self._now / _CYCLES_PER_US

    def run_us(self, us: float) -> None:
        """Advance time. An instruction that overruns shortens the next call: errors do not add up."""
        self.run_until_us(self._until_us + us)

    def run_until_us(self, us: float) -> None:
        """Advance to a time after power on, unless that has passed; raise a DeviceError if the firmware has halted."""
        self._until_us = max(self._until_us, us)
        until = round(self._until_us * _CYCLES_PER_US)
        if until > self._now:
            self._now = self._library.board_run(self._board, until)
            if self._now == 0:
                raise DeviceError(
                    "The emulated firmware has halted.", fix="read its last output with board.uart_out()."
                )

    def uart_in(self, data: bytes) -> int:
        """Put bytes on the line, at its baud rate; return how many were accepted: the queue holds 65536."""
        return int(self._library.board_put(self._board, data, len(data)))

    def uart_out(self) -> bytes:
        """Return the bytes received from the microcontroller since the last call."""
        count = self._library.board_get(self._board, self._bytes, _ROOM)
        return ctypes.string_at(self._bytes, count)

    @property
    def waiting(self) -> int:
        """Bytes queued on the line to the microcontroller."""
        return int(self._library.board_waiting(self._board))

    def pulses(self) -> list[Pulse]:
        """Return the pulses that have ended since the last call, at most the last 16384, ordered by falling edge."""
        count = self._library.board_pulses(self._board, self._pulses, _PULSES)
        return [
            Pulse(channel, rise / _CYCLES_PER_US, width / _CYCLES_PER_US)
            for rise, width, channel in _RECORD.iter_unpack(ctypes.string_at(self._pulses, _RECORD.size * count))
        ]

    def pins(self) -> list[Pin]:
        """Return the last state of each channel."""
        self._library.board_pins(self._board, self._pins)
        return [
            Pin(rise / _CYCLES_PER_US, width / _CYCLES_PER_US, count)
            for rise, width, count in _RECORD.iter_unpack(self._pins)
        ]

    def set_millivolts(self, pin: int, millivolts: float) -> None:
        """Apply a voltage, 0 to 5000, to an analogue pin: 0 is A0."""
        self._library.board_millivolts(self._board, pin, max(0, round(millivolts)))

    def set_supply_millivolts(self, millivolts: float) -> None:
        """Set the supply, 5000 at power on, the ADC's reference; brown-out is not emulated."""
        self._library.board_supply(self._board, round(millivolts))

    def reset(self) -> None:
        """Pull the reset pin, as opening the port of an Arduino does."""
        self._library.board_reset(self._board)

    @property
    def resets(self) -> int:
        """Number of resets since power on, from any cause."""
        return int(self._library.board_resets(self._board))

    def close(self) -> None:
        """Switch it off. Safe to call twice; any other call afterwards raises a DeviceError."""
        if self._board:
            self._library.board_close(self._board)
            self._board, self._library = None, _ClosedBoard()

    def __enter__(self) -> Board:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class EmulatedPort:
    """Serial port of a board, without a wire or an operating system. Implements `BytePort`."""

    def __init__(self, board: Board, name: str = "the emulated board") -> None:
        self._board = board
        self.name: str = name
        self._received = b""
        self._is_open = True

    def write(self, data: bytes) -> None:
        """Put bytes on the line; raise a DeviceError if it was closed or its queue is full."""
        self._check()
        if self._board.uart_in(data) < len(data):
            raise DeviceError(f"{self.name} takes no more bytes.", fix="advance its time with board.run_us().")

    def read(self) -> bytes:
        """Return the received bytes; raise a DeviceError if it was closed."""
        self._check()
        data, self._received = self._received + self._board.uart_out(), b""
        return data

    def wait(self, seconds: float) -> bool:
        """Advance the board's time until bytes arrive; return whether they have."""
        self._check()
        end_us = self._board.now_us + seconds * 1e6
        self._received += self._board.uart_out()
        while not self._received and (left_us := end_us - self._board.now_us) > _CYCLE_US:
            self._board.run_us(min(_WAIT_STEP_US, left_us))
            self._received += self._board.uart_out()
        return bool(self._received)

    def close(self) -> None:
        """Close the port; the board keeps running. Safe to call twice."""
        self._is_open = False

    def _check(self) -> None:
        if not self._is_open:
            raise DeviceError(f"{self.name} was closed.", fix="open it again.")
