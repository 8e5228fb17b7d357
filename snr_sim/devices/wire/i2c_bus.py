"""I2C buses: the only module that imports smbus2, and error messages for a bus or a missing device.

Only the SMBus calls that every adapter supports are used (a byte, a block of at most 32 bytes behind a register): they
work with the Raspberry Pi's own controller, with a bit-banged bus on two GPIO pins, and with the kernel's stubs.
"""

from __future__ import annotations

import errno
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from snr_sim.devices.wire.permission import how_to_use
from snr_sim.prelude.errors import DeviceError, MissingExtraError

MAX_BYTES = 32  # of one SMBus block
_FIRST, _LAST = 0x08, 0x77  # other addresses are reserved
_NO_ACKNOWLEDGE = (errno.EREMOTEIO, errno.ENXIO, errno.EIO)  # no acknowledge, as different adapters report it


class I2cBus:
    """A bus, as one device uses it. Other users may have it open, too: the kernel serialises transfers.

    Args:
        number: 1 for /dev/i2c-1, the one on a Raspberry Pi's pins 3 and 5.
        open_raw: opens the underlying bus, of which five calls are used: those of `smbus2.SMBus`.

    Raises:
        MissingExtraError: smbus2 is not installed.
        DeviceError: there is no such bus, or permission is missing.
    """

    def __init__(self, number: int, open_raw: Callable[[int], Any] | None = None) -> None:
        self.name: str = f"/dev/i2c-{number}"
        try:
            self._raw = (open_raw or _smbus2)(number)
        except FileNotFoundError as error:
            raise DeviceError(f"There is no I2C bus {self.name}.", fix=_enable()) from error
        except PermissionError as error:
            fix = how_to_use(Path(self.name), "i2c")
            raise DeviceError(f"{self.name} may not be opened by this user.", fix=fix) from error
        except OSError as error:
            raise DeviceError(f"{self.name} cannot be opened: {error}.", fix=_enable()) from error

    def read(self, address: int, register: int, length: int) -> bytes:
        """Return a block; raise a DeviceError if no device acknowledges, the bus hangs, or the block is incomplete."""
        block = bytes(self._transfer(self._raw.read_i2c_block_data, address, register, length))
        if len(block) != length:
            raise DeviceError(
                f"0x{address:02x} on {self.name} gave {len(block)} bytes of {length} (register 0x{register:02x}).",
                fix="use shorter wires, or a slower bus: dtparam=i2c_arm_baudrate=100000 in config.txt.",
            )
        return block

    def write(self, address: int, register: int, data: bytes) -> None:
        """Write a block."""
        self._transfer(self._raw.write_i2c_block_data, address, register, list(data))

    def command(self, address: int, byte: int) -> None:
        """Write one byte that is a command."""
        self._transfer(self._raw.write_byte, address, byte)

    def scan(self) -> list[int]:
        """Return the addresses that acknowledge. Queries each of them, which takes some 20 ms."""
        found = []
        for address in range(_FIRST, _LAST + 1):
            try:
                self._raw.read_byte(address)
            except OSError as error:
                if error.errno != errno.EBUSY:  # a kernel driver has the address, so a device is there
                    continue
            found.append(address)
        return found

    def close(self) -> None:
        """Close the bus. Never raises; safe to call twice."""
        self._raw.close()

    def _transfer(self, call: Callable[..., Any], address: int, *data: Any) -> Any:
        try:
            return call(address, *data)
        except OSError as error:
            raise self._bus_error(address, error) from error

    def _bus_error(self, address: int, error: OSError) -> DeviceError:
        if error.errno in _NO_ACKNOWLEDGE:
            there = ", ".join(f"0x{one:02x}" for one in self.scan()) or "none"
            return DeviceError(
                f"No device answers at 0x{address:02x} on {self.name}; devices on that bus: {there}.",
                fix="check its power, SDA on pin 3, SCL on pin 5, and the address that its solder bridges set.",
            )
        if error.errno == errno.EBUSY:
            return DeviceError(
                f"0x{address:02x} on {self.name} belongs to a driver of the kernel.",
                fix="take its dtoverlay line out of config.txt, or use what the driver offers.",
            )
        if error.errno == errno.ETIMEDOUT:
            return DeviceError(
                f"{self.name} hangs: 0x{address:02x} did not release it in time.",
                fix="switch its devices off and on; shorten the wires; dtparam=i2c_arm_baudrate=100000 in config.txt.",
            )
        return DeviceError(f"0x{address:02x} on {self.name}: {error}.", fix="`i2cdetect -y 1` lists the devices.")


def _smbus2(number: int) -> Any:
    try:
        smbus2 = importlib.import_module("smbus2")
    except ImportError:
        raise MissingExtraError("smbus2", "hardware") from None
    return smbus2.SMBus(number)


def _enable() -> str:
    there = ", ".join(sorted(map(str, Path("/dev").glob("i2c-*"))))
    if there:
        return f"there are: {there}."
    return "sudo raspi-config, Interface Options, I2C, Yes; then restart (dtparam=i2c_arm=on in config.txt)."
