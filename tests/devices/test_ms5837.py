from dataclasses import replace

import numpy as np
import pytest

from snr_sim.devices.sensors.ms5837 import Ms5837, depth_m
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.instruments import DepthOutput
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.urov import Urov
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.signals import DepthReading
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.fakes import FakePlant
from tests.plants.vehicles import HEAVY

AIR_PA = 101_325.0


# Resolution RMS of the data sheet [mbar], by oversampling.
DATA_SHEET_MBAR = {8192: 0.20, 4096: 0.28, 2048: 0.38, 1024: 0.54, 512: 0.84, 256: 1.57}


def water(depth: float, density: float = 1000.0) -> FakePlant:
    pressure = AIR_PA + density * 9.81 * max(0.0, depth)
    return FakePlant({"depth": DepthOutput(depth, 0.0, pressure, 12.347, 0.0)})


def readings(part: Ms5837, plant: FakePlant, count: int, seed: int = 1, period_s: float = 0.05) -> list[DepthReading]:
    sensor = part.simulated(plant, "depth", np.random.default_rng(seed))
    results = []
    for _ in range(count):
        results.append(sensor.read())
        plant.step(period_s)
    return results


def test_depth_m_equals_makers_library() -> None:
    """The data sheet's example of 3999.8 mbar, in fresh and in salt water."""
    for density_kgm3, depth in ((997.0, 30.549), (1029.0, 29.599)):
        assert depth_m(399_980.0, 101_300.0, density_kgm3, 9.80665) == pytest.approx(depth, abs=0.001)
    assert depth_m(101_325.0) == 0.0


def test_ms5837_passes_sensor_contract() -> None:
    check_sensor(lambda: Ms5837().simulated(water(2.0), "depth", np.random.default_rng(1)))


def test_ms5837_zeroed_returns_true_depth_with_millimetre_noise() -> None:
    depths = [reading.depth_m for reading in readings(Ms5837(), water(2.5), 3000)]
    assert np.mean(depths) == pytest.approx(2.5, abs=0.0005)
    step_m = 10.0 / (1000.0 * 9.81)  # a tenth of a millibar
    assert np.std(depths) == pytest.approx(0.00204, rel=0.05)  # 0.2 mbar are 2 mm of fresh water
    levels = np.array(depths) / step_m
    assert np.ptp(levels - levels[0] - np.round(levels - levels[0])) < 1e-6


def test_ms5837_pressure_and_temperature_have_resolution_of_part() -> None:
    for reading in readings(Ms5837(), water(1.0), 20):
        assert reading.pressure_pa % 10.0 == pytest.approx(0.0, abs=1e-6)
        assert reading.temperature_c == pytest.approx(12.35)


def test_ms5837_not_zeroed_has_constant_offset_of_new_sensor() -> None:
    part = Ms5837(is_zeroed=False, noise_pa=0.0)
    offsets = [readings(part, water(3.0), 1, seed)[0].depth_m - 3.0 for seed in range(300)]
    assert np.std(offsets) == pytest.approx(5000.0 / (1000.0 * 9.81), rel=0.15)
    run = readings(part, water(3.0), 50)
    assert len({reading.depth_m for reading in run}) == 1


def test_ms5837_wrong_density_scales_depth_by_density_ratio() -> None:
    sea = water(3.0, density=1026.0)
    depths = [reading.depth_m for reading in readings(Ms5837(), sea, 500)]
    assert np.mean(depths) == pytest.approx(3.0 * 1.026, abs=0.001)
    depths = [reading.depth_m for reading in readings(Ms5837(density_kgm3=1026.0), sea, 500)]
    assert np.mean(depths) == pytest.approx(3.0, abs=0.001)


def test_ms5837_in_pool_returns_true_depth() -> None:
    """By the plant's own pressure: pool and sensor have the same default density and gravity."""
    part = Ms5837(noise_pa=0.0)
    for pool, sensor in (
        (Pool(), part),
        (Pool(density_kgm3=1026.0, gravity_mps2=9.78), replace(part, density_kgm3=1026.0, gravity_mps2=9.78)),
    ):
        plant = Urov(HEAVY, pool, lambda seed: Dive((0.0, 0.0, -3.0)))
        reading = sensor.simulated(plant, "depth", np.random.default_rng(1)).read()
        assert reading.depth_m == pytest.approx(3.0, abs=0.0006), "but for half a step of a tenth of a millibar"


def test_ms5837_measures_at_most_27_times_per_second() -> None:
    assert 1.0 / Ms5837().period_s == pytest.approx(27.7, abs=0.1)
    stamps = {reading.stamp_s for reading in readings(Ms5837(), water(1.0), 500, period_s=0.002)}
    assert len(stamps) <= 28


@pytest.mark.parametrize("oversampling", DATA_SHEET_MBAR)
def test_ms5837_noise_equals_data_sheet_at_each_oversampling(oversampling: int) -> None:
    pressures = [reading.pressure_pa for reading in readings(Ms5837(oversampling), water(2.5), 3000)]
    assert np.std(pressures) == pytest.approx(100.0 * DATA_SHEET_MBAR[oversampling], rel=0.05)


def test_ms5837_less_oversampling_is_faster() -> None:
    assert Ms5837(256).period_s == pytest.approx(Ms5837().period_s / 32.0)


def test_ms5837_above_water_returns_zero_depth() -> None:
    depths = [reading.depth_m for reading in readings(Ms5837(), water(-0.3), 500)]
    assert np.mean(depths) == pytest.approx(0.0, abs=0.001)


def test_ms5837_unknown_oversampling_raises_error() -> None:
    with pytest.raises(ParameterError, match="one of 256, 512"):
        Ms5837(oversampling=1000)


@pytest.mark.parametrize("water", [{"density_kgm3": 0.0}, {"density_kgm3": float("nan")}, {"gravity_mps2": -9.81}])
def test_ms5837_invalid_water_raises_error_with_usual_values(water: dict[str, float]) -> None:
    with pytest.raises(
        ParameterError, match=f"MS5837 {next(iter(water))} must be positive and finite, not .*(.|\n)*1000 kg/m3"
    ):
        Ms5837(**water)
