"""The Maestro's driver against a Maestro of the user's guide: the contract, and wrong settings of a board."""

import os
import pty
import threading
import tty
from collections.abc import Iterator
from contextlib import suppress
from time import sleep
from typing import Any

import pytest

from snr_sim.devices.device_loop import start_device
from snr_sim.devices.pwm.maestro import Maestro
from snr_sim.devices.pwm.passive_pwm import PassivePwm
from snr_sim.devices.wire.serial_port import SerialPort
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.signals import LOST, NOT_ACTIVE
from snr_sim.testing.fake_maestro import FakeMaestro
from snr_sim.testing.pwm_contract import check_pwm_out
from tests.devices import benches

STOP, FAST = [1500.0] * 8, [1700.0] * 8


class Bench(benches.Bench):
    """A Maestro on a table."""

    def __init__(self, channels: int = 8, has_crc: bool = False, **settings: Any) -> None:
        self.channels, self.has_crc = channels, has_crc
        self.board = FakeMaestro(self.now_s, channels, has_crc=has_crc, **settings)

    def open(self, channels: int | None = None, **wanted: Any) -> PassivePwm:
        settings = {"has_crc": self.has_crc, "sleep": self.advance, **wanted}
        return PassivePwm(Maestro(self._port, self.now_s, channels or self.channels, **settings), self.now_s, 1.0)

    def armed(self) -> PassivePwm:
        out = start_device(self.open(), "the outputs")
        while out.health().state == "activating":
            out.write_us(STOP, self.time_s)
            self.advance(0.02)
        return out

    def _port(self) -> FakeMaestro:
        self.board.read()  # as when a real port is opened
        return self.board

    def pins_us(self) -> list[float]:
        return self.board.pins_us

    def unplug(self) -> None:
        self.board.is_plugged = False

    def plug_in(self) -> None:
        self.board.is_plugged = True


@pytest.mark.parametrize("channels", [2, 6, 8, 12])
@pytest.mark.parametrize("has_crc", [False, True])
def test_maestro_passes_pwm_contract(channels: int, has_crc: bool) -> None:
    check_pwm_out(Bench(channels, has_crc))


def test_maestro_without_timeout_raises_device_error() -> None:
    with pytest.raises(
        DeviceError, match=r"did not time out after 0.24 s without commands: if this program were killed"
    ) as e:
        Bench(timeout_s=0.0).open().configure()
    assert "Timeout 0.20 s" in e.value.fix


def test_maestro_timeout_beyond_lease_raises_device_error() -> None:
    with pytest.raises(DeviceError, match="did not time out"):
        Bench(timeout_s=0.5).open().configure()


@pytest.mark.parametrize(("home_us", "shown"), [(None, "1501"), (0.0, "0"), (1600.0, "1600")])
def test_maestro_home_not_neutral_raises_device_error(home_us: float | None, shown: str) -> None:
    with pytest.raises(DeviceError, match=f"channel 0 makes {shown} us, not 1500: .*does not go to 1500 us"):
        Bench(home_us=home_us).open().configure()


def test_maestro_timeout_test_moves_no_thruster() -> None:
    bench = Bench(timeout_s=0.0)
    with pytest.raises(DeviceError):
        bench.open().configure()
    assert bench.pins_us() == [1501.0] * 8  # inside of any speed controller's dead band


def test_maestro_without_reply_names_port_bytes_and_fix() -> None:
    bench = Bench()
    bench.board.write = lambda data: None  # type: ignore[method-assign]
    with pytest.raises(DeviceError, match=r"/dev/ttyACM0 does not answer when asked for its errors: 0 bytes in 0.5 s"):
        bench.open().configure()


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (b"$GPGGA,1235", "answers 11 bytes when asked for its errors, a Maestro 2: 24 47 50"),
        (b"\xff\xff", "the errors 0xffff, with bits that no Maestro has: it is another device"),
        (b"\x00", "answers 1 bytes"),
    ],
)
def test_maestro_reply_of_other_device_is_shown(answer: bytes, words: str) -> None:
    class Other(FakeMaestro):
        def write(self, data: bytes) -> None:
            self._answers = answer

    bench = Bench()
    bench.board = Other(bench.now_s)
    with pytest.raises(DeviceError, match=words):
        bench.open().configure()


