"""A serial port, with a pty in place of the cable; messages are compared as a student reads them."""

import errno
import os
import pty
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from types import SimpleNamespace

import pytest

from snr_sim.devices.wire import serial_port
from snr_sim.devices.wire.serial_port import PortInfo, SerialPort, check_port, list_ports, ports
from snr_sim.prelude.errors import DeviceError, MissingExtraError


class Cable:
    """A pty: the far end of a serial cable."""

    def __init__(self) -> None:
        self.far, near = pty.openpty()
        self.path = os.ttyname(near)
        self._near: int | None = near  # kept open, like a connected plug

    def pull(self) -> None:
        for end in (self.far, self._near):
            with suppress(OSError):
                os.close(end if end is not None else -1)


@pytest.fixture
def cable() -> Iterator[Cable]:
    cable = Cable()
    yield cable
    cable.pull()


def test_serial_port_sends_and_receives_bytes(cable: Cable) -> None:
    port = SerialPort(cable.path)
    assert port.read() == b""
    port.write(b"\x84\x00\x70\x2e")
    assert os.read(cable.far, 99) == b"\x84\x00\x70\x2e"
    os.write(cable.far, b"\0\x11\x13\xff")
    assert port.wait(60.0)
    assert port.read() == b"\0\x11\x13\xff"
    port.close()
    port.close()


def test_serial_port_missing_lists_other_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial_port, "ports", lambda: ["/dev/ttyACM0 (Arduino Uno)"])
    with pytest.raises(DeviceError, match="no serial port /dev/ttyUSB9") as caught:
        SerialPort("/dev/ttyUSB9")
    assert caught.value.fix == "did you mean /dev/ttyACM0? There are: /dev/ttyACM0 (Arduino Uno)."
    with pytest.raises(DeviceError) as caught:
        check_port("/dev/serial0")
    assert caught.value.fix == "there are: /dev/ttyACM0 (Arduino Uno)."
    monkeypatch.setattr(serial_port, "ports", list)
    with pytest.raises(DeviceError, match="there is none: plug the device in"):
        SerialPort("/dev/ttyUSB9")


def test_serial_port_busy_raises_device_error(cable: Cable) -> None:
    port = SerialPort(cable.path)
    with pytest.raises(DeviceError, match="is busy: this program itself has it") as caught:
        SerialPort(cable.path)
    assert f"fuser -v {cable.path}" in caught.value.fix
    port.close()
    SerialPort(cable.path).close()


@pytest.mark.slow
def test_a_program_that_has_the_port_is_named(cable: Cable) -> None:
    hold = (
        "import sys; from snr_sim.devices.wire.serial_port import SerialPort; port = SerialPort(sys.argv[1]); "
        "print('open', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", hold, cable.path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "open\n"
        with pytest.raises(DeviceError, match=rf"is busy: process {other.pid} \(python"):
            SerialPort(cable.path)
        other.communicate(timeout=60)
    SerialPort(cable.path).close()


def test_check_port_does_not_open_port(cable: Cable, monkeypatch: pytest.MonkeyPatch) -> None:
    port = SerialPort(cable.path)
    check_port(cable.path)  # our own lock does not make it fail
    port.close()
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(DeviceError, match=r"may not be opened by this user(.|\n)*sudo usermod -aG"):
        check_port(cable.path)


def test_serial_port_without_permission_names_group_to_join(cable: Cable, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*args: object, **kwargs: object) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port")

    serial = pytest.importorskip("serial")
    monkeypatch.setattr(serial, "Serial", refused)
    with pytest.raises(DeviceError, match=r"may not be opened by this user: it belongs to group '[a-z]+'") as caught:
        SerialPort(cable.path)
    assert "sudo usermod -aG " in caught.value.fix
    assert "log out" in caught.value.fix


def test_serial_port_invalid_path_or_baud_raises_device_error(cable: Cable) -> None:
    with pytest.raises(DeviceError, match="/dev/null cannot be opened as a serial port"):
        SerialPort("/dev/null")
    with pytest.raises(DeviceError, match="usual ones: 9600"):
        SerialPort(cable.path, baud=-5)


def test_serial_port_pulled_cable_raises_in_each_call(cable: Cable) -> None:
    port = SerialPort(cable.path)
    cable.pull()
    for call in (port.read, lambda: port.write(b"x")):
        with pytest.raises(DeviceError, match=f"(?s){cable.path} is gone.*is the cable in"):
            call()
    port.close()


def test_serial_port_full_buffer_raises_without_blocking(cable: Cable) -> None:
    port = SerialPort(cable.path)
    with pytest.raises(DeviceError, match=f"{cable.path} took [0-9]+ of 1000000 bytes"):
        port.write(bytes(1_000_000))
    port.close()


def test_serial_port_without_pyserial_names_extra(cable: Cable, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "serial", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'snr_sim\[hardware\]'"):
        SerialPort(cable.path)


def comports(*rows: tuple[str, str | None, str | None, str | None]) -> list[SimpleNamespace]:
    """Return ports as pyserial lists them: device, description, serial number, location."""
    return [
        SimpleNamespace(**dict(zip(("device", "description", "serial_number", "location"), row, strict=True)))
        for row in rows
    ]


def test_ports_are_listed_with_what_identifies_them(monkeypatch: pytest.MonkeyPatch) -> None:
    found = comports(("/dev/ttyUSB0", "FT232R", "A1", "1-1.2"), ("/dev/ttyS0", "n/a", None, None))
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: found)
    plain, adapter = list_ports()
    assert (plain, plain.title) == (PortInfo("/dev/ttyS0"), "/dev/ttyS0")
    assert (adapter, adapter.title) == (PortInfo("/dev/ttyUSB0", "FT232R", "A1", "1-1.2"), "usb-1-1.2")
    assert ports() == ["/dev/ttyS0", "/dev/ttyUSB0 (FT232R)"]


def test_port_that_vanishes_while_it_is_listed_is_an_error_of_devices(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: int(None))  # type: ignore[call-overload]
    with pytest.raises(DeviceError, match="cannot be listed"):
        list_ports()
