"""Serial ports: the only module that imports pyserial. Sends and receives bytes; explains why a port fails.

A port is opened with an exclusive lock; only `wait` blocks.
"""

from __future__ import annotations

import difflib
import errno
import importlib
import os
import select
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from snr_sim.devices.wire.permission import group_of, how_to_use
from snr_sim.prelude.errors import DeviceError, MissingExtraError

_BAUDS = (9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000, 921600, 1000000)


class BytePort(Protocol):
    """A port that sends and receives bytes: a real one, or the device itself in a test."""

    @property
    def name(self) -> str:
        """Name in messages."""
        ...

    def write(self, data: bytes) -> None:
        """Send bytes, without waiting until they are out; a port that is gone, or full, raises a DeviceError."""
        ...

    def read(self) -> bytes:
        """Return the received bytes, which may be none, without waiting; raise the same error."""
        ...

    def wait(self, seconds: float) -> bool:
        """Return whether bytes have arrived, as soon as they have; False after the timeout."""
        ...

    def close(self) -> None:
        """Close the port. Never raises; safe to call twice."""
        ...


class PortInfo(NamedTuple):
    """A serial port as the kernel lists it.

    Args:
        path: device file. It depends on the order in which devices were found: /dev/ttyUSB0 is another one tomorrow.
        about: its device, if known.
        serial_number: of the USB device, if it has one; not always unique.
        usb_path: bus, hub and socket that it is plugged into, '1-1.2', and the interface if it has several.
    """

    path: str
    about: str = ""
    serial_number: str = ""
    usb_path: str = ""

    @property
    def title(self) -> str:
        """Where to look for it: the socket, if known."""
        return f"usb-{self.usb_path}" if self.usb_path else self.path


class SerialPort:
    """A serial port of this computer. Implements `BytePort`.

    Args:
        path: such as /dev/ttyUSB0.
        baud: bits per second. A port that is USB from end to end accepts any.

    Raises:
        MissingExtraError: pyserial is not installed.
        DeviceError: there is no such port, another process has it, or permission is missing.
    """

    def __init__(self, path: str, baud: int = 115_200) -> None:
        self.name: str = path
        serial = _pyserial()
        try:
            self._serial: Any = serial.Serial(path, baud, timeout=0, write_timeout=0, exclusive=True)
        except (OSError, ValueError) as error:  # SerialException is an OSError
            raise _open_error(path, baud, error) from error

    def write(self, data: bytes) -> None:
        """Send bytes."""
        try:
            taken = self._serial.write(data)
        except OSError as error:
            raise self._lost_error(error) from error
        if taken != len(data):
            raise DeviceError(
                f"{self.name} took {taken} of {len(data)} bytes: those before them are not out yet.",
                fix="use a higher baud rate at both ends, or send fewer commands per second.",
            )

    def read(self) -> bytes:
        """Return the received bytes."""
        try:
            waiting = self._serial.in_waiting
            data: bytes = self._serial.read(waiting) if waiting else b""
        except OSError as error:
            raise self._lost_error(error) from error
        return data

    def wait(self, seconds: float) -> bool:
        """Return whether bytes have arrived."""
        try:
            return bool(select.select([self._serial], [], [], seconds)[0])
        except (OSError, ValueError, TypeError) as error:
            raise self._lost_error(error) from error

    def close(self) -> None:
        """Close the port."""
        with suppress(OSError):  # raised for a port that was unplugged
            self._serial.close()

    def _lost_error(self, error: Exception) -> DeviceError:
        return DeviceError(
            f"{self.name} is gone: {error}.",
            fix="is the cable in, and does the device have power? `ls /dev/tty*` shows where it came back.",
        )


def check_port(path: str) -> None:
    """Check that a port exists and may be opened, without opening it, which would reset an Arduino.

    The DeviceError has a list of those that exist, or the group that has the permission.
    """
    if not os.path.exists(path):
        raise _open_error(path, 0, FileNotFoundError(errno.ENOENT, "not there"))
    if not os.access(path, os.R_OK | os.W_OK):
        raise _open_error(path, 0, PermissionError(errno.EACCES, "not allowed"))


def ports() -> list[str]:
    """Return the serial ports of this computer, each with its device if known."""
    return [f"{port.path} ({port.about})" if port.about else port.path for port in list_ports()]


def list_ports() -> list[PortInfo]:
    """Return the serial ports of this computer, by their paths; raise a DeviceError if one vanishes meanwhile."""
    _pyserial()
    try:
        found = importlib.import_module("serial.tools.list_ports").comports()
    except (OSError, TypeError) as error:  # pyserial 3.5 reads None where a number was
        raise DeviceError(f"The serial ports cannot be listed: {error}.", fix="try again in a second.") from error
    return sorted(
        PortInfo(
            port.device,
            "" if port.description in ("n/a", None) else port.description,
            port.serial_number or "",
            port.location or "",
        )
        for port in found
    )


def list_links(folder: Path) -> list[PortInfo]:
    """Return the ports to which a folder has links, named by their sockets; none if there is no such folder."""
    return [PortInfo(str(link), usb_path=link.name) for link in sorted(folder.glob("*"))]


def _pyserial() -> Any:
    try:
        return importlib.import_module("serial")
    except ImportError:
        raise MissingExtraError("pyserial", "hardware") from None


def _open_error(path: str, baud: int, error: Exception) -> DeviceError:
    number = getattr(error, "errno", None)
    if isinstance(error, ValueError):
        listed = ", ".join(map(str, _BAUDS))
        return DeviceError(f"{path} at {baud!r} baud: {error}.", fix=f"the rate of the device; usual ones: {listed}.")
    if number == errno.ENOENT:
        there = ports()
        near = difflib.get_close_matches(path, [port.partition(" ")[0] for port in there], n=1)
        meant = f"did you mean {near[0]}? " if near else ""
        fix = (
            f"{meant}{'T' if meant else 't'}here are: {', '.join(there)}."
            if there
            else "there is none: plug the device in; `dmesg | tail` shows its name."
        )
        return DeviceError(f"There is no serial port {path}.", fix=fix)
    if number in (errno.EACCES, errno.EPERM):
        return DeviceError(
            f"{path} may not be opened by this user: it belongs to group '{group_of(Path(path))}'.",
            fix=how_to_use(Path(path), "dialout"),
        )
    if number in (errno.EBUSY, errno.EAGAIN):
        return DeviceError(
            f"{path} is busy: {_holder(path)} has it.",
            fix=f"end that first; `fuser -v {path}` names it: another node, a serial monitor, ModemManager.",
        )
    return DeviceError(
        f"{path} cannot be opened as a serial port: {error}.", fix="a port such as /dev/ttyUSB0 or /dev/ttyACM0."
    )


def _holder(path: str) -> str:
    """Return which process has a port open, as far as visible: root sees all, other users see their own."""
    real_path, processes, found = os.path.realpath(path), Path("/proc"), "another program"
    for process in sorted(processes.glob("[0-9]*")):
        try:
            if any(os.path.realpath(held) == real_path for held in (process / "fd").iterdir()):
                name = (process / "comm").read_text(errors="replace").strip()
                if process.name != str(os.getpid()):
                    return f"process {process.name} ({name})"
                found = "this program itself"
        except OSError:
            continue  # of another user, or it has ended meanwhile
    return found
