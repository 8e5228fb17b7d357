import math
from collections.abc import Sequence

import numpy as np
import pytest

from snr_sim.devices.readings import BiasDrift, SensorErrors
from snr_sim.devices.sensors.imu import InertialUnit
from snr_sim.plants.outputs import ImuOutput
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.instruments import FIELD_UT_PER_A
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.urov import Urov
from snr_sim.prelude.angles import quaternion_of, roll_pitch_yaw_rad, wrap_rad
from snr_sim.prelude.attitude_filter import GAIN_HZ, into_world
from snr_sim.prelude.signals import ImuReading, PwmCommand
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.fakes import FakePlant
from tests.plants.vehicles import HEAVY

EXACT = InertialUnit(SensorErrors(), angle_step_rad=0.0)
FIELD_UT = (0.0, 20.0, -44.0)


def at_rest(
    roll: float = 0.1, pitch: float = -0.2, yaw: float = 2.0, rate: Sequence[float] = (0.0,) * 3, iron_ut: float = 0.0
) -> ImuOutput:
    """Return the true values of a vehicle at rest or turning on the spot; `iron_ut` is added along its x axis."""
    w, x, y, z = quaternion_of(roll, pitch, yaw)
    field = into_world((w, -x, -y, -z), FIELD_UT)
    force = into_world((w, -x, -y, -z), (0.0, 0.0, 9.81))
    return ImuOutput(list(rate), list(force), [field[0] + iron_ut, *field[1:]], 0.0)


def still(roll: float = 0.1, pitch: float = -0.2, yaw: float = 2.0) -> FakePlant:
    return FakePlant({"imu": at_rest(roll, pitch, yaw)})


def readings(
    plant: FakePlant, count: int, part: InertialUnit | None = None, seed: int = 1, period_s: float = 0.01
) -> list[ImuReading]:
    sensor = (part or InertialUnit()).simulated(plant, "imu", np.random.default_rng(seed))
    results = []
    for _ in range(count):
        results.append(sensor.read())
        plant.step(period_s)
    return results


def test_imu_passes_sensor_contract() -> None:
    check_sensor(lambda: InertialUnit().simulated(still(), "imu", np.random.default_rng(1)))


def test_imu_without_errors_returns_truth_and_its_attitude() -> None:
    truth = at_rest(rate=(0.01, -0.02, 0.03))
    (reading,) = readings(FakePlant({"imu": truth}), 1, EXACT)
    assert (reading.rate_radps, reading.specific_force_mps2) == (truth.rate_radps, truth.specific_force_mps2)
    assert reading.field_ut == truth.field_ut
    assert (reading.roll_rad, reading.pitch_rad, reading.yaw_rad) == pytest.approx((0.1, -0.2, 2.0))


def test_imu_noise_equals_data_sheet() -> None:
    results = readings(still(), 4000)
    rates = np.array([reading.rate_radps for reading in results])
    quarter_step = math.radians(1.0 / 16.0) / math.sqrt(12.0)
    jitter = np.std(np.diff(rates, axis=0), axis=0) / math.sqrt(2.0)
    assert jitter == pytest.approx([math.hypot(math.radians(0.12), quarter_step)] * 3, rel=0.1)
    forces = np.array([reading.specific_force_mps2 for reading in results])
    assert np.std(forces, axis=0) == pytest.approx([math.hypot(0.015, 0.01 / math.sqrt(12.0))] * 3, rel=0.1)


def test_imu_heading_at_rest_is_within_2_5_degrees_in_95_percent() -> None:
    """After the filter has settled; and up to 0.6, two standard deviations of the accelerometer's bias."""
    last = [readings(still(0.0, 0.0, 2.0), 40, seed=seed, period_s=0.2)[-1] for seed in range(400)]
    headings, rolls = (np.degrees([getattr(one, name) for one in last]) for name in ("yaw_rad", "roll_rad"))
    assert np.mean(np.abs(headings - math.degrees(2.0)) < 2.5) == pytest.approx(0.954, abs=0.03)
    assert np.mean(np.abs(rolls) < 0.6) == pytest.approx(0.954, abs=0.03)


def test_imu_angles_are_sixteenths_of_a_degree() -> None:
    for reading in readings(still(), 20):
        for angle in (reading.roll_rad, reading.pitch_rad, reading.yaw_rad):
            assert math.degrees(angle) * 16.0 == pytest.approx(round(math.degrees(angle) * 16.0), abs=1e-6)


