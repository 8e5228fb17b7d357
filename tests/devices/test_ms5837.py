import numpy as np
import pytest

from snr_sim.devices.ms5837 import SALT_KGM3, Ms5837, depth_m
from snr_sim.plants.urov_outputs import Depth
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.signals import DepthReading
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.fakes import FakePlant

AIR_PA = 101_325.0


def water(depth: float, density: float = 997.0) -> FakePlant:
    pressure = AIR_PA + density * 9.80665 * max(0.0, depth)
    return FakePlant({"depth": Depth(depth, 0.0, pressure, 12.347, 0.0)})


def readings(part: Ms5837, plant: FakePlant, count: int, seed: int = 1, period_s: float = 0.05) -> list[DepthReading]:
    sensor = part.simulated(plant, "depth", np.random.default_rng(seed))
    told = []
    for _ in range(count):
        told.append(sensor.read())
        plant.step(period_s)
    return told


def test_depth_follows_from_pressure_as_in_the_makers_library() -> None:
    """The data sheet's example of 3999.8 mbar, in fresh and in salt water."""
    assert depth_m(399_980.0) == pytest.approx(30.549, abs=0.001)
    assert depth_m(399_980.0, density_kgm3=SALT_KGM3) == pytest.approx(29.599, abs=0.001)
    assert depth_m(101_300.0) == 0.0


def test_it_keeps_the_promise_of_sensors() -> None:
    check_sensor(lambda: Ms5837().simulated(water(2.0), "depth", np.random.default_rng(1)))


def test_zeroed_it_tells_the_true_depth_but_for_noise_of_millimetres() -> None:
    depths = [reading.depth_m for reading in readings(Ms5837(), water(2.5), 3000)]
    assert np.mean(depths) == pytest.approx(2.5, abs=0.0005)
    step_m = 20.0 / (997.0 * 9.80665)
    assert step_m == pytest.approx(0.002046, abs=1e-5)  # 0.2 mbar are 2 mm of fresh water
    noise_m = np.hypot(30.0, 20.0 / np.sqrt(12.0)) / (997.0 * 9.80665)  # with that of rounding
    assert np.std(depths) == pytest.approx(noise_m, rel=0.05)
    levels = np.array(depths) / step_m
    assert np.ptp(levels - levels[0] - np.round(levels - levels[0])) < 1e-6


def test_pressure_and_temperature_come_in_the_steps_of_the_part() -> None:
    for reading in readings(Ms5837(), water(1.0), 20):
        assert reading.pressure_pa % 20.0 == pytest.approx(0.0, abs=1e-6)
        assert reading.temperature_c == pytest.approx(12.35)


def test_not_zeroed_it_is_off_by_as_much_as_new_ones_are_and_by_the_same_all_the_time() -> None:
    part = Ms5837(is_zeroed=False, noise_pa=0.0)
    offsets = [readings(part, water(3.0), 1, seed)[0].depth_m - 3.0 for seed in range(300)]
    assert np.std(offsets) == pytest.approx(5000.0 / (997.0 * 9.80665), rel=0.15)
    run = readings(part, water(3.0), 50)
    assert len({reading.depth_m for reading in run}) == 1


def test_who_takes_salt_water_for_fresh_reads_too_deep_by_the_ratio_of_densities() -> None:
    depths = [reading.depth_m for reading in readings(Ms5837(), water(3.0, density=1029.0), 500)]
    assert np.mean(depths) == pytest.approx(3.0 * 1029.0 / 997.0, abs=0.001)


def test_it_measures_no_more_than_27_times_a_second_however_often_it_is_asked() -> None:
    assert 1.0 / Ms5837().period_s == pytest.approx(27.7, abs=0.1)
    stamps = {reading.stamp_s for reading in readings(Ms5837(), water(1.0), 500, period_s=0.002)}
    assert len(stamps) <= 28


def test_less_oversampling_is_quicker() -> None:
    assert Ms5837(256).period_s == pytest.approx(Ms5837().period_s / 32.0)


def test_above_the_water_it_tells_the_surface() -> None:
    depths = [reading.depth_m for reading in readings(Ms5837(), water(-0.3), 500)]
    assert np.mean(depths) == pytest.approx(0.0, abs=0.001)


def test_an_oversampling_that_the_part_does_not_have_is_refused() -> None:
    with pytest.raises(ParameterError, match="one of 256, 512"):
        Ms5837(oversampling=1000)
