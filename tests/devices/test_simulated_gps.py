"""A simulated satellite receiver: where it says it is, and how its errors wander."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from snr_sim.devices.readings import SensorErrors, SimSensor
from snr_sim.devices.sensors.simulated_gps import GpsReceiver
from snr_sim.plants.outputs import PoseOutput
from snr_sim.prelude.signals import GpsReading
from snr_sim.testing.contracts import check_sensor

EXACT = GpsReceiver(errors=SensorErrors())


class Walker:
    """A plant that moves evenly from the origin."""

    def __init__(self, velocity_mps: tuple[float, float] = (0.0, 0.0)) -> None:
        self.velocity_mps = velocity_mps
        self.time_s = 0.0

    def read(self, name: str) -> PoseOutput:
        east, north = (one * self.time_s for one in self.velocity_mps)
        return PoseOutput([east, north, 2.0], [1.0, 0.0, 0.0, 0.0], self.time_s)


def opened(plant: Any, part: GpsReceiver, seed: int = 0) -> SimSensor:
    return part.simulated(plant, "pose", np.random.default_rng(seed))


def fix(plant: Walker, sensor: SimSensor, at_s: float) -> GpsReading:
    plant.time_s = at_s
    reading: GpsReading = sensor.read()
    return reading


def test_receiver_implements_sensor() -> None:
    check_sensor(lambda: opened(Walker(), GpsReceiver()))


def test_fix_without_errors_is_the_place_on_the_plane() -> None:
    plant = Walker((1.0, -0.5))
    sensor = opened(plant, EXACT)
    fix(plant, sensor, 0.0)
    reading = fix(plant, sensor, 10.0)
    assert reading.altitude_m is not None
    place = EXACT.plane().local(reading.latitude_deg, reading.longitude_deg, reading.altitude_m)
    assert place == pytest.approx((10.0, -5.0, 2.0), abs=1e-6)
    assert (reading.speed_mps, reading.course_rad) == pytest.approx((math.hypot(1.0, 0.5), math.atan2(-0.5, 1.0)))
    assert reading.stamp_s == 10.0


def test_velocity_of_the_first_fix_is_zero() -> None:
    plant = Walker((1.0, 0.0))
    assert opened(plant, EXACT).read().speed_mps == 0.0


def test_errors_have_the_size_of_the_logs_and_last_for_a_minute() -> None:
    part = replace(GpsReceiver(), errors=replace(GpsReceiver().errors, period_s=0.0))
    plane, plant, off = part.plane(), Walker(), []
    for seed in range(300):
        sensor = opened(plant, part, seed)
        fixes = [fix(plant, sensor, at_s) for at_s in (0.0, 60.0)]
        off.append([plane.local(one.latitude_deg, one.longitude_deg)[:2] for one in fixes])
    errors = np.array(off)  # by seed, time and axis
    assert errors[:, 0].std(axis=0) == pytest.approx([1.48, 1.85], rel=0.12)
    kept = (errors[:, 0] * errors[:, 1]).mean(axis=0) / (errors[:, 0] ** 2).mean(axis=0)
    assert kept == pytest.approx([math.exp(-1.0)] * 2, abs=0.15)
