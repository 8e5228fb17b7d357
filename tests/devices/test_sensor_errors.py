"""Errors of sensors: their sizes against statistics, closed forms and each other."""

import math

import msgspec
import numpy as np
import pytest

from snr_sim.devices.sensors.sensor_errors import SensorErrors, Spoiler, Wander
from snr_sim.prelude.errors import ParameterError


class Reading(msgspec.Struct, frozen=True):
    depth_m: float
    rate: list[float]
    stamp_s: float


def spoiled(errors: SensorErrors, count: int, period_s: float = 0.1, seed: int = 1) -> list[Reading]:
    spoiler = Spoiler(Reading(0.0, [0.0, 0.0], 0.0), errors, np.random.default_rng(seed), "test")
    return [spoiler.spoil(Reading(5.0, [1.0, -1.0], k * period_s)) for k in range(count)]


def test_a_bias_stays_for_the_run_and_is_another_in_every_run_and_of_every_number() -> None:
    errors = SensorErrors(wander={"depth_m": Wander(0.5), "rate": Wander(0.2)})
    runs = [spoiled(errors, 20, seed=seed) for seed in range(400)]
    for run in runs:
        assert len({reading.depth_m for reading in run}) == 1
        assert len({tuple(reading.rate) for reading in run}) == 1
    assert np.std([run[0].depth_m for run in runs]) == pytest.approx(0.5, rel=0.1)
    rates = np.array([run[0].rate for run in runs])
    assert np.mean(rates, axis=0) == pytest.approx([1.0, -1.0], abs=0.04)
    assert np.std(rates, axis=0) == pytest.approx([0.2, 0.2], rel=0.1)
    assert abs(np.corrcoef(rates, rowvar=False)[0, 1]) < 0.15


@pytest.mark.parametrize("period_s", [0.05, 0.5])
def test_a_wander_keeps_its_size_and_forgets_itself_at_its_own_time(period_s: float) -> None:
    """The autocorrelation of a Gauss-Markov process is exp(-lag / time), at any rate of reading."""
    count = 60_000
    course = np.array(
        [reading.depth_m for reading in spoiled(SensorErrors(wander={"depth_m": Wander(0.3, 2.0)}), count, period_s)]
    )
    course -= 5.0
    assert np.std(course) == pytest.approx(0.3, rel=0.08)
    lag = round(1.0 / period_s)
    assert np.mean(course[:-lag] * course[lag:]) / np.var(course) == pytest.approx(math.exp(-0.5), abs=0.06)


def test_a_reading_that_is_told_again_has_the_same_wander() -> None:
    first, second = spoiled(SensorErrors(wander={"depth_m": Wander(0.3, 2.0)}), 2, period_s=0.0)
    assert first == second


def test_limits_come_after_the_noise_and_steps_after_the_limits() -> None:
    errors = SensorErrors(noise={"rate": 10.0}, limits={"rate": (-2.0, 2.0)}, resolution={"rate": 0.4})
    values = {round(value, 9) for reading in spoiled(errors, 300) for value in reading.rate}
    assert (min(values), max(values)) == (-2.0, 2.0)
    assert all(round(value / 0.4, 6).is_integer() for value in values)
    assert spoiled(SensorErrors(limits={"depth_m": (0.0, 4.0)}), 1)[0].depth_m == 4.0


def test_errors_of_one_field_leave_the_others_alone() -> None:
    reading = spoiled(SensorErrors(noise={"depth_m": 1.0}, wander={"depth_m": Wander(1.0, 1.0)}), 3)[2]
    assert (reading.rate, reading.stamp_s) == ([1.0, -1.0], 0.2)


@pytest.mark.parametrize(
    ("numbers", "what"),
    [
        ({"noise": {"depth_m": -1.0}}, "noise of depth_m"),
        ({"noise": {"depth_m": math.nan}}, "noise of depth_m"),
        ({"resolution": {"depth_m": -0.1}}, "resolution of depth_m"),
        ({"delay_s": -0.1}, "delay_s"),
        ({"period_s": math.inf}, "period_s"),
        ({"wander": {"rate": Wander(-1.0)}}, "wander of rate"),
        ({"wander": {"rate": Wander(1.0, 0.0)}}, "wander of rate"),
        ({"limits": {"rate": (1.0, -1.0)}}, "rate from 1"),
    ],
)
def test_numbers_that_make_no_sense_are_refused_by_name(numbers: dict[str, object], what: str) -> None:
    with pytest.raises(ParameterError, match=what):
        SensorErrors(**numbers)  # type: ignore[arg-type]


@pytest.mark.parametrize("part", ["noise", "resolution", "wander", "limits"])
def test_a_field_that_readings_do_not_have_is_named_whatever_its_error(part: str) -> None:
    value = {"noise": 1.0, "resolution": 1.0, "wander": Wander(1.0), "limits": (0.0, 1.0)}[part]
    errors = SensorErrors(**{part: {"dept_m": value}})  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match=r"no field 'dept_m'[\s\S]*did you mean 'depth_m'"):
        Spoiler(Reading(0.0, [], 0.0), errors, np.random.default_rng(1), "depth")
