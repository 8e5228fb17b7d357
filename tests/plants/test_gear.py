import math

import numpy as np
import pytest

from snr_sim.plants.lander.gear import APOLLO_GEAR, Touchdown


def touchdown(vertical: float, lateral: float = 0.0, attitude: float = 0.0, rate: float = 0.0) -> Touchdown:
    return Touchdown(vertical_mps=vertical, lateral_mps=lateral, attitude_deg=attitude, rate_degps=rate)


@pytest.mark.parametrize(
    "good", [(3.05,), (2.13, 1.22), (2.13, -1.22), (2.59, 0.61), (0.5, 0.0, 6.0, 2.0), (0.5, 0.0, -6.0, -2.0)]
)
def test_touchdown_at_limit_is_landed(good: tuple[float, ...]) -> None:
    assert APOLLO_GEAR.exceeded_limits(touchdown(*good)) == []
    assert APOLLO_GEAR.outcome(touchdown(*good), 1.0) == "landed"


@pytest.mark.parametrize(
    "bad",
    [
        (3.06,),
        (2.14, 1.22),
        (2.60, -0.61),
        (0.0, 1.23),
        (1.0, 0.0, 6.1),
        (1.0, 0.0, 0.0, -2.1),
        (float("nan"),),
        (1.0, float("nan")),
    ],
)
def test_touchdown_beyond_limit_is_crashed(bad: tuple[float, ...]) -> None:
    assert APOLLO_GEAR.exceeded_limits(touchdown(*bad))
    assert APOLLO_GEAR.outcome(touchdown(*bad), 1.0) == "crashed"
    assert APOLLO_GEAR.outcome(touchdown(*bad), 0.0) == "out_of_fuel"


@pytest.mark.parametrize(
    ("bad", "messages"),
    [
        ((56.92,), ["vertical 56.920 m/s is over 3.05 m/s"]),
        ((2.60, -0.61), ["vertical 2.600 m/s is over 2.59 m/s (3.05 if it did not slide)"]),
        ((1.0, -1.5), ["lateral -1.500 m/s is over 1.22 m/s"]),
        (
            (2.5, 1.5),
            ["vertical 2.500 m/s is over 2.13 m/s (3.05 if it did not slide)", "lateral 1.500 m/s is over 1.22 m/s"],
        ),
        ((1.0, 0.0, -6.1, 2.1), ["attitude -6.100 deg is over 6 deg", "rate 2.100 deg/s is over 2 deg/s"]),
        ((3.05, 0.0, 6.0, 2.0), []),
    ],
)
def test_exceeded_limits_names_value_and_unit(bad: tuple[float, ...], messages: list[str]) -> None:
    assert APOLLO_GEAR.exceeded_limits(touchdown(*bad)) == messages


def test_outcome_tilted_beyond_twelve_degrees_at_rest() -> None:
    soft = touchdown(1.0)
    assert APOLLO_GEAR.outcome(soft, 1.0, math.radians(12.0)) == "landed"
    assert APOLLO_GEAR.outcome(soft, 1.0, math.radians(12.1)) == "tilted"
    assert APOLLO_GEAR.outcome(soft, 1.0, math.nan) == "tilted"
    assert APOLLO_GEAR.outcome(touchdown(9.0), 1.0, math.radians(33.0)) == "crashed"
    assert APOLLO_GEAR.exceeded_limits(soft, math.radians(33.0)) == ["attitude at rest 33.000 deg is over 12 deg"]


def test_is_within_batch_equals_single_landings() -> None:
    """One function for single landers and for arrays of them: also at the limits, and for NaN."""
    rng = np.random.default_rng(1)
    rows = np.array([3.05, 1.22, math.radians(6.0), math.radians(2.0), math.radians(12.0)])[:, None]
    numbers = rows * rng.uniform(-1.2, 1.2, (5, 500))
    numbers[:, :3] = rows * np.array([1.0, 0.0, math.nan])
    together = np.logical_and.reduce(APOLLO_GEAR.is_within(*numbers))
    assert 0 < together.sum() < 500
    for i, (vertical, lateral, attitude, rate, rest) in enumerate(numbers.T.tolist()):
        alone = touchdown(vertical, lateral, math.degrees(attitude), math.degrees(rate))
        assert (APOLLO_GEAR.outcome(alone, 1.0, rest) == "landed") == together[i]
