"""A plant at the pace of a clock: each call sees the present state, and two calls never overlap."""

import threading

import pytest

from snr_sim.plants.realtime import RealTimePlant
from snr_sim.prelude.signals import EngineCommand, LeakReading
from snr_sim.testing.fakes import FakePlant


class HandClock:
    """Shows what it is set to."""

    time_s = 0.0

    def now_s(self) -> float:
        return self.time_s

    def sleep_until(self, time_s: float) -> None:
        raise AssertionError("nobody sleeps")


def paced(step_s: float | None = None) -> tuple[FakePlant, RealTimePlant, HandClock]:
    plant, clock = FakePlant({"leak": LeakReading(False, 0.0)}, ("engine",)), HandClock()
    plant.step_s = step_s
    return plant, RealTimePlant(plant, clock), clock


def test_who_reads_reads_what_is_now() -> None:
    _, real, clock = paced()
    for time_s in (0.5, 0.5, 2.0):
        clock.time_s = time_s
        assert real.read("leak").stamp_s == time_s
        assert real.time_s == time_s


def test_a_command_acts_from_now_on_and_not_from_the_last_reading_on() -> None:
    plant, real, clock = paced()
    clock.time_s = 3.0
    real.write("engine", EngineCommand())
    assert plant.time_s == 3.0
    assert plant.written == [("engine", EngineCommand())]


def test_a_plant_with_a_fixed_step_comes_to_the_last_whole_one() -> None:
    plant, real, clock = paced(step_s=0.25)
    clock.time_s = 1.1
    assert real.read("leak").stamp_s == plant.time_s == 1.0


def test_it_begins_with_the_clock_that_it_follows_at_last() -> None:
    _, real, clock = paced()
    clock.time_s = 100.0
    late = HandClock()
    real.follow(late)
    assert real.read("leak").stamp_s == 0.0


@pytest.mark.slow
def test_two_threads_never_step_it_at_once() -> None:
    plant, real, clock = paced()
    inside, most = [0], [0]
    step = plant.step

    def slow(dt_s: float) -> None:
        inside[0] += 1
        most[0] = max(most[0], inside[0])
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
    assert most == [1]
