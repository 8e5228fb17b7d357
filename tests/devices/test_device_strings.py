"""Devices from a short text; and the underwater vehicle's own table of ports."""

from types import ModuleType
from typing import Any

import pytest

from snr_sim.devices import device_strings
from snr_sim.devices.device_strings import check_table, open_pwm, open_sensor, open_supervised
from snr_sim.devices.mcu.mcu import McuPwm
from snr_sim.devices.pwm.maestro import Maestro
from snr_sim.devices.pwm.passive_pwm import PassivePwm
from snr_sim.devices.pwm.pca9685 import Pca9685
from snr_sim.devices.pwm.supervised_pwm import SupervisedPwm
from snr_sim.devices.sensors.gps import Gps
from snr_sim.devices.sensors.icm20948 import Icm20948
from snr_sim.devices.sensors.ms5837_i2c import Ms5837I2c
from snr_sim.devices.sensors.piksi import Piksi
from snr_sim.devices.wire.i2c_bus import I2cBus
from snr_sim.prelude.errors import DeviceError, ParameterError, SnrError, UnknownNameError
from snr_sim.prelude.scenario import RobotContext, RobotInfo
from snr_sim.prelude.signals import DepthReading, ImuReading
from snr_sim.scenario import library
from snr_sim.testing.fake_i2c import FakeBus
from snr_sim.testing.fake_icm20948 import FakeAk09916, FakeIcm20948
from snr_sim.testing.fake_ms5837 import FakeMs5837


def now_s() -> float:
    return 0.0


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("mcu:/dev/ttyUSB0", McuPwm),
        ("maestro:/dev/ttyACM0", PassivePwm),
        ("maestro:/dev/ttyACM0,crc", PassivePwm),
        ("pca9685:1:0x40", SupervisedPwm),
        ("sysfs", SupervisedPwm),
    ],
)
def test_open_pwm_opens_each_kind_with_independent_failsafe(text: str, kind: type) -> None:
    out = open_pwm(text, now_s, 2)
    assert type(out) is kind
    assert out.has_independent_failsafe
    assert out.health().state == "unconfigured"  # nothing has been opened


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("ms5837:1:0x76", Ms5837I2c),
        ("icm20948:1:0x69", Icm20948),
        ("icm20948:3:0x68,axes=y/-x/z", Icm20948),
        ("gps:/dev/ttyS0,baud=38400", Gps),
        ("piksi:/dev/ttyUSB1", Piksi),
        ("piksi:/dev/ttyUSB1,baud=1000000", Piksi),
    ],
)
def test_open_sensor_opens_each_kind(text: str, kind: type) -> None:
    assert type(open_sensor(text, now_s)) is kind


def test_open_supervised_reads_oscillator_and_clock_settings() -> None:
    measured = open_supervised("pca9685:1:0x40,oscillator_hz=26.2e6", 8, 1100.0, 1900.0).chip
    assert isinstance(measured, Pca9685)
    assert (measured.prescale, measured.count_us) == (127, pytest.approx(128 / 26.2))
    clocked = open_supervised("pca9685:1:0x40,clock_hz=24.576e6", 8, 1100.0, 1900.0).chip
    assert isinstance(clocked, Pca9685)
    assert clocked.prescale == 119


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("maestor:/dev/ttyACM0", "did you mean 'maestro'"),
        ("maestro:", "does not say where.\n  Try: such as maestro:/dev/ttyACM0"),
        ("maestro:/dev/ttyACM0,crv", "a maestro has no setting 'crv'"),
        ("pca9685:1:0x99", "'1:0x99' is not an I2C bus and address"),
        ("maestro:/dev/ttyACM0,crc=perhaps", "'crc=perhaps' makes no sense.\n  Try: crc, crc=yes or crc=no"),
        ("maestro:/dev/ttyACM0,crc,crc=no", "two settings, of which only one can hold"),
        ("mcu:/dev/ttyUSB0,baud=9600", "mcu has no setting 'baud'.\n  Try: mcu:/dev/ttyUSB0, without"),
        *[
            (f"pca9685:1:0x40,oscillator_hz={one}", f"'oscillator_hz={one}' makes no sense.\n  Try: 23e6 to 27e6 Hz")
            for one in ("fast", "nan", "inf", "-25e6", "0", "25", "", "1e400")
        ],
        *[
            (f"pca9685:1:0x40,clock_hz={one}", f"'clock_hz={one}' makes no sense.\n  Try: 1e6 to 50e6 Hz")
            for one in ("nan", "inf", "0", "51e6", "")
        ],
        ("pca9685:1:0x40,clock_hz=25e6,oscillator_hz=25e6", "two settings, of which only one can hold"),
        ("ms5837:1:0x76", "no device of the kind 'ms5837' here"),
    ],
)
def test_open_pwm_invalid_text_raises_error_with_example(text: str, message: str) -> None:
    with pytest.raises((UnknownNameError, ParameterError)) as caught:
        open_pwm(text, now_s, 2)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *[
            (f"gps:/dev/ttyS0,baud={one}", f"'baud={one}' makes no sense.\n  Try: a whole number, 1200 to 921600")
            for one in ("nan", "0", "-9600", "9600.5", "fast", "", "1e9", "99999999999999999999")
        ],
        *[
            (f"icm20948:1:0x69,axes={one}", f"'axes={one}' makes no sense.\n  Try: three axes such as y/-x/z")
            for one in ("", "x", "x/y", "x/y/w", "y/x/z", "x/x/x", "--x/y/z")
        ],
        ("gps:/dev/ttyS0,boud=9600", "did you mean 'baud'"),
        ("piksi:", "'piksi:' does not say where.\n  Try: such as piksi:/dev/ttyUSB1."),
        ("ms5837:1:0x76,baud=9600", "ms5837 has no setting 'baud'"),
    ],
)
def test_open_sensor_invalid_text_raises_error_with_example(text: str, message: str) -> None:
    with pytest.raises((UnknownNameError, ParameterError)) as caught:
        open_sensor(text, now_s)
    assert message in str(caught.value)
    with pytest.raises((UnknownNameError, ParameterError)):
        check_table({"it": text})


