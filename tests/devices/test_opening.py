"""Devices from a short text; and the underwater vehicle's own table of ports."""

from types import ModuleType
from typing import Any

import pytest

from snr_sim.devices import opening
from snr_sim.devices.mcu.mcu import McuPwm
from snr_sim.devices.opening import check_table, open_held, open_pwm, open_sensor
from snr_sim.devices.pwm.maestro import Maestro
from snr_sim.devices.pwm.pca9685 import Pca9685
from snr_sim.devices.pwm.plain_pwm import PlainPwm
from snr_sim.devices.pwm.supervised_pwm import SupervisedPwm
from snr_sim.devices.sensors.gps import Gps
from snr_sim.devices.sensors.icm20948 import Icm20948
from snr_sim.devices.sensors.ms5837_i2c import Ms5837I2c
from snr_sim.devices.wire.i2c_bus import I2cBus
from snr_sim.prelude.errors import DeviceError, ParameterError, SnrError, UnknownName
from snr_sim.prelude.scenario import Rig, Robot
from snr_sim.prelude.signals import DepthReading, ImuReading
from snr_sim.scenario import library
from snr_sim.testing.i2c_parts import FakeBus
from snr_sim.testing.icm20948_part import Ak09916Part, Icm20948Part
from snr_sim.testing.ms5837_part import Ms5837Part


def now_s() -> float:
    return 0.0


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("mcu:/dev/ttyUSB0", McuPwm),
        ("maestro:/dev/ttyACM0", PlainPwm),
        ("maestro:/dev/ttyACM0,crc", PlainPwm),
        ("pca9685:1:0x40", SupervisedPwm),
        ("sysfs", SupervisedPwm),
    ],
)
def test_outputs_are_opened_by_text_and_all_of_them_fail_safe_alone(text: str, kind: type) -> None:
    out = open_pwm(text, now_s, 2)
    assert type(out) is kind
    assert out.fails_safe_alone
    assert out.health().state == "unconfigured"  # nothing has been opened


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("ms5837:1:0x76", Ms5837I2c),
        ("icm20948:1:0x69", Icm20948),
        ("icm20948:3:0x68,axes=y/-x/z", Icm20948),
        ("gps:/dev/ttyS0,baud=38400", Gps),
    ],
)
def test_sensors_are_opened_by_text(text: str, kind: type) -> None:
    assert type(open_sensor(text, now_s)) is kind


def test_a_measured_oscillator_and_a_clock_outside_are_settings() -> None:
    measured = open_held("pca9685:1:0x40,oscillator_hz=26.2e6", 8, 1100.0, 1900.0).chip
    assert isinstance(measured, Pca9685)
    assert (measured.prescale, measured.count_us) == (127, pytest.approx(128 / 26.2))
    clocked = open_held("pca9685:1:0x40,clock_hz=24.576e6", 8, 1100.0, 1900.0).chip
    assert isinstance(clocked, Pca9685)
    assert clocked.prescale == 119


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("maestor:/dev/ttyACM0", "did you mean 'maestro'"),
        ("maestro:", "does not say where.\n  Try: such as maestro:/dev/ttyACM0"),
        ("maestro:/dev/ttyACM0,crv", "a maestro has no setting 'crv'"),
        ("pca9685:1:0x99", "'1:0x99' is no I2C bus and address"),
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
def test_a_text_of_no_outputs_is_refused_with_what_to_type(text: str, said: str) -> None:
    with pytest.raises((UnknownName, ParameterError)) as caught:
        open_pwm(text, now_s, 2)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
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
        ("ms5837:1:0x76,baud=9600", "ms5837 has no setting 'baud'"),
    ],
)
def test_a_text_of_no_sensor_is_refused_with_what_to_type(text: str, said: str) -> None:
    with pytest.raises((UnknownName, ParameterError)) as caught:
        open_sensor(text, now_s)
    assert said in str(caught.value)
    with pytest.raises((UnknownName, ParameterError)):
        check_table({"it": text})


