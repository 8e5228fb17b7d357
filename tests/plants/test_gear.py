import pytest

from snr_sim.plants.gear import APOLLO_GEAR, Touchdown


def touchdown(vertical: float, lateral: float = 0.0, attitude: float = 0.0, rate: float = 0.0) -> Touchdown:
    return Touchdown(vertical_mps=vertical, lateral_mps=lateral, attitude_deg=attitude, rate_degps=rate)


@pytest.mark.parametrize(
    "good", [(3.05,), (2.13, 1.22), (2.13, -1.22), (2.59, 0.61), (0.5, 0.0, 6.0, 2.0), (0.5, 0.0, -6.0, -2.0)]
)
def test_the_gear_holds_up_to_its_limits(good: tuple[float, ...]) -> None:
    assert APOLLO_GEAR.holds(touchdown(*good))


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
def test_the_gear_breaks_beyond_them(bad: tuple[float, ...]) -> None:
    assert not APOLLO_GEAR.holds(touchdown(*bad))


@pytest.mark.parametrize(
    ("bad", "said"),
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
def test_each_limit_that_is_passed_is_named_with_number_and_unit(bad: tuple[float, ...], said: list[str]) -> None:
    assert APOLLO_GEAR.passed(touchdown(*bad)) == said
