import math
from typing import Any

import msgspec
import numpy as np
import pytest

from snr_sim.devices.sensors.sensor_errors import SensorErrors
from snr_sim.devices.simulated import SimActuator, SimSensor
from snr_sim.prelude.device import Actuator, Sensor
from snr_sim.prelude.errors import CommandError, DeviceError, ParameterError, SensorLost


class Reading(msgspec.Struct, frozen=True):
    depth_m: float
    position_m: list[float]
    wet: bool
    stamp_s: float


class Command(msgspec.Struct, frozen=True):
    thrust_n: float = 0.0
    fins_rad: list[float] = []


class Tank:
    """A plant whose depth is its time."""

    engine, step_s, inputs, outputs = "test", None, ("thruster",), ("depth",)

    def __init__(self) -> None:
        self.time_s = 0.0
        self.told: list[Command] = []

    def reset(self, seed: int) -> None:
        self.time_s = 0.0

    def step(self, dt_s: float) -> None:
        self.time_s += dt_s

    def write(self, name: str, command: Any) -> None:
        assert name == "thruster"
        self.told.append(command)

    def read(self, name: str) -> Reading:
        return Reading(self.time_s, [self.time_s, -self.time_s], True, self.time_s)

    def snapshot(self) -> Any:
        return self.time_s

    def restore(self, snapshot: Any) -> None:
        self.time_s = snapshot

    def scene(self) -> dict[str, Any]:
        return {}

    def truth(self) -> dict[str, Any]:
        return {}


def sensor(tank: Tank, seed: int = 1, **errors: Any) -> SimSensor:
    return SimSensor(tank, "depth", SensorErrors(**errors), np.random.default_rng(seed))


def actuator(tank: Tank) -> SimActuator[Command]:
    return SimActuator(tank, "thruster", Command, {"thrust_n": (-10.0, 20.0), "fins_rad": (-0.5, 0.5)})


def test_both_keep_their_promises() -> None:
    assert isinstance(sensor(Tank()), Sensor)
    assert isinstance(actuator(Tank()), Actuator)


def test_without_errors_a_sensor_tells_the_truth() -> None:
    tank = Tank()
    tank.step(1.25)
    assert sensor(tank).read() == tank.read("depth")


def test_noise_has_the_size_it_was_given_in_numbers_and_in_lists_and_nowhere_else() -> None:
    device = sensor(Tank(), noise={"depth_m": 0.5, "position_m": 2.0})
    readings = [device.read() for _ in range(4000)]
    assert np.std([r.depth_m for r in readings]) == pytest.approx(0.5, rel=0.05)
    assert np.std([r.position_m for r in readings], axis=0) == pytest.approx([2.0, 2.0], rel=0.05)
    assert abs(np.corrcoef([r.position_m for r in readings], rowvar=False)[0, 1]) < 0.06
    assert {(r.wet, r.stamp_s) for r in readings} == {(True, 0.0)}


def test_noise_comes_from_the_seed_alone() -> None:
    def draw(seed: int) -> list[Reading]:
        device = sensor(Tank(), seed, noise={"depth_m": 0.5})
        return [device.read() for _ in range(600)]

    assert draw(1) == draw(1)
    assert draw(1) != draw(2)


def test_values_are_rounded_to_the_resolution_after_the_noise() -> None:
    tank = Tank()
    tank.step(1.26)
    reading = sensor(tank, noise={"depth_m": 0.3}, resolution={"depth_m": 0.5, "position_m": 0.1}).read()
    assert reading.depth_m % 0.5 == 0.0
    assert reading.position_m == pytest.approx([1.3, -1.3], abs=1e-12)


def test_a_delayed_sensor_answers_with_what_was_then() -> None:
    tank = Tank()
    device = sensor(tank, delay_s=0.25)
    ages = []
    for _ in range(100):
        ages.append(tank.time_s - device.read().stamp_s)
        tank.step(0.1)
    assert ages[:3] == pytest.approx([0.0, 0.1, 0.2])  # no reading is old enough yet
    assert ages[3:] == pytest.approx([0.3] * 97)  # rounded up to whole periods


def test_a_delay_of_one_period_is_one_period_in_spite_of_rounding() -> None:
    tank = Tank()
    device = sensor(tank, delay_s=0.1)
    for _ in range(1000):
        reading = device.read()
        tank.step(0.1)
    assert tank.time_s - reading.stamp_s == pytest.approx(0.2)


