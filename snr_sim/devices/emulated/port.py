"""The serial port of an emulated board: no wire, no operating system, and time that passes only when it is told to."""

from __future__ import annotations

from snr_sim.devices.emulated.board import Board
from snr_sim.prelude.errors import DeviceError

_STEP_US = 500.0  # of waiting; a byte takes 87
_CYCLE_US = 0.0625  # nothing shorter passes


class EmulatedPort:
    """A port that leads to an emulated board. Keeps the promise of BytePort.

    Args:
        board: at its other end.
        name: what messages call it.
    """

    def __init__(self, board: Board, name: str = "the emulated board") -> None:
        self._board, self.name = board, name
        self._come = b""
        self._is_open = True

    def write(self, data: bytes) -> None:
        """Put bytes on the line.

        Raises:
            DeviceError: it was closed, or takes no more.
        """
        self._check()
        if self._board.uart_in(data) < len(data):
            raise DeviceError(f"{self.name} takes no more bytes.", fix="let its time go on: board.run_us.")

    def read(self) -> bytes:
        """Return what has come.

        Raises:
            DeviceError: it was closed.
        """
        self._check()
        come, self._come = self._come + self._board.uart_out(), b""
        return come

    def wait(self, seconds: float) -> bool:
        """Let the board's time go on until bytes have come; return whether they have."""
        self._check()
        end_us = self._board.now_us + seconds * 1e6
        self._come += self._board.uart_out()
        while not self._come and (left_us := end_us - self._board.now_us) > _CYCLE_US:
            self._board.run_us(min(_STEP_US, left_us))
            self._come += self._board.uart_out()
        return bool(self._come)

    def close(self) -> None:
        """End it; the board goes on. Safe to call twice."""
        self._is_open = False

    def _check(self) -> None:
        if not self._is_open:
            raise DeviceError(f"{self.name} was closed.", fix="open it again.")
