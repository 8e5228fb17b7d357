"""Each fault of a bus is reported with a fix."""

import errno
import sys

import pytest

from snr_sim.devices.wire.i2c_bus import I2cBus
from snr_sim.prelude.errors import DeviceError, MissingExtraError
from snr_sim.testing.fake_i2c import FakeBus, FakePca9685


def bus_with(*addresses: int) -> tuple[I2cBus, FakeBus]:
    raw = FakeBus({address: FakePca9685() for address in addresses})
    return I2cBus(1, raw.opened), raw


def failing(error: OSError) -> I2cBus:
    def open_raw(number: int) -> None:
        raise error

    return I2cBus(1, open_raw)


def test_i2c_bus_without_acknowledge_lists_other_addresses() -> None:
    bus, _ = bus_with(0x40, 0x76)
    with pytest.raises(
        DeviceError, match=r"No device answers at 0x41 on /dev/i2c-1; devices on that bus: 0x40, 0x76"
    ) as e:
        bus.read(0x41, 0, 1)
    assert "SDA on pin 3" in e.value.fix
    with pytest.raises(DeviceError, match="on that bus: none"):
        bus_with()[0].write(0x40, 0, b"\0")


def test_i2c_bus_missing_names_how_to_enable_it() -> None:
    with pytest.raises(DeviceError, match=r"There is no I2C bus /dev/i2c-1") as e:
        failing(FileNotFoundError(errno.ENOENT, "No such file or directory"))
    assert "raspi-config" in e.value.fix or "there are: /dev/i2c" in e.value.fix


def test_i2c_bus_without_permission_names_group() -> None:
    with pytest.raises(DeviceError, match="may not be opened by this user") as e:
        failing(PermissionError(errno.EACCES, "Permission denied"))
    assert e.value.fix == "sudo usermod -aG i2c $USER, then log out and in again."


def test_i2c_bus_that_hangs_raises_device_error() -> None:
    bus, raw = bus_with(0x40)
    raw.is_stuck = True
    with pytest.raises(DeviceError, match=r"/dev/i2c-1 hangs: 0x40 did not release it"):
        bus.command(0x40, 0x1E)


def test_i2c_bus_incomplete_block_raises_device_error() -> None:
    class Short(FakeBus):
        def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
            return [0] * (length - 1)

    bus = I2cBus(1, Short({}).opened)
    with pytest.raises(DeviceError, match=r"0x69 on /dev/i2c-1 gave 5 bytes of 6 \(register 0x2d\)"):
        bus.read(0x69, 0x2D, 6)


def test_i2c_bus_address_of_kernel_driver_raises_and_counts_in_scan() -> None:
    class Taken(FakeBus):
        def read_byte(self, i2c_addr: int) -> int:
            if i2c_addr == 0x68:
                raise OSError(errno.EBUSY, "Device or resource busy")
            return super().read_byte(i2c_addr)

        def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
            raise OSError(errno.EBUSY, "Device or resource busy")

    bus = I2cBus(1, Taken({0x40: FakePca9685()}).opened)
    assert bus.scan() == [0x40, 0x68]
    with pytest.raises(DeviceError, match="0x68 on /dev/i2c-1 belongs to a driver of the kernel") as e:
        bus.read(0x68, 0, 1)
    assert "dtoverlay" in e.value.fix


def test_i2c_bus_without_smbus2_names_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "smbus2", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'snr_sim\[hardware\]'"):
        I2cBus(1)


def test_i2c_bus_missing_with_smbus2_raises_device_error() -> None:
    with pytest.raises(DeviceError, match="There is no I2C bus /dev/i2c-987"):
        I2cBus(987)