def test_a_part_that_measures_at_its_own_rate_tells_the_same_until_it_has_measured_again() -> None:
    tank = Tank()
    device = sensor(tank, period_s=0.035, noise={"depth_m": 0.1})
    readings = []
    for _ in range(350):
        readings.append(device.read())
        tank.step(0.01)
    stamps = sorted({reading.stamp_s for reading in readings})
    assert len(stamps) == 100  # 3.5 s at its own rate, though it was asked more often
    assert len({reading.depth_m for reading in readings}) == 100, "the same reading, with the same noise"
    assert np.diff(stamps).max() == pytest.approx(0.04)


def test_asked_less_often_than_it_measures_a_part_tells_something_new_each_time() -> None:
    tank = Tank()
    device = sensor(tank, period_s=0.01)
    for _ in range(20):
        tank.step(0.1)
        assert device.read().stamp_s == tank.time_s


def test_errors_are_of_what_the_part_feels_and_what_it_tells_follows_from_them() -> None:
    class Felt(msgspec.Struct, frozen=True):
        pressure_pa: float
        stamp_s: float

    class Told(msgspec.Struct, frozen=True):
        depth_m: float
        stamp_s: float

    tank = Tank()
    tank.step(3.0)
    device = SimSensor(
        tank,
        "depth",
        SensorErrors(resolution={"pressure_pa": 7000.0}),
        np.random.default_rng(1),
        senses=lambda water: Felt(10_000.0 * water.depth_m, water.stamp_s),
        tells=lambda felt: Told(felt.pressure_pa / 10_000.0, felt.stamp_s),
    )
    assert device.read() == Told(2.8, 3.0)
    with pytest.raises(ParameterError, match="no field 'depth_m'"):
        SimSensor(
            tank, "depth", SensorErrors(noise={"depth_m": 1.0}), np.random.default_rng(1), lambda _: Felt(0.0, 0.0)
        )


def test_errors_of_a_field_that_is_not_there_are_said_at_once() -> None:
    with pytest.raises(ParameterError, match=r"no field 'dept_m'[\s\S]*did you mean 'depth_m'"):
        sensor(Tank(), noise={"dept_m": 0.1})
    with pytest.raises(ParameterError, match="no field 'thrust'"):
        SimActuator(Tank(), "thruster", Command, {"thrust": (0.0, 1.0)})


def test_a_closed_sensor_is_lost() -> None:
    device = sensor(Tank())
    device.close()
    device.close()
    with pytest.raises(SensorLost, match="closed"):
        device.read()


def test_a_command_within_its_limits_arrives_as_it_is() -> None:
    tank = Tank()
    command = Command(5.0, [0.1, -0.1])
    assert actuator(tank).write(command) == command
    assert tank.told == [command]


@pytest.mark.parametrize(("wanted", "applied"), [(99.0, 20.0), (-99.0, -10.0), (25, 20.0), (7, 7)])
def test_a_command_beyond_its_limits_is_clamped_and_returned_as_applied(wanted: float, applied: float) -> None:
    tank = Tank()
    assert actuator(tank).write(Command(wanted, [3.0, 0.0])) == Command(applied, [0.5, 0.0])
    assert tank.told == [Command(applied, [0.5, 0.0])]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "fast", None, True])
def test_what_is_no_finite_number_is_refused_by_name_and_nothing_is_applied(value: Any) -> None:
    tank = Tank()
    with pytest.raises(CommandError, match=f"thrust_n = {value!r}"):
        actuator(tank).write(Command(value))
    with pytest.raises(CommandError, match=r"fins_rad\[1\]"):
        actuator(tank).write(Command(1.0, [0.0, value]))
    assert tank.told == []


def test_a_command_of_another_type_is_refused() -> None:
    with pytest.raises(CommandError, match="takes Command, not dict"):
        actuator(Tank()).write({"thrust_n": 1.0})  # type: ignore[arg-type]


def test_neutral_is_safe_at_any_time_also_twice_and_after_close() -> None:
    tank = Tank()
    device = actuator(tank)
    device.write(Command(5.0))
    device.neutral()
    device.neutral()
    device.close()
    device.close()
    device.neutral()
    assert set(map(str, tank.told[1:])) == {str(Command())}
    with pytest.raises(DeviceError, match="closed"):
        device.write(Command(5.0))