def test_maestro_too_few_channels_raises_device_error() -> None:
    with pytest.raises(DeviceError, match=r"(?s)channel 7: 0 bytes.*its number of channels"):
        Bench(channels=6).open(channels=8).configure()


@pytest.mark.parametrize(("there", "here"), [(True, False), (False, True)])
def test_maestro_crc_at_one_end_only_raises_device_error(there: bool, here: bool) -> None:
    with pytest.raises(DeviceError, match=r"Enable CRC|does not answer"):
        Bench(has_crc=there).open(has_crc=here).configure()


def test_maestro_after_silence_rearms_only_from_neutral() -> None:
    bench = Bench()
    out = bench.armed()
    assert out.write_us(FAST, bench.time_s).reason == []
    assert bench.pins_us() == FAST
    bench.advance(0.21)
    assert bench.pins_us() == STOP
    applied = out.write_us(FAST, bench.time_s)
    assert (applied.pulses_us, applied.reason) == (STOP, [NOT_ACTIVE])
    assert bench.pins_us() == STOP
    assert out.health().state == "inactive"
    assert "sent nothing for 0.21 s" in out.health().reason
    out.activate()
    for _ in range(200):
        bench.advance(0.02)
        assert out.write_us(FAST, bench.time_s).pulses_us == STOP  # it waits for neutral
    assert out.health().state == "activating"


def test_maestro_short_board_timeout_is_reported() -> None:
    bench = Bench(timeout_s=0.1)
    out = bench.armed()
    out.write_us(FAST, bench.time_s)
    bench.advance(0.15)
    applied = out.write_us(FAST, bench.time_s)
    assert NOT_ACTIVE in applied.reason
    assert bench.pins_us() == STOP
    assert "its serial timeout came" in out.health().reason
    assert out.health().counts["timeout"] == 1


def test_maestro_that_stops_answering_is_lost() -> None:
    bench = Bench()
    out = bench.armed()
    bench.board._execute = lambda command: None  # type: ignore[method-assign]
    applied = out.write_us(FAST, bench.time_s)
    for _ in range(30):
        bench.advance(0.02)
        applied = out.write_us(FAST, bench.time_s)
    assert LOST in applied.reason
    assert "has not answered for 0.5 s" in out.health().reason


def test_maestro_line_noise_is_counted_and_excess_is_lost() -> None:
    bench = Bench()
    out = bench.armed()
    bench.board.write(b"\x01\x02")
    out.write_us(FAST, bench.time_s)
    out.write_us(FAST, bench.time_s)
    assert out.health().counts["protocol"] == 1
    assert out.health().state == "active"
    for _ in range(10):
        bench.advance(0.02)
        bench.board.write(b"\x01")
        out.write_us(FAST, bench.time_s)
    assert out.health().state == "error"
    assert "bytes that are not a command" in out.health().reason


@pytest.fixture
def bench_on_a_line(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Bench, str]]:
    """Yield a Maestro behind a real serial line, in its own time: however slow this computer is."""
    monkeypatch.setattr("snr_sim.devices.pwm.maestro.ANSWER_S", 60.0)
    far, near = pty.openpty()
    tty.setraw(near)
    bench = Bench()

    def pump() -> None:
        with suppress(OSError):
            while data := os.read(far, 4096):
                bench.board.write(data)
                os.write(far, bench.board.read())

    threading.Thread(target=pump, daemon=True).start()
    yield bench, os.ttyname(near)
    os.close(near)
    os.close(far)


@pytest.mark.slow
def test_maestro_on_serial_line_applies_commands_at_pins(bench_on_a_line: tuple[Bench, str]) -> None:
    bench, path = bench_on_a_line
    out = start_device(
        PassivePwm(Maestro(lambda: SerialPort(path), bench.now_s, 8, sleep=bench.advance), bench.now_s, 0.0), "it"
    )

    def hold(pulses_us: list[float]) -> None:
        for _ in range(10_000):
            out.write_us(pulses_us, bench.time_s)
            if bench.pins_us() == pulses_us:
                return
            sleep(0.001)  # the other end of the line is a separate thread
        raise AssertionError(f"{bench.pins_us()}, {out.health()}")

    hold(STOP)
    assert out.health().state == "active"
    hold(FAST)
    out.close()
    hold(STOP)
