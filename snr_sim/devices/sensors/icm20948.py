"""A real inertial unit: an ICM-20948 on I2C, with its magnetometer (an AK09916 in the same package) and our own filter.

Chosen over a BNO055, which computes its own attitude: that part stretches the bus's clock, which the Raspberry Pi's I2C
controllers do not support, so bits of its readings are wrong without a check sum that would show it (Adafruit,
"Raspberry Pi I2C clock stretching fixes"). This one never stretches. The simulated unit still has the numbers of a
BNO055 (`devices/sensors/imu.py`), with the filter that is used here.

Rates in 500 deg/s, forces in 4 g, both low-passed at 51 Hz. Calibrate the compass in the finished vehicle: turn it
about all axes, and pass the centre of the measured field as `hard_iron_ut`.

Source of registers and scales: TDK InvenSense, ICM-20948 data sheet DS-000189 (also of the magnetometer's axes: its y
and z point the other way).
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable, Sequence
from contextlib import suppress

from snr_sim.devices.wire.i2c_bus import I2cBus
from snr_sim.devices.wire.wire_handle import WireHandle
from snr_sim.prelude.angles import roll_pitch_yaw_rad
from snr_sim.prelude.attitude_filter import GRAVITY_MPS2, MahonyFilter
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError, ParameterError
from snr_sim.prelude.life_cycle import LifeCycleSensor
from snr_sim.prelude.signals import ImuReading

ADDRESS, COMPASS_ADDRESS = 0x69, 0x0C
IDENTITY, COMPASS_IDENTITY = 0xEA, 0x09
BANK_SELECT = 0x7F
# Bank 0
WHO_AM_I, POWER_1, POWER_2, INT_PIN, ACCEL_X = 0x00, 0x06, 0x07, 0x0F, 0x2D
RESET, AUTO_CLOCK, BYPASS = 0x80, 0x01, 0x02
# Bank 2
GYRO_DIVIDER, GYRO_CONFIG, ACCEL_DIVIDER, ACCEL_CONFIG = 0x00, 0x01, 0x11, 0x14
DIVIDER = 9  # 1125 Hz / (1 + 9): 112 a second
GYRO_500_DPS, ACCEL_4_G = 0x1B, 0x1B  # filter 3, full scale 1, filter on
RADPS_PER_COUNT: float = math.radians(1.0 / 65.5)
MPS2_PER_COUNT: float = GRAVITY_MPS2 / 8192.0
# Of the compass
COMPASS_WHO, COMPASS_STATUS, COMPASS_MODE = 0x01, 0x10, 0x31
A_HUNDRED_A_SECOND = 0x08
OVERFLOW = 0x08
UT_PER_COUNT = 0.15
RESET_S = 0.1
REINIT_PERIOD_S = 0.25
_REST = (0.7 * GRAVITY_MPS2, 1.3 * GRAVITY_MPS2)  # required specific force at the start


class Icm20948(LifeCycleSensor):
    """The unit. Implements `Sensor`; reads `ImuReading` in the body's axes.

    Args:
        open_bus: opens the bus.
        now_s: the clock that stamps readings.
        address: 0x69, or 0x68 with its AD0 pin low.
        axes: which of the chip's axes, as printed on it, is the body's x (forward), y (left), z (up): "x", "-y", ...
        hard_iron_ut: subtracted from the field, in the body's axes.
        sleep: waits at the start.

    Raises:
        ParameterError: the axes are not right-handed.
    """

    def __init__(
        self,
        open_bus: Callable[[], I2cBus],
        now_s: Callable[[], float],
        address: int = ADDRESS,
        axes: Sequence[str] = ("x", "y", "z"),
        hard_iron_ut: Sequence[float] = (0.0, 0.0, 0.0),
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.title: str = f"The inertial unit ICM-20948 at 0x{address:02x}"
        self._now_s, self._sleep = now_s, sleep
        self._address, self._hard_iron_ut = address, list(hard_iron_ut)
        self._axes = _right_handed(axes)
        self._bus = WireHandle(open_bus, self)
        self._filter = MahonyFilter()
        self._field_ut = [0.0, 0.0, 0.0]
        self._newest: ImuReading | None = None
        self._errors = 0
        self._reinit_s = 0.0

    def counts(self) -> dict[str, int]:
        """Return how often it did not answer, or answered with impossible values."""
        return {"errors": self._errors}

    def on_configure(self) -> None:
        """Reset and initialise it; check its identity, its registers, and that it measures gravity."""
        self._bus.open()
        self._identify(self._address, WHO_AM_I, IDENTITY, "an ICM-20948")
        self._write(POWER_1, RESET)
        self._sleep(RESET_S)
        self._set_up()
        self._sleep(RESET_S)
        force_mps2 = self._measure().specific_force_mps2
        if not _REST[0] < math.hypot(*force_mps2) < _REST[1]:
            raise DeviceError(
                f"{self.title} measures {math.hypot(*force_mps2):.1f} m/s2 at the start, not {GRAVITY_MPS2:.1f}.",
                fix="hold it still; if the value stays, the sensor is damaged.",
            )
        self._filter = MahonyFilter()
        self._newest = None

    def on_activate(self) -> None:
        """Take a first measurement."""
        self._newest = self._measure()

    def read(self) -> ImuReading | Stale:
        """Return a new measurement; raise a SensorLostError if it was closed."""
        idle = self.idle(self._newest.stamp_s if self._newest else None)
        if idle is not None:
            return idle
        try:
            self._newest = self._measure()
        except DeviceError as error:
            self._errors += 1
            self._reinitialise()
            return Stale(str(error), self._newest.stamp_s if self._newest else None)
        return self._newest

    def on_close(self) -> None:
        """Close the bus."""
        self._bus.close()

    def _set_up(self) -> None:
        self._write(POWER_1, AUTO_CLOCK)
        self._write(POWER_2, 0)
        self._write(INT_PIN, BYPASS)  # connects the magnetometer to our bus
        self._write(BANK_SELECT, 2 << 4)
        settings = {
            GYRO_DIVIDER: DIVIDER, GYRO_CONFIG: GYRO_500_DPS, ACCEL_DIVIDER: DIVIDER, ACCEL_CONFIG: ACCEL_4_G
        }  # fmt: skip
        for register, value in settings.items():
            self._write(register, value)
        for register, value in settings.items():
            found = self._bus.get().read(self._address, register, 1)[0]
            if found != value:
                raise DeviceError(
                    f"{self.title}: register 0x{register:02x} was written 0x{value:02x} and reads 0x{found:02x}.",
                    fix="use shorter wires; check that no other device has this address.",
                )
        self._write(BANK_SELECT, 0)
        self._identify(COMPASS_ADDRESS, COMPASS_WHO, COMPASS_IDENTITY, "its magnetometer")
        self._bus.get().write(COMPASS_ADDRESS, COMPASS_MODE, bytes([A_HUNDRED_A_SECOND]))

    def _reinitialise(self) -> None:
        """Initialise it again, in case it was without power."""
        if self._now_s() >= self._reinit_s:
            self._reinit_s = self._now_s() + REINIT_PERIOD_S
            with suppress(DeviceError):  # the missing answer is already reported
                self._set_up()

    def _measure(self) -> ImuReading:
        bus = self._bus.get()
        at_s = self._now_s()
        raw = bus.read(self._address, ACCEL_X, 12)
        if raw == b"\0" * 12 or raw == b"\xff" * 12:
            raise DeviceError(
                f"{self.title} sends only {'zeros' if raw[0] == 0 else 'ones'}.",
                fix="check its wires and power; it may have been reset.",
            )
        *forces, gx, gy, gz = struct.unpack(">6h", raw)
        self._update_field(bus.read(COMPASS_ADDRESS, COMPASS_STATUS, 9))
        rate = self._of_body([one * RADPS_PER_COUNT for one in (gx, gy, gz)])
        force = self._of_body([one * MPS2_PER_COUNT for one in forces])
        attitude = self._filter.update(rate, force, self._field_ut, at_s)
        return ImuReading(rate, force, list(self._field_ut), *roll_pitch_yaw_rad(attitude), at_s)

    def _update_field(self, status_and_field: bytes) -> None:
        ready, x, y, z, _, status = struct.unpack("<B3hBB", status_and_field)
        if ready & 1 and not status & OVERFLOW:
            chip = [x * UT_PER_COUNT, -y * UT_PER_COUNT, -z * UT_PER_COUNT]
            self._field_ut = [one - iron for one, iron in zip(self._of_body(chip), self._hard_iron_ut, strict=True)]

    def _of_body(self, chip: Sequence[float]) -> list[float]:
        return [sign * chip[i] for i, sign in self._axes]

    def _identify(self, address: int, register: int, identity: int, what: str) -> None:
        bus = self._bus.get()
        found = bus.read(address, register, 1)[0]
        if found != identity:
            raise DeviceError(
                f"The device at 0x{address:02x} on {bus.name} is not {what}: its identity is 0x{found:02x}, "
                f"not 0x{identity:02x}.",
                fix="if another device has this address, use the other one (pin AD0) or another bus.",
            )

    def _write(self, register: int, value: int) -> None:
        self._bus.get().write(self._address, register, bytes([value]))


def is_right_handed(axes: Sequence[str]) -> bool:
    """Return whether these are three axes of a right-handed frame."""
    try:
        return bool(_right_handed(axes))
    except ParameterError:
        return False


def _right_handed(axes: Sequence[str]) -> list[tuple[int, float]]:
    """Return for each axis of the body the index and sign of the chip's axis.

    >>> _right_handed(("y", "-x", "z"))
    [(1, 1.0), (0, -1.0), (2, 1.0)]
    """
    names = [axis.removeprefix("-") for axis in axes]
    if sorted(names) == ["x", "y", "z"]:
        found = [("xyz".index(name), -1.0 if axis != name else 1.0) for axis, name in zip(axes, names, strict=True)]
        order = [i for i, _ in found]
        is_even = order in ([0, 1, 2], [1, 2, 0], [2, 0, 1])
        if math.prod(sign for _, sign in found) == (1.0 if is_even else -1.0):
            return found
    raise ParameterError(
        f"{list(axes)} are not right-handed axes of an inertial unit.",
        fix='name its axes that point forward, left and up: ("x", "y", "z") or ("y", "-x", "z").',
    )
