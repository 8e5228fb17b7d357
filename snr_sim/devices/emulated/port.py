"""Serial port of an emulated board: without a wire or an operating system; time advances only on request."""

from __future__ import annotations

from snr_sim.devices.emulated.board import Board
from snr_sim.prelude.errors import DeviceError

_STEP_US = 500.0  # step of waiting; a byte takes 87
_CYCLE_US = 0.0625  # smallest step of time


class EmulatedPort:
    """A port that is connected to an emulated board. Implements `BytePort`.

    Args:
        board: at its other end.
        name: its name in messages.
    """

    def __init__(self, board: Board, name: str = "the emulated board") -> None:
        self._board, self.name = board, name
        self._received = b""
        self._is_open = True

    def write(self, data: bytes) -> None:
        """Put bytes on the line.

        Raises:
            DeviceError: it was closed, or its queue is full.
        """
        self._check()
        if self._board.uart_in(data) < len(data):
            raise DeviceError(f"{self.name} takes no more bytes.", fix="advance its time with board.run_us().")

    def read(self) -> bytes:
        """Return the received bytes.

        Raises:
            DeviceError: it was closed.
        """
        self._check()
        data, self._received = self._received + self._board.uart_out(), b""
        return data

    def wait(self, seconds: float) -> bool:
        """Advance the board's time until bytes arrive; return whether they have."""
        self._check()
        end_us = self._board.now_us + seconds * 1e6
        self._received += self._board.uart_out()
        while not self._received and (left_us := end_us - self._board.now_us) > _CYCLE_US:
            self._board.run_us(min(_STEP_US, left_us))
            self._received += self._board.uart_out()
        return bool(self._received)

    def close(self) -> None:
        """Close the port; the board keeps running. Safe to call twice."""
        self._is_open = False

    def _check(self) -> None:
        if not self._is_open:
            raise DeviceError(f"{self.name} was closed.", fix="open it again.")
