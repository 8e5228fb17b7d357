import math

import numpy as np
import pytest

from snr_sim.devices.sensors.echo_sounder import EchoSounder
from snr_sim.plants.urov.instruments import AltitudeOutput
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.signals import EchoReading
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.fakes import FakePlant


def readings(altitude_m: float, tilt_deg: float = 0.0, count: int = 1) -> list[EchoReading]:
    plant = FakePlant({"altitude": AltitudeOutput(altitude_m, math.radians(tilt_deg), 0.0)})
    sensor = EchoSounder().simulated(plant, "altitude", np.random.default_rng(1))
    results = []
    for _ in range(count):
        results.append(sensor.read())
        plant.step(0.1)
    return results


def test_echo_sounder_passes_sensor_contract() -> None:
    plant = FakePlant({"altitude": AltitudeOutput(2.0, 0.1, 0.0)})
    check_sensor(lambda: EchoSounder().simulated(plant, "altitude", np.random.default_rng(1)))


def test_echo_sounder_level_returns_height_in_whole_millimetres() -> None:
    results = readings(3.21, count=2000)
    distances = [reading.distance_m for reading in results]
    assert np.mean(distances) == pytest.approx(3.21, abs=0.001)
    assert np.std(distances) == pytest.approx(0.01, rel=0.06)
    assert all(round(1000.0 * distance, 6).is_integer() for distance in distances)
    assert {reading.confidence for reading in results} == {1.0}


@pytest.mark.parametrize("tilt_deg", [0.0, 5.0, 12.4])
def test_echo_sounder_tilt_within_cone_keeps_reading(tilt_deg: float) -> None:
    assert EchoSounder().range_and_confidence(4.0, math.radians(tilt_deg)) == (4.0, 1.0)


def test_echo_sounder_tilt_beyond_cone_returns_edge_and_lower_confidence() -> None:
    part = EchoSounder()
    distance, confidence = part.range_and_confidence(4.0, math.radians(42.5))  # the edge of the cone is at 30 deg
    assert distance == pytest.approx(4.0 / math.cos(math.radians(30.0)))
    assert 0.0 < confidence < 1.0
    tilts = [math.radians(tilt) for tilt in range(12, 91, 3)]
    confidences = [part.range_and_confidence(4.0, tilt)[1] for tilt in tilts]
    assert confidences == sorted(confidences, reverse=True)
    assert confidences[-1] == 0.0


@pytest.mark.parametrize(("altitude_m", "tilt_deg"), [(0.29, 0.0), (101.0, 0.0), (2.0, 61.0), (2.0, 170.0)])
def test_echo_sounder_out_of_range_or_tilt_returns_zero(altitude_m: float, tilt_deg: float) -> None:
    for reading in readings(altitude_m, tilt_deg, count=5):
        assert (reading.distance_m, reading.confidence) == (0.0, 0.0)


@pytest.mark.parametrize(
    "numbers",
    [{"min_range_m": -1.0}, {"max_range_m": 0.1}, {"cone_rad": 0.0}, {"max_tilt_rad": 0.1}, {"max_tilt_rad": 2.0}],
)
def test_echo_sounder_invalid_number_raises_error(numbers: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match="Echo sounder"):
        EchoSounder(**numbers)
