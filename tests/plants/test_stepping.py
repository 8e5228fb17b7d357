"""A plant at the pace of a clock: each call sees the present state, and two calls never overlap."""

import threading

import pytest

from snr_sim.plants.stepping import RealTimePlant
from snr_sim.prelude.signals import EngineCommand, LeakReading
from snr_sim.testing.fakes import FakePlant


class HandClock:
    """Shows what it is set to."""

    time_s = 0.0

    def now_s(self) -> float:
        return self.time_s

    def sleep_until(self, time_s: float) -> None:
        raise AssertionError("no sleep is expected")


def paced(step_s: float | None = None) -> tuple[FakePlant, RealTimePlant, HandClock]:
    plant, clock = FakePlant({"leak": LeakReading(False, 0.0)}, ("engine",)), HandClock()
    plant.step_s = step_s
    return plant, RealTimePlant(plant, clock), clock


def test_read_advances_plant_to_present() -> None:
    _, real, clock = paced()
    for time_s in (0.5, 0.5, 2.0):
        clock.time_s = time_s
        assert real.read("leak").stamp_s == time_s
        assert real.time_s == time_s


def test_command_acts_from_present() -> None:
    plant, real, clock = paced()
    clock.time_s = 3.0
    real.write("engine", EngineCommand())
    assert plant.time_s == 3.0
    assert plant.written == [("engine", EngineCommand())]


def test_fixed_step_plant_advances_to_last_whole_step() -> None:
    plant, real, clock = paced(step_s=0.25)
    clock.time_s = 1.1
    assert real.read("leak").stamp_s == plant.time_s == 1.0


def test_follow_replaces_clock() -> None:
    _, real, clock = paced()
    clock.time_s = 100.0
    late = HandClock()
    real.follow(late)
    assert real.read("leak").stamp_s == 0.0


@pytest.mark.slow
def test_concurrent_reads_step_one_at_a_time() -> None:
    plant, real, clock = paced()
    inside, max_inside = [0], [0]
    step = plant.step

    def slow(dt_s: float) -> None:
        inside[0] += 1
        max_inside[0] = max(max_inside[0], inside[0])
        step(dt_s)
        inside[0] -= 1

    plant.step = slow  # type: ignore[method-assign]

    def ask() -> None:
        for _ in range(300):
            clock.time_s += 0.001
            real.read("leak")

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert max_inside == [1]