def test_open_pwm_crc_setting_accepts_yes_and_no(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[bool] = []

    def open_board(*args: Any, has_crc: bool) -> Maestro:
        given.append(has_crc)
        return Maestro(*args, has_crc=has_crc)

    monkeypatch.setattr(device_strings, "Maestro", open_board)
    for text in ("crc", "crc=yes", "crc=no"):
        open_pwm(f"maestro:/dev/ttyACM0,{text}", now_s, 2)
    open_pwm("maestro:/dev/ttyACM0", now_s, 2)
    assert given == [True, True, False, False]


def test_check_table_duplicate_address_names_both_devices() -> None:
    check_table(
        {"depth": "ms5837:1:0x76", "imu": "icm20948:1:0x69", "pwm": "mcu:/dev/ttyUSB0", "other": "ms5837:2:0x76"}
    )
    for one, other in (("ms5837:1:0x76", "icm20948:i2c-1:118"), ("mcu:/dev/ttyUSB0", "gps:/dev/ttyUSB0,baud=4800")):
        with pytest.raises(UnknownNameError, match="'depth' and 'imu' are both at"):
            check_table({"depth": one, "imu": other})


def test_open_pwm_missing_port_raises_only_at_configure() -> None:
    out = open_pwm("maestro:/dev/ttyACM77", now_s, 2)
    with pytest.raises(DeviceError, match="There is no serial port /dev/ttyACM77"):
        out.configure()
    assert out.health().state == "error"
    out.close()


def urov(io: str, where: str = "") -> tuple[ModuleType, RobotContext]:
    robot = library.load_robot(library.find("robots", "urov"))
    scenario = library.load_scenario(library.find("scenarios", "urov_depth_hold"))
    about = RobotInfo("urov", "urov", "urov_depth_hold", "mujoco", scenario.parameters(1), {})
    return robot, RobotContext(about, io, 1, None, where)


def test_urov_port_table_opens_listed_sensors_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = [0.0]
    unit = FakeIcm20948()
    bus = FakeBus({0x76: FakeMs5837(lambda: clock[0]), 0x69: unit, 0x0C: FakeAk09916(unit)})
    monkeypatch.setattr(device_strings, "I2cBus", lambda number: I2cBus(number, bus.opened))

    def sleep(seconds: float) -> None:
        clock[0] += seconds

    robot, context = urov("pi")
    read: dict[str, Any] = {}
    for name in ("depth", "imu"):
        sensor = robot.DEVICES["pi"][name](context)
        sensor._sleep = sleep
        sensor.configure()
        sensor.activate()
        read[name] = sensor.read()
        sensor.close()
    assert isinstance(read["depth"], DepthReading)
    assert read["depth"].depth_m == pytest.approx(0.0, abs=0.01)
    assert isinstance(read["imu"], ImuReading)
    assert "altitude" not in robot.DEVICES["pi"]
    keys = {getattr(one, "key", "") for one in robot.roles(context, [])["urov"]}
    assert {"depth", "imu", "power", "pwm"} <= keys
    assert not {"altitude", "leak"} & keys


def test_urov_port_table_accepts_any_outputs(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, context = urov("pi")
    assert type(robot.DEVICES["pi"]["pwm"](context)) is McuPwm
    monkeypatch.setitem(robot.PI, "pwm", "pca9685:1:0x40")
    out = robot.DEVICES["pi"]["pwm"](context)
    assert type(out) is SupervisedPwm
    assert out.channels == 8
    monkeypatch.setitem(robot.PI, "imu", "icm20948:1:0x40")
    with pytest.raises(SnrError, match="'pwm' and 'imu' are both at 1:0x40"):
        robot.DEVICES["pi"]["pwm"](context)
