"""Devices from a short text with kind and address: for `--io`, and for a robot's own table of ports.

    mcu:/dev/ttyUSB0                             outputs of servo pulses
    maestro:/dev/ttyACM0   maestro:/dev/ttyACM0,crc
    pca9685:1:0x40         pca9685:1:0x40,oscillator_hz=26.2e6   pca9685:1:0x40,clock_hz=24.576e6 (at its EXTCLK pin)
    sysfs
    ms5837:1:0x76                                sensors
    icm20948:1:0x69        icm20948:1:0x69,axes=y/-x/z
    gps:/dev/ttyS0         gps:/dev/ttyS0,baud=38400
    piksi:/dev/ttyUSB1     piksi:/dev/ttyUSB1,baud=1000000

Outputs that hold their last pulse when a program ends are opened behind the supervisor. `configure` opens the wires.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from snr_sim.devices.mcu.mcu import McuPwm
from snr_sim.devices.mcu.mcu_board import McuBoard
from snr_sim.devices.pwm.maestro import Maestro
from snr_sim.devices.pwm.passive_pwm import PassivePwm, PwmChip
from snr_sim.devices.pwm.pca9685 import OSCILLATOR_HZ, Pca9685
from snr_sim.devices.pwm.pwm_backend import LIMITS_US, PwmBackend
from snr_sim.devices.pwm.supervised_pwm import SupervisedPwm
from snr_sim.devices.pwm.sysfs_pwm import ROOT, SysfsPins
from snr_sim.devices.sensors.gps import BAUD as GPS_BAUD
from snr_sim.devices.sensors.gps import Gps
from snr_sim.devices.sensors.icm20948 import Icm20948, is_right_handed
from snr_sim.devices.sensors.ms5837_i2c import Ms5837I2c
from snr_sim.devices.sensors.piksi import Piksi
from snr_sim.devices.wire.i2c_bus import I2cBus
from snr_sim.devices.wire.mcu_messages import BAUD
from snr_sim.devices.wire.sbp_messages import BAUD as PIKSI_BAUD
from snr_sim.devices.wire.serial_port import SerialPort
from snr_sim.prelude.device import Sensor
from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest
from snr_sim.prelude.io import Io, bus_and_address

SUPERVISED = ("pca9685", "sysfs")  # they hold their last pulse


@dataclass(frozen=True)
class Setting:
    """A setting that may follow an address."""

    read: Callable[[str], Any]  # converts its text to the value
    expected: str  # description of valid values
    fits: Callable[[Any], bool] = lambda value: True  # whether a value is valid


# Of the internal oscillator and of an external clock: NXP, PCA9685 data sheet, tables 13 and 14.
SETTINGS: dict[str, dict[str, Setting]] = {
    "mcu": {},
    "maestro": {"crc": Setting({"": True, "yes": True, "no": False}.__getitem__, "crc, crc=yes or crc=no")},
    "pca9685": {
        "oscillator_hz": Setting(float, "23e6 to 27e6 Hz, as measured", lambda hz: 23e6 <= hz <= 27e6),
        "clock_hz": Setting(float, "1e6 to 50e6 Hz, as at its EXTCLK pin", lambda hz: 1e6 <= hz <= 50e6),
    },
    "sysfs": {},
    "ms5837": {},
    "icm20948": {
        "axes": Setting(lambda text: text.split("/"), "three axes such as y/-x/z, right-handed", is_right_handed)
    },
    "gps": {"baud": Setting(int, "a whole number, 1200 to 921600, mostly 9600", lambda baud: 1200 <= baud <= 921600)},
    "piksi": {
        "baud": Setting(int, "a whole number, 9600 to 1000000, mostly 115200", lambda baud: 9600 <= baud <= 1000000)
    },
}
OUTPUTS = ("mcu", "maestro", *SUPERVISED)
_EXAMPLES = {
    "mcu": "mcu:/dev/ttyUSB0",
    "maestro": "maestro:/dev/ttyACM0",
    "pca9685": "pca9685:1:0x40",
    "ms5837": "ms5837:1:0x76",
    "icm20948": "icm20948:1:0x69",
    "gps": "gps:/dev/ttyS0",
    "piksi": "piksi:/dev/ttyUSB1",
}
SENSORS = tuple(kind for kind in SETTINGS if kind not in OUTPUTS)


def open_pwm(
    text: str, now_s: Callable[[], float], channels: int, limits_us: tuple[float, float] = LIMITS_US
) -> PwmBackend:
    """Open outputs of servo pulses; `split` raises errors of the text."""
    kind, where, settings = split(text, OUTPUTS)
    if kind == "mcu":
        return McuPwm(McuBoard(lambda: SerialPort(where, BAUD), now_s), now_s, channels)
    if kind == "maestro":
        board = Maestro(lambda: SerialPort(where), now_s, channels, limits_us, has_crc=settings.get("crc", False))
        return PassivePwm(board, now_s)
    args = [text, channels, *limits_us]
    return SupervisedPwm(
        open_supervised(text, channels, *limits_us), now_s, f"{__name__}:{open_supervised.__name__}", args
    )


def open_supervised(text: str, channels: int, low_us: float, high_us: float, reclaim: bool = False) -> PassivePwm:
    """Open outputs that hold their last pulse, in the supervisor's process, whose clock is the computer's."""
    kind, where, settings = split(text, SUPERVISED)
    if kind == "sysfs":
        chip: PwmChip = SysfsPins(channels, (low_us, high_us), root=Path(where) if where else ROOT, reclaim=reclaim)
    else:
        bus, address = bus_and_address(where)
        clock_hz = settings.get("clock_hz")
        chip = Pca9685(
            lambda: I2cBus(bus),
            address,
            channels,
            (low_us, high_us),
            oscillator_hz=clock_hz or settings.get("oscillator_hz", OSCILLATOR_HZ),
            has_external_clock=clock_hz is not None,
        )
    return PassivePwm(chip, time.monotonic, is_supervised=True)


def open_sensor(text: str, now_s: Callable[[], float], about: Any = None) -> Sensor[Any]:
    """Open a real sensor; `split` raises errors of the text.

    Args:
        text: kind and address.
        now_s: the clock that stamps readings.
        about: settings of the part, for kinds that have some: `Ms5837` of an ms5837.
    """
    kind, where, settings = split(text, SENSORS)
    if kind == "gps":
        return Gps(lambda: SerialPort(where, settings.get("baud", GPS_BAUD)), now_s)
    if kind == "piksi":
        return Piksi(lambda: SerialPort(where, settings.get("baud", PIKSI_BAUD)), now_s)
    bus, address = bus_and_address(where)
    if kind == "ms5837":
        return Ms5837I2c(lambda: I2cBus(bus), now_s, about, address)
    return Icm20948(lambda: I2cBus(bus), now_s, address, settings.get("axes", ("x", "y", "z")))


def split(text: str, kinds: tuple[str, ...]) -> tuple[str, str, dict[str, Any]]:
    """Return kind, address and settings from a device's text.

    Raises:
        UnknownNameError: a kind or a setting is not known, or a required address is missing.
        ParameterError: the value of a setting is invalid.
    """
    kind, _, rest = text.partition(":")
    if kind not in kinds:
        raise UnknownNameError(f"'{text}': there is no device of the kind '{kind}' here.", fix=suggest(kind, kinds))
    where, *given = rest.split(",")
    if not where and kind != "sysfs":
        raise UnknownNameError(f"'{text}' does not say where.", fix=f"such as {_EXAMPLES[kind]}.")
    settings: dict[str, Any] = {}
    for one in given:
        name, _, value = one.partition("=")
        if name not in SETTINGS[kind]:
            known = SETTINGS[kind]
            fix = suggest(name, known) if known else f"{kind}:{where}, without anything after it."
            raise UnknownNameError(f"'{text}': a {kind} has no setting '{name}'.", fix=fix)
        if settings:
            raise ParameterError(
                f"'{text}' has two settings, of which only one can hold.", fix="leave one of them out."
            )
        settings[name] = _value(text, one, value, SETTINGS[kind][name])
    return kind, where, settings


def _value(text: str, given: str, value: str, setting: Setting) -> Any:
    try:
        made = setting.read(value)
    except (ValueError, KeyError):
        made = None
    if made is None or not setting.fits(made):
        raise ParameterError(f"'{text}': '{given}' makes no sense.", fix=f"{setting.expected}.") from None
    return made


def check_io(io: Io) -> None:
    """Check the settings in `--io` before anything is opened; see `split` for the errors."""
    if io.kind in OUTPUTS:
        split(str(io), OUTPUTS)


def check_table(table: Mapping[str, str]) -> None:
    """Raise an UnknownNameError if two devices in a robot's table have one address; errors of a text as `split`."""
    seen: dict[tuple[str, ...], str] = {}
    for name, text in table.items():
        kind, where, _ = split(text, (*OUTPUTS, *SENSORS))
        location: tuple[str, ...] = (where or kind,)
        if kind in ("pca9685", "ms5837", "icm20948"):
            location = tuple(map(str, bus_and_address(where)))
        if location in seen:
            raise UnknownNameError(
                f"'{seen[location]}' and '{name}' are both at {where or kind}.",
                fix="`snr doctor` lists the devices; I2C parts have solder bridges for other addresses.",
            )
        seen[location] = name
