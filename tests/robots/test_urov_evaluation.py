"""Remarks on a dive that missed its criterion, in addition to the amount."""

import tracemalloc

import pytest

from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.prelude.signals import PwmCommand
from snr_sim.scenario import library

library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov.evaluation import Course, Sample, TrackedUrov, hold_verdict  # noqa: E402
from snr_sim_robot_urov.parameters import vehicle  # noqa: E402


@pytest.mark.parametrize(
    ("pulse_us", "time_s", "reason"),
    [
        (None, 2.0, "too deep; no speed controller is armed: each must be sent 1500 us for a second first"),
        (1700.0, 0.5, "too deep; no speed controller is armed: each must be sent 1500 us for a second first"),
        (1700.0, 2.0, "too deep; speed controllers were first sent 1700 us and took that for stop: begin with 1500 us"),
        (1500.0, 2.0, "too deep"),
    ],
)
def test_failed_dive_reports_unarmed_speed_controllers(pulse_us: float | None, time_s: float, reason: str) -> None:
    plant = TrackedUrov(vehicle(), Pool(), lambda seed: Dive(), Propulsion(8), 0)
    plant.write("pwm", PwmCommand([pulse_us] * 8) if pulse_us is not None else PwmCommand(is_on=False))
    while plant.time_s < time_s:
        plant.step(plant.step_s)
    verdict = hold_verdict(plant, ["too deep"])
    assert (verdict.success, verdict.reason) == (False, reason)
    assert hold_verdict(plant, []).success


def sample_at(time_s: float) -> Sample:
    return Sample(time_s, (0.1 + time_s, 0.2, -time_s), 0.3, 0.4, 0.5, 0.6)


def test_course_returns_stored_samples() -> None:
    samples = [sample_at(0.1 * i) for i in range(50)]
    course = Course(samples)
    assert (list(course), len(course), course[-1], course[1:4]) == (samples, 50, samples[-1], samples[1:4])
    with pytest.raises(IndexError):
        course[50]
    assert not Course()


def test_course_of_one_hour_needs_less_than_3_megabytes() -> None:
    """Nothing else of the vehicle's role grows with time: it was 13 MB."""
    tracemalloc.start()
    try:
        course = Course()
        for i in range(36_000):
            course.append(sample_at(0.1 * i))
        assert tracemalloc.get_traced_memory()[0] < 3_000_000
    finally:
        tracemalloc.stop()
