import numpy as np
import pytest

from snr_sim.devices.sensors.hull_sensors import LeakProbe, PowerModule
from snr_sim.plants.outputs import PowerOutput
from snr_sim.plants.urov.instruments import LeakOutput
from snr_sim.prelude.errors import ParameterError
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.fakes import FakePlant


def hull(water_l: float = 0.0, current_a: float = 25.0) -> FakePlant:
    return FakePlant({"power": PowerOutput(15.2, current_a, 0.8, 0.0), "leak": LeakOutput(water_l, 0.0)})


def test_hull_sensors_pass_sensor_contract() -> None:
    check_sensor(lambda: PowerModule().simulated(hull(), "power", np.random.default_rng(1)))
    check_sensor(lambda: LeakProbe().simulated(hull(), "leak", np.random.default_rng(1)))


def test_power_module_rounds_to_12_bit_steps() -> None:
    sensor = PowerModule().simulated(hull(), "power", np.random.default_rng(1))
    results = [sensor.read() for _ in range(2000)]
    assert np.mean([reading.voltage_v for reading in results]) == pytest.approx(15.2, abs=0.002)
    assert np.mean([reading.current_a for reading in results]) == pytest.approx(25.0, abs=0.004)
    steps = [reading.voltage_v / (60.0 / 4096) for reading in results]
    assert np.abs(np.array(steps) - np.round(steps)).max() < 1e-6


def test_power_module_overcurrent_returns_limit() -> None:
    assert PowerModule().simulated(hull(current_a=180.0), "power", np.random.default_rng(1)).read().current_a == 120.0


def test_leak_probe_once_wet_stays_wet() -> None:
    plant = hull()
    probe = LeakProbe(trip_volume_l=0.05).simulated(plant, "leak", np.random.default_rng(1))
    course = []
    for water_l in (0.0, 0.049, 0.05, 0.2, 0.0):
        plant.held["leak"] = LeakOutput(water_l, 0.0)
        course.append(probe.read().is_wet)
    assert course == [False, False, True, True, True]


def test_leak_probe_zero_trip_volume_raises_error() -> None:
    with pytest.raises(ParameterError, match="trip_volume_l must be positive"):
        LeakProbe(trip_volume_l=0.0)
