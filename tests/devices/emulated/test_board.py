"""The emulated board by itself; what its firmware does is in tests/robots/urov_firmware."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from snr_sim.devices.emulated.board import Board, EmulatedPort
from snr_sim.devices.emulated.toolchain import firmware_elf
from snr_sim.devices.wire.mcu_frames import McuFrames, encode
from snr_sim.devices.wire.mcu_messages import BAUD, Hello, Ident
from snr_sim.prelude.errors import DeviceError, ParameterError

FIRMWARE = Path(__file__).parents[3] / "robots" / "urov" / "firmware"
MCU = "atmega328p"
BYTE_US = 10e6 / BAUD
CYCLE_US = 1 / 16

pytestmark = pytest.mark.usefixtures("emulators")


@pytest.fixture
def board(emulators: None) -> Iterator[Board]:
    with Board(firmware_elf(FIRMWARE, MCU), MCU) as board:
        yield board


def test_board_time_advances_only_on_request_without_drift(board: Board) -> None:
    assert board.now_us == 0.0
    for _ in range(1000):
        board.run_us(33.3)
    assert board.now_us == pytest.approx(33_300, abs=4 * CYCLE_US)
    before_us = board.now_us
    board.run_until_us(10.0)
    assert board.now_us == before_us


def test_board_bytes_arrive_at_baud_rate(board: Board) -> None:
    board.run_us(1000)
    data = b"\0" + encode(Hello(1))
    assert board.uart_in(data) == len(data)
    board.run_us(BYTE_US * (len(data) - 2))
    assert board.waiting > 0
    board.run_us(BYTE_US * 3)
    assert board.waiting == 0


def test_board_reply_arrives_byte_by_byte(board: Board) -> None:
    board.run_us(1000)
    board.uart_in(encode(Hello(1)))
    frames, steps = McuFrames(), 0
    while not (received := frames.feed(board.uart_out())):
        board.run_us(BYTE_US)
        steps += 1
    assert isinstance(received[0], Ident)
    assert 8 + 60 <= steps <= 85  # simavr's UART takes a tenth longer for a byte than silicon


def test_uart_in_full_queue_rejects_bytes(board: Board) -> None:
    assert board.uart_in(b"\0" * 70_000) == 65_536
    assert board.uart_in(b"\0") == 0


def test_pins_and_pulses_agree(board: Board) -> None:
    board.run_us(50_000)
    pulses = board.pulses()
    assert board.pulses() == []
    for channel, pin in enumerate(board.pins()):
        mine = [pulse for pulse in pulses if pulse.channel == channel]
        assert pin.pulses == len(mine) > 4
        assert pin.width_us == mine[-1].width_us
        assert pin.rise_us >= mine[-1].rise_us


def test_unread_pulses_beyond_limit_drop_oldest(board: Board) -> None:
    board.run_us(20e6)
    pulses = board.pulses()
    assert len(pulses) == 16_384
    assert pulses[-1].rise_us > 19.9e6


def test_board_at_start_has_no_pulses(board: Board) -> None:
    assert [tuple(pin) for pin in board.pins()] == [(0.0, 0.0, 0)] * 8


def test_two_boards_are_independent(board: Board) -> None:
    with Board(firmware_elf(FIRMWARE, "atmega2560"), "atmega2560") as other:
        board.run_us(10_000)
        board.reset()
        board.run_us(10_000)
        assert (board.resets, other.resets, other.now_us) == (1, 0, 0.0)
        other.run_us(30_000)
        assert other.pins()[0].pulses == 3


def test_board_reset_ends_pulse(board: Board) -> None:
    while not board.pins()[0].pulses:
        board.run_us(100)
    board.pulses()
    while board.pins()[0].rise_us + 1500 < board.now_us:
        board.run_us(100)
    rise_us, reset_us = board.pins()[0].rise_us, board.now_us
    board.reset()
    board.run_us(20_000)
    cut, *whole = [pulse for pulse in board.pulses() if pulse.channel == 0]
    assert cut.rise_us == rise_us
    assert cut.width_us == pytest.approx(reset_us - rise_us, abs=1.0)
    assert cut.width_us < 200
    assert all(pulse.width_us == pytest.approx(1500.0, abs=0.5) for pulse in whole)


def test_closed_boards_release_their_slots(emulators: None) -> None:
    elf = firmware_elf(FIRMWARE, MCU)
    for _ in range(100):
        board = Board(elf, MCU)
        board.close()
        board.close()


@pytest.mark.slow
def test_board_halted_firmware_raises_device_error(tmp_path: Path) -> None:
    folder = tmp_path / "firmware"
    folder.mkdir()
    (folder / "Makefile").write_text(
        (FIRMWARE / "Makefile").read_text().replace("FILES = esc.c frames.c", "FILES = esc.c")
    )
    for name in ("frames.h", "pulses.h"):
        (folder / name).write_text("")
    (folder / "pulses_328p.c").write_text("")
    sleeps = "#include <avr/interrupt.h>\n#include <avr/sleep.h>\nint main(void) { cli(); sleep_mode(); for (;;) {} }\n"
    (folder / "esc.c").write_text(sleeps)
    with Board(firmware_elf(folder, MCU), MCU) as board, pytest.raises(DeviceError, match="halt"):
        board.run_us(1000)


def test_board_invalid_elf_raises_device_error(tmp_path: Path) -> None:
    file = tmp_path / "no.elf"
    file.write_text("no")
    with pytest.raises(DeviceError, match=r"cannot run .*no\.elf on an atmega328p"):
        Board(file, MCU)


def test_board_unknown_mcu_suggests_nearest(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="did you mean 'atmega328p'"):
        Board(tmp_path, "atmega328")


def test_emulated_port_wait_advances_time_until_bytes_or_timeout(bench: Any) -> None:
    port = EmulatedPort(bench.board)
    assert port.read() == b""
    assert not port.wait(0.04)  # telemetry comes every 50 ms
    assert bench.now_s() == pytest.approx(0.04, abs=1e-5)
    assert port.wait(1.0)
    assert bench.now_s() < 0.06
    first = port.read()
    assert first
    for seconds in (0.0, 1e-12, 3e-8, -1.0):  # less than a cycle
        assert not port.wait(seconds)


def test_emulated_port_closed_or_full_raises_device_error(bench: Any) -> None:
    port = EmulatedPort(bench.board, "/dev/board")
    with pytest.raises(DeviceError, match="/dev/board takes no more bytes"):
        port.write(bytes(100_000))
    port.close()
    port.close()
    for use in (port.read, lambda: port.write(b"x"), lambda: port.wait(0.1)):
        with pytest.raises(DeviceError, match="/dev/board was closed"):
            use()


def test_closed_board_calls_raise_device_error(bench: Any) -> None:
    port = EmulatedPort(bench.board)
    bench.board.close()
    bench.board.close()
    for use in (port.read, lambda: port.write(b"x"), lambda: bench.board.run_us(1000.0), bench.board.pins):
        with pytest.raises(DeviceError, match="switched off"):
            use()
