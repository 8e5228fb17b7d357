"""A motor's line between torque and rate, in each mode of its controller."""

import math
from dataclasses import replace

import pytest

from snr_sim.plants.ground.dc_motor import DcMotor
from snr_sim.prelude.errors import ParameterError

MOTOR = DcMotor(5.0 * math.pi, 0.15, 1e-4, 0.1, 19.0, 0.8, 6.0, 20.0)
SUPPLY_V = 22.2


def test_seed_rover_turns_at_175_rpm() -> None:
    """40 000 electrical rpm, 12 pole pairs and a gear of 19: what roveberrypy's documentation names."""
    assert MOTOR.top_radps(SUPPLY_V) * 60.0 / (2.0 * math.pi) == pytest.approx(40_000 / 228, rel=0.002)
    assert MOTOR.nm_per_a * 6.0 == pytest.approx(60.0 / (2.0 * math.pi * 150.0) * 6.0 * 19.0 * 0.8)


def test_duty_gives_stall_torque_and_idle_rate_of_the_dc_line() -> None:
    full = MOTOR.drive("duty", 1.0, SUPPLY_V)
    assert full.gain_nm * full.value == pytest.approx(SUPPLY_V / MOTOR.resistance_ohm * MOTOR.nm_per_a)
    assert full.gain_nm * full.value / full.slope_nms == pytest.approx(MOTOR.top_radps(SUPPLY_V))


@pytest.mark.parametrize(
    ("mode", "value", "meant"),
    [("duty", 3.0, 1.0), ("current", -99.0, -6.0), ("speed", 99.0, MOTOR.top_radps(SUPPLY_V))],
)
def test_command_is_clamped_to_what_the_motor_can(mode: str, value: float, meant: float) -> None:
    assert MOTOR.drive(mode, value, SUPPLY_V).value == meant


def test_brake_is_friction_of_its_current_and_off_only_that_of_the_bearings() -> None:
    assert MOTOR.drive("brake", 4.0, SUPPLY_V).friction_nm == pytest.approx(0.1 + 4.0 * MOTOR.nm_per_a)
    assert MOTOR.drive("brake", 99.0, SUPPLY_V).friction_nm == pytest.approx(0.1 + 6.0 * MOTOR.nm_per_a)
    assert MOTOR.drive("off", 1.0, SUPPLY_V) == MOTOR.drive("off", 0.0, SUPPLY_V)
    assert MOTOR.drive("off", 0.0, SUPPLY_V).gain_nm == 0.0


@pytest.mark.parametrize("rate", [-30.0, -15.0, 0.0, 10.0, 18.0, 30.0])
def test_torque_is_limited_by_current_and_by_the_voltage_that_is_left(rate: float) -> None:
    low, high = MOTOR.limits_nm(rate, SUPPLY_V)
    for torque, sign in ((high, 1.0), (low, -1.0)):
        current_a = torque / MOTOR.nm_per_a
        volts = current_a * MOTOR.resistance_ohm + rate * MOTOR.v_per_radps
        assert abs(current_a) <= MOTOR.limit_a + 1e-12
        is_within = sign * volts <= SUPPLY_V + 1e-9
        assert is_within or torque == 0.0, "a motor that is driven faster gives no more torque ahead"


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("kv_radps_per_v", 1e5, "kv_radps_per_v is 100000.0"),
        ("resistance_ohm", 15.0, "resistance_ohm is 15.0: milliohms"),
        ("resistance_ohm", 0.0, "resistance_ohm is 0"),
        ("efficiency", 80.0, "efficiency is 80.0: percent"),
        ("limit_a", math.nan, "limit_a is nan"),
        ("gear", 0.0, "gear is 0"),
    ],
)
def test_impossible_motor_is_refused(name: str, value: float, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        replace(MOTOR, **{name: value})
