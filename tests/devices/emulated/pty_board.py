"""An emulated microcontroller on a serial port, in real time, for programs that open serial ports.

    python tests/devices/emulated/pty_board.py robots/urov/firmware --link /tmp/esc --log /tmp/esc.log

The emulated line's baud rate is used. If the computer is too busy to keep up, the emulated time pauses; the log
contains by how much.
"""

from __future__ import annotations

import argparse
import select
import time
from collections.abc import Callable
from pathlib import Path
from typing import TextIO

from snr_sim.devices.emulated.board import PINS, Board
from snr_sim.devices.emulated.pty_end import PtyEnd, until_ended
from snr_sim.devices.emulated.toolchain import firmware_elf

STEP_S = 0.001
_MAX_BEHIND_S = 0.02
_START_US = 10_000.0  # so that the firmware receives as soon as the port exists
_WAITING_BYTES = 256  # on the line; more stay with the sender, as in a real port


class PtyBoard:
    """A board behind a pseudo terminal.

    Args:
        link: path of a link to the terminal; removed at the end.
        log: a line for each event: `rx` bytes from the computer, `pulse` when a channel's width has changed, `behind`
            milliseconds in which the time was paused, `start` of the board's time by the monotonic clock [s];
            each after the board's time [us].
    """

    def __init__(self, board: Board, link: Path, log: TextIO | None = None) -> None:
        self.board = board
        self._end = PtyEnd(link)
        self._log = log
        self._last_us: dict[int, float] = {}

    def serve(self, is_running: Callable[[], bool]) -> None:
        """Run in real time while `is_running` returns true."""
        start_s = time.monotonic() - self.board.now_us * 1e-6
        self._note("start", f"{start_s:.6f}")
        while is_running():
            is_ready = self._wait()
            behind_s = time.monotonic() - start_s - self.board.now_us * 1e-6
            if behind_s > _MAX_BEHIND_S:
                start_s += behind_s - STEP_S
                self._note("behind", f"{behind_s * 1e3:.1f}")
                self._note("start", f"{start_s:.6f}")
            self.board.run_until_us((time.monotonic() - start_s) * 1e6)
            if is_ready:  # only now: the bytes arrive now, however late the board is
                self._take()
            self._give()
            self._note_pulses()

    def close(self) -> None:
        """Close the terminal."""
        self._end.close()

    def _wait(self) -> bool:
        """Wait for bytes, at most one step; return whether there are some, and space for them."""
        has_room = self.board.waiting < _WAITING_BYTES
        return bool(select.select([self._end] if has_room else [], [], [], STEP_S)[0])

    def _take(self) -> None:
        data = self._end.read(max(1, _WAITING_BYTES - self.board.waiting))
        self.board.uart_in(data)
        self._note("rx", str(len(data)))

    def _give(self) -> None:
        self._end.write(self.board.uart_out())

    def _note_pulses(self) -> None:
        for pulse in self.board.pulses():
            if self._last_us.get(pulse.channel) != pulse.width_us:
                self._last_us[pulse.channel] = pulse.width_us
                self._note("pulse", f"{pulse.channel} {pulse.width_us:.2f} {pulse.rise_us:.1f}")

    def _note(self, what: str, values: str) -> None:
        if self._log is not None:
            self._log.write(f"{self.board.now_us:.1f} {what} {values}\n")
            self._log.flush()


def main() -> None:
    """Run until a signal arrives or the parent process ends."""
    parser = argparse.ArgumentParser(description="An emulated microcontroller on a serial port, in real time.")
    parser.add_argument("firmware", type=Path, help="folder of the firmware, with its Makefile")
    parser.add_argument("--link", type=Path, required=True, help="where to put the port")
    parser.add_argument("--mcu", choices=list(PINS), default="atmega328p")
    parser.add_argument("--log", type=argparse.FileType("w"), help="file for what is seen at the pins")
    options = parser.parse_args()
    board = Board(firmware_elf(options.firmware, options.mcu), options.mcu)
    board.run_us(_START_US)
    served = PtyBoard(board, options.link, options.log)
    is_running = until_ended()
    print(f"{options.mcu} at {options.link}", flush=True)
    try:
        served.serve(is_running)
    finally:
        served.close()
        board.close()


if __name__ == "__main__":
    main()
