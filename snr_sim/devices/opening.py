"""Devices by a short text that says what and where: for `--io`, and for a robot's own table of ports.

    mcu:/dev/ttyUSB0                             outputs of servo pulses
    maestro:/dev/ttyACM0   maestro:/dev/ttyACM0,crc
    pca9685:1:0x40         pca9685:1:0x40,oscillator_hz=26.2e6   pca9685:1:0x40,clock_hz=24.576e6 (at its EXTCLK pin)
    sysfs
    ms5837:1:0x76                                sensors
    icm20948:1:0x69        icm20948:1:0x69,axes=y/-x/z
    gps:/dev/ttyS0         gps:/dev/ttyS0,baud=38400

What keeps its last pulse when a program dies is opened behind the supervisor. Nothing is touched before `configure`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from snr_sim.devices.gps import BAUD as GPS_BAUD
from snr_sim.devices.gps import Gps
from snr_sim.devices.icm20948 import Icm20948
from snr_sim.devices.maestro import MaestroPwm
from snr_sim.devices.mcu import McuPwm
from snr_sim.devices.mcu_board import McuBoard
from snr_sim.devices.ms5837_i2c import Ms5837I2c
from snr_sim.devices.pca9685 import OSCILLATOR_HZ, Pca9685Pwm
from snr_sim.devices.plain_pwm import PlainPwm
from snr_sim.devices.pwm_backend import LIMITS_US
from snr_sim.devices.supervised_pwm import SupervisedPwm
from snr_sim.devices.sysfs_pwm import ROOT, SysfsPwm
from snr_sim.devices.wire.i2c_bus import I2cBus
from snr_sim.devices.wire.mcu_messages import BAUD
from snr_sim.devices.wire.serial_port import SerialPort
from snr_sim.prelude.device import PwmOut, Sensor
from snr_sim.prelude.errors import UnknownName, nearest
from snr_sim.prelude.io import bus_and_address

HELD = ("pca9685", "sysfs")  # they keep their last pulse
SETTINGS: dict[str, tuple[str, ...]] = {
    "mcu": (),
    "maestro": ("crc",),
    "pca9685": ("oscillator_hz", "clock_hz"),
    "sysfs": (),
    "ms5837": (),
    "icm20948": ("axes",),
    "gps": ("baud",),
}
OUTPUTS = ("mcu", "maestro", *HELD)
SENSORS = tuple(kind for kind in SETTINGS if kind not in OUTPUTS)


def open_pwm(
    text: str, now_s: Callable[[], float], channels: int, limits_us: tuple[float, float] = LIMITS_US
) -> PwmOut:
    """Opens outputs of servo pulses.

    Raises:
        UnknownName: there are none of that kind, or the text does not say where.
    """
    kind, where, settings = split(text, OUTPUTS)
    if kind == "mcu":
        return McuPwm(McuBoard(lambda: SerialPort(where, BAUD), now_s), now_s, channels)
    if kind == "maestro":
        return MaestroPwm(lambda: SerialPort(where), now_s, channels, limits_us, has_crc="crc" in settings)
    args = [text, channels, *limits_us]
    return SupervisedPwm(open_held(text, channels, *limits_us), now_s, f"{__name__}:{open_held.__name__}", args)


def open_held(text: str, channels: int, low_us: float, high_us: float, takes_over: bool = False) -> PlainPwm:
    """Opens outputs that keep their last pulse, in the supervisor's process, whose clock is the computer's."""
    kind, where, settings = split(text, HELD)
    limits_us = (low_us, high_us)
    if kind == "sysfs":
        root = Path(where) if where else ROOT
        return SysfsPwm(time.monotonic, channels, limits_us, is_supervised=True, root=root, takes_over=takes_over)
    bus, address = bus_and_address(where)
    clock_hz = settings.get("clock_hz")
    return Pca9685Pwm(
        lambda: I2cBus(bus),
        address,
        time.monotonic,
        channels,
        limits_us,
        is_supervised=True,
        oscillator_hz=_number(text, clock_hz or settings.get("oscillator_hz", str(OSCILLATOR_HZ))),
        has_external_clock=clock_hz is not None,
    )


def open_sensor(text: str, now_s: Callable[[], float], about: Any = None) -> Sensor[Any]:
    """Opens a real sensor.

    Args:
        text: what and where.
        now_s: the clock that readings are stamped by.
        about: how it is used, if that can be said: `Ms5837` of an ms5837.

    Raises:
        UnknownName: there is none of that kind, or the text does not say where.
    """
    kind, where, settings = split(text, SENSORS)
    if kind == "gps":
        baud = int(_number(text, settings.get("baud", str(GPS_BAUD))))
        return Gps(lambda: SerialPort(where, baud), now_s)
    bus, address = bus_and_address(where)
    if kind == "ms5837":
        return Ms5837I2c(lambda: I2cBus(bus), now_s, about, address)
    return Icm20948(lambda: I2cBus(bus), now_s, address, settings.get("axes", "x/y/z").split("/"))


def split(text: str, kinds: tuple[str, ...]) -> tuple[str, str, dict[str, str]]:
    """Returns kind, place and settings of a device's text.

    Raises:
        UnknownName: a kind or a setting that is not known, or no place where one is needed.
    """
    kind, _, rest = text.partition(":")
    if kind not in kinds:
        raise UnknownName(f"'{text}': there is no device of the kind '{kind}' here.", fix=nearest(kind, kinds))
    where, *given = rest.split(",")
    if not where and kind != "sysfs":
        raise UnknownName(f"'{text}' does not say where.", fix="such as gps:/dev/ttyS0 or ms5837:1:0x76.")
    settings = {name: value for name, _, value in (one.partition("=") for one in given)}
    for name in settings:
        if name not in SETTINGS[kind]:
            raise UnknownName(f"'{text}': a {kind} has no setting '{name}'.", fix=nearest(name, SETTINGS[kind]))
    return kind, where, settings


def check_table(table: Mapping[str, str]) -> None:
    """Sees whether two devices of a robot's table of ports are said to be at one place.

    Raises:
        UnknownName: they are, or a text is none of a device.
    """
    seen: dict[tuple[str, ...], str] = {}
    for name, text in table.items():
        kind, where, _ = split(text, (*OUTPUTS, *SENSORS))
        place: tuple[str, ...] = (where or kind,)
        if kind in ("pca9685", "ms5837", "icm20948"):
            place = tuple(map(str, bus_and_address(where)))
        if place in seen:
            raise UnknownName(
                f"'{seen[place]}' and '{name}' are both at {where or kind}.",
                fix="`snr doctor` lists what is where; I2C parts have solder bridges for other addresses.",
            )
        seen[place] = name


def _number(text: str, given: str) -> float:
    try:
        return float(given)
    except ValueError:
        raise UnknownName(f"'{text}': '{given}' is no number.", fix="such as 26.2e6.") from None
