import math

import numpy as np
import pytest

from snr_sim.devices.imu import InertialUnit
from snr_sim.devices.sensor_errors import SensorErrors, Wander
from snr_sim.plants.urov_outputs import Imu
from snr_sim.prelude.angles import quaternion_of, wrap_rad
from snr_sim.prelude.signals import ImuReading
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.fakes import FakePlant


def still(roll: float = 0.1, pitch: float = -0.2, yaw: float = 2.0) -> FakePlant:
    motion = Imu([0.01, -0.02, 0.03], [0.1, 0.2, 9.8], list(quaternion_of(roll, pitch, yaw)), [5.0, 20.0, -40.0], 0.0)
    return FakePlant({"imu": motion})


def readings(plant: FakePlant, count: int, part: InertialUnit | None = None, seed: int = 1) -> list[ImuReading]:
    sensor = (part or InertialUnit()).simulated(plant, "imu", np.random.default_rng(seed))
    told = []
    for _ in range(count):
        told.append(sensor.read())
        plant.step(0.01)
    return told


def test_it_keeps_the_promise_of_sensors() -> None:
    check_sensor(lambda: InertialUnit().simulated(still(), "imu", np.random.default_rng(1)))


def test_without_errors_it_tells_the_truth_and_the_angles_of_the_attitude() -> None:
    (reading,) = readings(still(), 1, InertialUnit(SensorErrors()))
    assert (reading.rate_radps, reading.specific_force_mps2) == ([0.01, -0.02, 0.03], [0.1, 0.2, 9.8])
    assert reading.field_ut == [5.0, 20.0, -40.0]
    assert (reading.roll_rad, reading.pitch_rad, reading.yaw_rad) == pytest.approx((0.1, -0.2, 2.0))


def test_noise_from_reading_to_reading_is_that_of_the_part() -> None:
    told = readings(still(), 4000)
    rates = np.array([reading.rate_radps for reading in told])
    quarter_step = math.radians(1.0 / 16.0) / math.sqrt(12.0)
    jitter = np.std(np.diff(rates, axis=0), axis=0) / math.sqrt(2.0)
    assert jitter == pytest.approx([math.hypot(math.radians(0.12), quarter_step)] * 3, rel=0.1)
    forces = np.array([reading.specific_force_mps2 for reading in told])
    assert np.std(forces, axis=0) == pytest.approx([math.hypot(0.015, 0.01 / math.sqrt(12.0))] * 3, rel=0.1)


def test_heading_is_within_its_two_and_a_half_degrees_19_times_of_20() -> None:
    off = [math.degrees(readings(still(), 1, seed=seed)[0].yaw_rad - 2.0) for seed in range(400)]
    assert np.mean(np.abs(off) < 2.5) == pytest.approx(0.954, abs=0.03)


def test_yaw_and_roll_stay_within_half_a_turn_when_errors_carry_them_over() -> None:
    part = InertialUnit(SensorErrors(wander={"yaw_rad": Wander(0.2, 0.05), "roll_rad": Wander(0.2, 0.05)}))
    told = readings(still(roll=3.13, pitch=0.0, yaw=3.13), 200, part)
    for angles in ([reading.yaw_rad for reading in told], [reading.roll_rad for reading in told]):
        assert all(-math.pi < angle <= math.pi for angle in angles)
        assert min(angles) < -2.0, "some were carried over"
        assert np.std([wrap_rad(angle - 3.13) for angle in angles]) == pytest.approx(0.2, rel=0.3)


def test_what_is_too_quick_for_it_reads_as_its_limit() -> None:
    plant = FakePlant({"imu": Imu([99.0, 0.0, 0.0], [0.0, -500.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0] * 3, 0.0)})
    (reading,) = readings(plant, 1)
    assert reading.rate_radps[0] == pytest.approx(math.radians(2000.0), rel=1e-3)
    assert reading.specific_force_mps2[1] == pytest.approx(-39.2)


def test_readings_are_a_hundredth_of_a_second_old_and_no_more_than_a_hundred_a_second() -> None:
    plant = still()
    sensor = InertialUnit().simulated(plant, "imu", np.random.default_rng(1))
    ages, stamps = [], set()
    for _ in range(1000):
        reading = sensor.read()
        ages.append(plant.time_s - reading.stamp_s)
        stamps.add(reading.stamp_s)
        plant.step(0.002)
    assert len(stamps) == pytest.approx(200, abs=2)
    assert min(ages[10:]) > 0.009
    assert max(ages[10:]) < 0.021
