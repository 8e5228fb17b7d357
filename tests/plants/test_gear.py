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
