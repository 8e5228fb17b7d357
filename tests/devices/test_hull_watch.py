import numpy as np
import pytest

from snr_sim.devices.sensors.hull_watch import LeakProbe, PowerModule
from snr_sim.plants.urov.urov_outputs import Leak, Power
from snr_sim.prelude.errors import ParameterError
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.fakes import FakePlant


def hull(water_l: float = 0.0, current_a: float = 25.0) -> FakePlant:
    return FakePlant({"power": Power(15.2, current_a, 0.8, 0.0), "leak": Leak(water_l, 0.0)})


def test_both_keep_the_promise_of_sensors() -> None:
    check_sensor(lambda: PowerModule().simulated(hull(), "power", np.random.default_rng(1)))
    check_sensor(lambda: LeakProbe().simulated(hull(), "leak", np.random.default_rng(1)))


def test_voltage_and_current_come_with_the_steps_of_a_12_bit_converter() -> None:
    sensor = PowerModule().simulated(hull(), "power", np.random.default_rng(1))
    told = [sensor.read() for _ in range(2000)]
    assert np.mean([reading.voltage_v for reading in told]) == pytest.approx(15.2, abs=0.002)
    assert np.mean([reading.current_a for reading in told]) == pytest.approx(25.0, abs=0.004)
    steps = [reading.voltage_v / (60.0 / 4096) for reading in told]
    assert np.abs(np.array(steps) - np.round(steps)).max() < 1e-6


def test_more_current_than_the_module_can_measure_reads_as_its_limit() -> None:
    assert PowerModule().simulated(hull(current_a=180.0), "power", np.random.default_rng(1)).read().current_a == 120.0


def test_a_probe_is_wet_once_water_reaches_it_and_stays_wet() -> None:
    plant = hull()
    probe = LeakProbe(wets_at_l=0.05).simulated(plant, "leak", np.random.default_rng(1))
    course = []
    for water_l in (0.0, 0.049, 0.05, 0.2, 0.0):
        plant.held["leak"] = Leak(water_l, 0.0)
        course.append(probe.read().is_wet)
    assert course == [False, False, True, True, True]


def test_a_probe_that_is_wet_without_water_is_refused() -> None:
    with pytest.raises(ParameterError, match="more than 0"):
        LeakProbe(wets_at_l=0.0)