def test_imu_heading_follows_gyroscope_between_field_updates() -> None:
    """A rate of 0 with a bias, in a constant field: y' = w - k y."""
    plant = FakePlant({"imu": at_rest(0.0, 0.0, 0.0, rate=(0.0, 0.0, 0.2))})
    for i, reading in enumerate(readings(plant, 101, EXACT)):
        closed = 0.2 / GAIN_HZ * -math.expm1(-GAIN_HZ * 0.01 * i)
        assert reading.yaw_rad == pytest.approx(closed, abs=0.003), "but for the bias that it begins to take it for"


def test_imu_quick_turn_at_50_hz_has_error_below_tenth_of_degree() -> None:
    """Half a turn there and back, at up to 45 degrees a second."""
    plant = still()
    sensor, worst_deg = EXACT.simulated(plant, "imu", np.random.default_rng(1)), 0.0
    for i in range(400):
        t = 0.02 * i
        yaw, rate = 1.0 - math.cos(0.785 * t), 0.785 * math.sin(0.785 * t)
        plant.held["imu"] = at_rest(0.0, 0.0, yaw, rate=(0.0, 0.0, rate))
        worst_deg = max(worst_deg, abs(math.degrees(wrap_rad(sensor.read().yaw_rad - yaw))))
        plant.step(0.02)
    assert worst_deg < 0.1


def test_imu_iron_shifts_heading_by_angle_of_level_field() -> None:
    plant = still(0.0, 0.0, 0.0)
    sensor = EXACT.simulated(plant, "imu", np.random.default_rng(1))
    sensor.read()
    plant.held["imu"] = at_rest(0.0, 0.0, 0.0, iron_ut=2.0)
    results = []
    for _ in range(6000):
        plant.step(0.02)
        results.append(sensor.read().yaw_rad)
    assert results[0] < 0.01, "not at once"
    assert results[100] > 0.5 * math.atan2(2.0, 20.0), "half of it in two seconds"
    assert results[-1] == pytest.approx(math.atan2(2.0, 20.0), abs=0.001)


def test_imu_thruster_current_disturbs_heading() -> None:
    """Of the vehicle as it rises, all four vertical thrusters at 1800 us: level field plus that of the current."""
    dive = Dive((0.0, 0.0, -40.0))
    plant = Urov(HEAVY, Pool(100.0, 100.0, 50.0), lambda seed: dive, Propulsion(8))
    plant.write("pwm", PwmCommand())
    sensor, off_deg = EXACT.simulated(plant, "imu", np.random.default_rng(1)), []
    for i in range(1200):  # for 24 s
        if i == 100:
            plant.write("pwm", PwmCommand([1500.0] * 4 + [1800.0] * 4))
        for _ in range(4):
            plant.step(plant.step_s)
        off_deg.append(math.degrees(sensor.read().yaw_rad - roll_pitch_yaw_rad(plant.attitude)[2]))
    current_a = plant.thrusters.current_a
    assert current_a > 20.0
    east_ut, north_ut = FIELD_UT_PER_A[0] * current_a, FIELD_UT[1] + FIELD_UT_PER_A[1] * current_a
    assert max(map(abs, off_deg[:99])) < 0.1
    assert off_deg[-1] == pytest.approx(math.degrees(math.atan2(east_ut, north_ut)), rel=0.2)
    assert off_deg[-1] > 1.0, (current_a, off_deg[-1])


def test_imu_angles_with_errors_stay_within_half_turn() -> None:
    part = InertialUnit(SensorErrors(drift={"field_ut": BiasDrift(2.0), "specific_force_mps2": BiasDrift(1.0)}))
    results = [readings(still(roll=3.13, pitch=0.0, yaw=3.13), 1, part, seed)[0] for seed in range(200)]
    for angles in ([reading.yaw_rad for reading in results], [reading.roll_rad for reading in results]):
        assert all(-math.pi < angle <= math.pi for angle in angles)
        assert min(angles) < -2.0, "some were carried over"
        assert np.std([wrap_rad(angle - 3.13) for angle in angles]) > 0.05


def test_imu_out_of_range_motion_returns_limit() -> None:
    plant = FakePlant({"imu": ImuOutput([99.0, 0.0, 0.0], [0.0, -500.0, 0.0], [0.0] * 3, 0.0)})
    (reading,) = readings(plant, 1)
    assert reading.rate_radps[0] == pytest.approx(math.radians(2000.0), rel=1e-3)
    assert reading.specific_force_mps2[1] == pytest.approx(-39.2)


def test_imu_readings_have_10_ms_delay_and_100_hz_rate() -> None:
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
