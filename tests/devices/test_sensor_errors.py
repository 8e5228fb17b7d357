"""Errors of sensors: their sizes against statistics, closed forms and each other."""

import math

import msgspec
import numpy as np
import pytest

from snr_sim.devices.readings import BiasDrift, SensorErrorModel, SensorErrors
from snr_sim.prelude.errors import ParameterError


class Reading(msgspec.Struct, frozen=True):
    depth_m: float
    rate: list[float]
    stamp_s: float


def readings_with_errors(errors: SensorErrors, count: int, period_s: float = 0.1, seed: int = 1) -> list[Reading]:
    error_model = SensorErrorModel(Reading(0.0, [0.0, 0.0], 0.0), errors, np.random.default_rng(seed), "test")
    return [error_model.apply(Reading(5.0, [1.0, -1.0], k * period_s)) for k in range(count)]


def test_bias_is_constant_in_run_and_differs_per_run_and_number() -> None:
    errors = SensorErrors(drift={"depth_m": BiasDrift(0.5), "rate": BiasDrift(0.2)})
    runs = [readings_with_errors(errors, 20, seed=seed) for seed in range(400)]
    for run in runs:
        assert len({reading.depth_m for reading in run}) == 1
        assert len({tuple(reading.rate) for reading in run}) == 1
    assert np.std([run[0].depth_m for run in runs]) == pytest.approx(0.5, rel=0.1)
    rates = np.array([run[0].rate for run in runs])
    assert np.mean(rates, axis=0) == pytest.approx([1.0, -1.0], abs=0.04)
    assert np.std(rates, axis=0) == pytest.approx([0.2, 0.2], rel=0.1)
    assert abs(np.corrcoef(rates, rowvar=False)[0, 1]) < 0.15


@pytest.mark.parametrize("period_s", [0.05, 0.5])
def test_drift_keeps_sigma_and_correlation_time(period_s: float) -> None:
    """The autocorrelation of a Gauss-Markov process is exp(-lag / time), at any rate of reading."""
    count = 60_000
    course = np.array(
        [
            reading.depth_m
            for reading in readings_with_errors(SensorErrors(drift={"depth_m": BiasDrift(0.3, 2.0)}), count, period_s)
        ]
    )
    course -= 5.0
    assert np.std(course) == pytest.approx(0.3, rel=0.08)
    lag = round(1.0 / period_s)
    assert np.mean(course[:-lag] * course[lag:]) / np.var(course) == pytest.approx(math.exp(-0.5), abs=0.06)


def test_repeated_reading_has_same_drift() -> None:
    first, second = readings_with_errors(SensorErrors(drift={"depth_m": BiasDrift(0.3, 2.0)}), 2, period_s=0.0)
    assert first == second


def test_limits_apply_after_noise_and_steps_after_limits() -> None:
    errors = SensorErrors(noise={"rate": 10.0}, limits={"rate": (-2.0, 2.0)}, resolution={"rate": 0.4})
    values = {round(value, 9) for reading in readings_with_errors(errors, 300) for value in reading.rate}
    assert (min(values), max(values)) == (-2.0, 2.0)
    assert all(round(value / 0.4, 6).is_integer() for value in values)
    assert readings_with_errors(SensorErrors(limits={"depth_m": (0.0, 4.0)}), 1)[0].depth_m == 4.0


def test_errors_of_one_field_keep_other_fields() -> None:
    reading = readings_with_errors(SensorErrors(noise={"depth_m": 1.0}, drift={"depth_m": BiasDrift(1.0, 1.0)}), 3)[2]
    assert (reading.rate, reading.stamp_s) == ([1.0, -1.0], 0.2)


@pytest.mark.parametrize(
    ("numbers", "what"),
    [
        ({"noise": {"depth_m": -1.0}}, "noise of depth_m"),
        ({"noise": {"depth_m": math.nan}}, "noise of depth_m"),
        ({"resolution": {"depth_m": -0.1}}, "resolution of depth_m"),
        ({"delay_s": -0.1}, "delay_s"),
        ({"period_s": math.inf}, "period_s"),
        ({"drift": {"rate": BiasDrift(-1.0)}}, "drift of rate"),
        ({"drift": {"rate": BiasDrift(1.0, 0.0)}}, "drift of rate"),
        ({"limits": {"rate": (1.0, -1.0)}}, r"limits of rate are \(1"),
    ],
)
def test_sensor_errors_invalid_number_raises_with_name(numbers: dict[str, object], what: str) -> None:
    with pytest.raises(ParameterError, match=what):
        SensorErrors(**numbers)  # type: ignore[arg-type]


@pytest.mark.parametrize("part", ["noise", "resolution", "drift", "limits"])
def test_sensor_errors_unknown_field_raises_with_name(part: str) -> None:
    value = {"noise": 1.0, "resolution": 1.0, "drift": BiasDrift(1.0), "limits": (0.0, 1.0)}[part]
    errors = SensorErrors(**{part: {"dept_m": value}})  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match=r"no field 'dept_m'[\s\S]*did you mean 'depth_m'"):
        SensorErrorModel(Reading(0.0, [], 0.0), errors, np.random.default_rng(1), "depth")