def test_a_check_sum_is_switched_on_by_yes_and_off_by_no(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[bool] = []

    def open_board(*args: Any, has_crc: bool) -> Maestro:
        given.append(has_crc)
        return Maestro(*args, has_crc=has_crc)

    monkeypatch.setattr(opening, "Maestro", open_board)
    for text in ("crc", "crc=yes", "crc=no"):
        open_pwm(f"maestro:/dev/ttyACM0,{text}", now_s, 2)
    open_pwm("maestro:/dev/ttyACM0", now_s, 2)
    assert given == [True, True, False, False]


def test_two_devices_at_one_place_are_told_by_their_names() -> None:
    check_table(
        {"depth": "ms5837:1:0x76", "imu": "icm20948:1:0x69", "pwm": "mcu:/dev/ttyUSB0", "other": "ms5837:2:0x76"}
    )
    for one, other in (("ms5837:1:0x76", "icm20948:i2c-1:118"), ("mcu:/dev/ttyUSB0", "gps:/dev/ttyUSB0,baud=4800")):
        with pytest.raises(UnknownName, match="'depth' and 'imu' are both at"):
            check_table({"depth": one, "imu": other})


def test_a_port_that_is_not_there_is_told_when_it_is_configured_and_not_before() -> None:
    out = open_pwm("maestro:/dev/ttyACM77", now_s, 2)
    with pytest.raises(DeviceError, match="There is no serial port /dev/ttyACM77"):
        out.configure()
    assert out.health().state == "error"
    out.close()


def urov(io: str, where: str = "") -> tuple[ModuleType, Rig]:
    robot = library.load_robot(library.find("robots", "urov"))
    scenario = library.load_scenario(library.find("scenarios", "urov_depth_hold"))
    about = Robot("urov", "urov", "urov_depth_hold", "mujoco", scenario.parameters(1), {})
    return robot, Rig(about, io, 1, None, where)


def test_the_vehicles_table_of_ports_opens_its_sensors_and_leaves_out_what_is_not_in_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = [0.0]
    unit = Icm20948Part()
    bus = FakeBus({0x76: Ms5837Part(lambda: clock[0]), 0x69: unit, 0x0C: Ak09916Part(unit)})
    monkeypatch.setattr(opening, "I2cBus", lambda number: I2cBus(number, bus.opened))

    def sleep(seconds: float) -> None:
        clock[0] += seconds

    robot, rig = urov("pi")
    read: dict[str, Any] = {}
    for name in ("depth", "imu"):
        sensor = robot.DEVICES["pi"][name](rig)
        sensor._sleep = sleep
        sensor.configure()
        sensor.activate()
        read[name] = sensor.read()
        sensor.close()
    assert isinstance(read["depth"], DepthReading)
    assert read["depth"].depth_m == pytest.approx(0.0, abs=0.01)
    assert isinstance(read["imu"], ImuReading)
    assert "altitude" not in robot.DEVICES["pi"]
    keys = {getattr(one, "key", "") for one in robot.roles(rig, [])["urov"]}
    assert {"depth", "imu", "power", "pwm"} <= keys
    assert not {"altitude", "leak"} & keys


def test_the_vehicles_table_may_name_any_outputs(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, rig = urov("pi")
    assert type(robot.DEVICES["pi"]["pwm"](rig)) is McuPwm
    monkeypatch.setitem(robot.PI, "pwm", "pca9685:1:0x40")
    out = robot.DEVICES["pi"]["pwm"](rig)
    assert type(out) is SupervisedPwm
    assert out.channels == 8
    monkeypatch.setitem(robot.PI, "imu", "icm20948:1:0x40")
    with pytest.raises(SnrError, match="'pwm' and 'imu' are both at 1:0x40"):
        robot.DEVICES["pi"]["pwm"](rig)
