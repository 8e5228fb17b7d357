"""A sensor that returns a recorded sensor's readings."""

import msgspec
import pytest

from snr_sim import Page
from snr_sim.devices.device_loop import start_device
from snr_sim.devices.replayed import ReplayedSensor
from snr_sim.prelude.device import Sensor, Stale
from snr_sim.prelude.errors import DeviceError, SensorLostError


class Depth(msgspec.Struct, frozen=True):
    depth_m: float
    stamp_s: float


def page(time_s: float, depth_m: object) -> Page:
    return Page("depth", {"depth_m": depth_m, "stamp_s": time_s}, "urov_node", time_s)


class Clock:
    time_s = 0.0

    def now_s(self) -> float:
        return self.time_s


def sensor(*pages: Page) -> tuple[ReplayedSensor, Clock]:
    clock = Clock()
    opened = start_device(ReplayedSensor("depth", pages, Depth, clock.now_s), "the outputs")
    return opened, clock


def test_replayed_sensor_returns_readings_at_recorded_times() -> None:
    replayed, clock = sensor(page(0.0, 1.0), page(0.05, 1.1), page(0.1, 1.2))
    assert isinstance(replayed, Sensor)
    got = []
    for i in range(3):
        clock.time_s = i * 0.05 - 1e-9  # rounding error
        got.append(replayed.read())
    assert got == [Depth(1.0, 0.0), Depth(1.1, 0.05), Depth(1.2, 0.1)]


def test_replayed_sensor_read_less_often_returns_newest() -> None:
    replayed, clock = sensor(page(0.0, 1.0), page(0.05, 1.1), page(0.1, 1.2))
    clock.time_s = 0.1
    assert replayed.read() == Depth(1.2, 0.1)


def test_replayed_sensor_without_recorded_page_is_stale() -> None:
    replayed, clock = sensor(page(0.1, 1.0), page(0.4, 1.1))
    first = replayed.read()
    assert isinstance(first, Stale)
    assert (first.since_s, first.reason) == (None, "in the recording it had none until 0.1 s.")
    clock.time_s = 0.1
    assert replayed.read() == Depth(1.0, 0.1)
    clock.time_s = 0.2
    assert replayed.read() == Stale("in the recording it had none until 0.4 s.", 0.1)
    clock.time_s = 9.0
    assert replayed.read() == Depth(1.1, 0.4)
    assert replayed.read() == Stale("the recording of it ended at 0.4 s.", 0.4)


def test_replayed_sensor_invalid_page_or_closed_raises() -> None:
    replayed, _ = sensor(page(0.0, "deep"))
    with pytest.raises(DeviceError, match=r"The recorded sensor 'depth': the page of 0 s holds no Depth"):
        replayed.read()
    replayed.close()
    with pytest.raises(SensorLostError, match="closed"):
        replayed.read()
