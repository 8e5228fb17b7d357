"""Each fault of a bus is reported with a fix."""

import errno
import sys

import pytest

from snr_sim.devices.wire.i2c_bus import I2cBus, RawBus
from snr_sim.prelude.errors import DeviceError, MissingExtra
from snr_sim.testing.i2c_parts import FakeBus, Pca9685Part


def bus_with(*addresses: int) -> tuple[I2cBus, FakeBus]:
    raw = FakeBus({address: Pca9685Part() for address in addresses})
    return I2cBus(1, raw.opened), raw


def failing(error: OSError) -> I2cBus:
    def open_raw(number: int) -> RawBus:
        raise error

    return I2cBus(1, open_raw)


def test_an_address_where_nobody_is_is_told_with_who_is_there() -> None:
    bus, _ = bus_with(0x40, 0x76)
    with pytest.raises(
        DeviceError, match=r"Nobody answers at 0x41 on /dev/i2c-1; on that bus there is: 0x40, 0x76"
    ) as e:
        bus.read(0x41, 0, 1)
    assert "SDA on pin 3" in e.value.fix
    with pytest.raises(DeviceError, match="there is: nobody"):
        bus_with()[0].write(0x40, 0, b"\0")


def test_a_bus_that_is_not_there_is_told_with_how_to_switch_it_on() -> None:
    with pytest.raises(DeviceError, match=r"There is no I2C bus /dev/i2c-1") as e:
        failing(FileNotFoundError(errno.ENOENT, "No such file or directory"))
    assert "raspi-config" in e.value.fix or "there are: /dev/i2c" in e.value.fix


def test_without_permission_the_group_is_named() -> None:
    with pytest.raises(DeviceError, match="may not be opened by this user") as e:
        failing(PermissionError(errno.EACCES, "Permission denied"))
    assert e.value.fix == "sudo usermod -aG i2c $USER, then log out and in again."


def test_a_bus_that_hangs_is_told_so() -> None:
    bus, raw = bus_with(0x40)
    raw.is_stuck = True
    with pytest.raises(DeviceError, match=r"/dev/i2c-1 hangs: 0x40 did not let go"):
        bus.command(0x40, 0x1E)


def test_a_block_that_is_not_whole_is_no_reading() -> None:
    class Short(FakeBus):
        def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
            return [0] * (length - 1)

    bus = I2cBus(1, Short({}).opened)
    with pytest.raises(DeviceError, match=r"0x69 on /dev/i2c-1 gave 5 bytes of 6 \(register 0x2d\)"):
        bus.read(0x69, 0x2D, 6)


def test_an_address_that_the_kernel_has_taken_is_told_so_and_counts_as_answering() -> None:
    class Taken(FakeBus):
        def read_byte(self, i2c_addr: int) -> int:
            if i2c_addr == 0x68:
                raise OSError(errno.EBUSY, "Device or resource busy")
            return super().read_byte(i2c_addr)

        def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
            raise OSError(errno.EBUSY, "Device or resource busy")

    bus = I2cBus(1, Taken({0x40: Pca9685Part()}).opened)
    assert bus.who_answers() == [0x40, 0x68]
    with pytest.raises(DeviceError, match="0x68 on /dev/i2c-1 belongs to a driver of the kernel") as e:
        bus.read(0x68, 0, 1)
    assert "dtoverlay" in e.value.fix


def test_without_smbus2_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "smbus2", None)
    with pytest.raises(MissingExtra, match=r"pip install 'snr_sim\[hardware\]'"):
        I2cBus(1)


def test_with_smbus2_a_bus_that_is_not_there_is_told_as_by_the_kernel() -> None:
    with pytest.raises(DeviceError, match="There is no I2C bus /dev/i2c-987"):
        I2cBus(987)
