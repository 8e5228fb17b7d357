import math
from typing import Any

import msgspec
import numpy as np
import pytest

from snr_sim.devices.commands import SimActuator
from snr_sim.devices.readings import SensorErrors, SimSensor
from snr_sim.prelude.device import Actuator, Sensor
from snr_sim.prelude.errors import CommandError, DeviceError, ParameterError, SensorLostError


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
        self.commands: list[Command] = []

    def reset(self, seed: int) -> None:
        self.time_s = 0.0

    def step(self, dt_s: float) -> None:
        self.time_s += dt_s

    def write(self, name: str, command: Any) -> None:
        assert name == "thruster"
        self.commands.append(command)

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


def test_sim_devices_implement_interfaces() -> None:
    assert isinstance(sensor(Tank()), Sensor)
    assert isinstance(actuator(Tank()), Actuator)


def test_sim_sensor_without_errors_returns_truth() -> None:
    tank = Tank()
    tank.step(1.25)
    assert sensor(tank).read() == tank.read("depth")


def test_sim_sensor_noise_has_given_sigma_in_given_fields_only() -> None:
    device = sensor(Tank(), noise={"depth_m": 0.5, "position_m": 2.0})
    readings = [device.read() for _ in range(4000)]
    assert np.std([r.depth_m for r in readings]) == pytest.approx(0.5, rel=0.05)
    assert np.std([r.position_m for r in readings], axis=0) == pytest.approx([2.0, 2.0], rel=0.05)
    assert abs(np.corrcoef([r.position_m for r in readings], rowvar=False)[0, 1]) < 0.06
    assert {(r.wet, r.stamp_s) for r in readings} == {(True, 0.0)}


def test_sim_sensor_noise_depends_on_seed_only() -> None:
    def draw(seed: int) -> list[Reading]:
        device = sensor(Tank(), seed, noise={"depth_m": 0.5})
        return [device.read() for _ in range(600)]

    assert draw(1) == draw(1)
    assert draw(1) != draw(2)


def test_sim_sensor_rounds_after_noise() -> None:
    tank = Tank()
    tank.step(1.26)
    reading = sensor(tank, noise={"depth_m": 0.3}, resolution={"depth_m": 0.5, "position_m": 0.1}).read()
    assert reading.depth_m % 0.5 == 0.0
    assert reading.position_m == pytest.approx([1.3, -1.3], abs=1e-12)


def test_sim_sensor_with_delay_returns_past_value() -> None:
    tank = Tank()
    device = sensor(tank, delay_s=0.25)
    ages = []
    for _ in range(100):
        ages.append(tank.time_s - device.read().stamp_s)
        tank.step(0.1)
    assert ages[:3] == pytest.approx([0.0, 0.1, 0.2])  # no reading is old enough yet
    assert ages[3:] == pytest.approx([0.3] * 97)  # rounded up to whole periods


def test_sim_sensor_delay_of_one_period_is_exact() -> None:
    tank = Tank()
    device = sensor(tank, delay_s=0.1)
    for _ in range(1000):
        reading = device.read()
        tank.step(0.1)
    assert tank.time_s - reading.stamp_s == pytest.approx(0.2)


def test_sim_sensor_repeats_reading_within_period() -> None:
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


def test_sim_sensor_read_slower_than_period_returns_new_reading() -> None:
    tank = Tank()
    device = sensor(tank, period_s=0.01)
    for _ in range(20):
        tank.step(0.1)
        assert device.read().stamp_s == tank.time_s


def test_sim_sensor_errors_apply_before_conversion() -> None:
    class Pressure(msgspec.Struct, frozen=True):
        pressure_pa: float
        stamp_s: float

    class Depth(msgspec.Struct, frozen=True):
        depth_m: float
        stamp_s: float

    tank = Tank()
    tank.step(3.0)
    device = SimSensor(
        tank,
        "depth",
        SensorErrors(resolution={"pressure_pa": 7000.0}),
        np.random.default_rng(1),
        measure=lambda water: Pressure(10_000.0 * water.depth_m, water.stamp_s),
        convert=lambda pressure: Depth(pressure.pressure_pa / 10_000.0, pressure.stamp_s),
    )
    assert device.read() == Depth(2.8, 3.0)
    with pytest.raises(ParameterError, match="no field 'depth_m'"):
        SimSensor(
            tank, "depth", SensorErrors(noise={"depth_m": 1.0}), np.random.default_rng(1), lambda _: Pressure(0.0, 0.0)
        )


def test_sim_devices_unknown_field_raises_parameter_error() -> None:
    with pytest.raises(ParameterError, match=r"no field 'dept_m'[\s\S]*did you mean 'depth_m'"):
        sensor(Tank(), noise={"dept_m": 0.1})
    with pytest.raises(ParameterError, match="no field 'thrust'"):
        SimActuator(Tank(), "thruster", Command, {"thrust": (0.0, 1.0)})


def test_sim_sensor_closed_raises_sensor_lost() -> None:
    device = sensor(Tank())
    device.close()
    device.close()
    with pytest.raises(SensorLostError, match="closed"):
        device.read()


def test_sim_actuator_keeps_command_within_limits() -> None:
    tank = Tank()
    command = Command(5.0, [0.1, -0.1])
    assert actuator(tank).write(command) == command
    assert tank.commands == [command]


@pytest.mark.parametrize(("requested", "applied"), [(99.0, 20.0), (-99.0, -10.0), (25, 20.0), (7, 7)])
def test_sim_actuator_clamps_command_and_returns_applied(requested: float, applied: float) -> None:
    tank = Tank()
    assert actuator(tank).write(Command(requested, [3.0, 0.0])) == Command(applied, [0.5, 0.0])
    assert tank.commands == [Command(applied, [0.5, 0.0])]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "fast", None, True])
def test_sim_actuator_non_finite_number_raises_and_applies_nothing(value: Any) -> None:
    tank = Tank()
    with pytest.raises(CommandError, match=f"thrust_n must be a finite number, not {value!r}"):
        actuator(tank).write(Command(value))
    with pytest.raises(CommandError, match=r"fins_rad\[1\]"):
        actuator(tank).write(Command(1.0, [0.0, value]))
    assert tank.commands == []


def test_sim_actuator_other_command_type_raises_command_error() -> None:
    with pytest.raises(CommandError, match="takes Command, not dict"):
        actuator(Tank()).write({"thrust_n": 1.0})  # type: ignore[arg-type]


def test_sim_actuator_neutral_is_repeatable_and_works_after_close() -> None:
    tank = Tank()
    device = actuator(tank)
    device.write(Command(5.0))
    device.neutral()
    device.neutral()
    device.close()
    device.close()
    device.neutral()
    assert set(map(str, tank.commands[1:])) == {str(Command())}
    with pytest.raises(DeviceError, match="closed"):
        device.write(Command(5.0))
