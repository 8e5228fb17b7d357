"""The emulated board behind a serial port, as a process: it answers, and removes its files, however it ends."""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from snr_sim.devices.emulated.board import Board
from snr_sim.devices.emulated.toolchain import firmware_elf
from snr_sim.devices.wire.mcu_frames import McuFrames, encode
from snr_sim.devices.wire.mcu_messages import Hello, Ident

from .pty_board import PtyBoard

FIRMWARE = Path(__file__).parents[3] / "robots" / "urov" / "firmware"
MCU = "atmega2560"
WAIT_S = 60.0
WORDS = [str(Path(__file__).with_name("pty_board.py")), str(FIRMWARE), "--mcu", MCU, "--link"]

pytestmark = pytest.mark.usefixtures("emulators")


@pytest.fixture
def served(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(
        [sys.executable, *WORDS, str(tmp_path / "esc")], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert select.select([process.stdout], [], [], WAIT_S)[0]
        assert process.stdout.readline() == f"{MCU} at {tmp_path / 'esc'}\n"
        yield process
        process.kill()


def wait_until(is_so: Callable[[], bool]) -> None:
    until_s = time.monotonic() + WAIT_S
    while not is_so():
        assert time.monotonic() < until_s
        select.select([], [], [], 0.01)


@pytest.mark.slow
def test_pty_board_answers_hello(served: subprocess.Popen[str], tmp_path: Path) -> None:
    serial = pytest.importorskip("serial")
    frames, received = McuFrames(), []
    with serial.Serial(str(tmp_path / "esc"), 115200, timeout=0) as port:
        port.write(b"\0" + encode(Hello(3)))
        wait_until(
            lambda: bool(received.extend(frames.feed(port.read(4096))) or any(isinstance(m, Ident) for m in received))
        )
    ident = next(message for message in received if isinstance(message, Ident))
    assert (ident.mcu, ident.session) == (MCU, 3)


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_pty_board_on_signal_removes_link(served: subprocess.Popen[str], tmp_path: Path, how: signal.Signals) -> None:
    served.send_signal(how)
    assert served.wait(WAIT_S) == 0
    assert not os.path.lexists(tmp_path / "esc")


@pytest.mark.slow
def test_pty_board_without_parent_exits(tmp_path: Path) -> None:
    starter = "import subprocess, sys; p = subprocess.Popen(sys.argv[1:], stdout=subprocess.PIPE); p.stdout.readline()"
    link = tmp_path / "esc"
    subprocess.run([sys.executable, "-c", starter, sys.executable, *WORDS, str(link)], check=True, timeout=WAIT_S)
    wait_until(lambda: not os.path.lexists(link))


def test_pty_board_close_keeps_link_of_another_board(tmp_path: Path) -> None:
    link = tmp_path / "esc"
    with Board(firmware_elf(FIRMWARE, MCU), MCU) as first, Board(firmware_elf(FIRMWARE, MCU), MCU) as second:
        old, new = PtyBoard(first, link), PtyBoard(second, link)
        old.close()
        assert str(Path(link).readlink()) == new._end.path
        new.close()
    assert not os.path.lexists(link)


def test_pty_board_without_reader_drops_bytes(tmp_path: Path) -> None:
    with Board(firmware_elf(FIRMWARE, MCU), MCU) as board:
        board.run_us(20e6)  # 16 kB of telemetry, more than a terminal keeps
        served = PtyBoard(board, tmp_path / "esc")
        turns = iter([True, True, False])
        served.serve(lambda: next(turns))
        served.close()
        assert board.uart_out() == b""
