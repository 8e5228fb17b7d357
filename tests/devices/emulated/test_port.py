"""The port of an emulated board."""

from typing import Any

import pytest

from snr_sim.devices.emulated.board import EmulatedPort
from snr_sim.prelude.errors import DeviceError


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
