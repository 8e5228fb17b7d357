import math
from typing import Any

import pytest

from snr_sim.plants.urov.tether import Tether, TetherPull
from snr_sim.prelude.errors import ParameterError

STILL = (0.0, 0.0, 0.0)
LINE = Tether((0.0, 0.0, 0.0), 20.0)


@pytest.mark.parametrize(("speed", "newtons"), [(0.1, 0.9), (0.3, 8.1), (0.5, 22.5)])
def test_cross_current_puts_half_of_drag_at_vehicle(speed: float, newtons: float) -> None:
    pull = TetherPull(LINE, 1000.0, 20.0).force((20.0, 0.0, 0.0), STILL, (0.0, speed, 0.0))
    assert pull == pytest.approx((0.0, 0.5 * newtons, 0.0))


def test_moving_vehicle_gets_quarter_of_drag() -> None:
    pull = TetherPull(LINE, 1000.0, 20.0).force((20.0, 0.0, 0.0), (0.0, 0.3, 0.0), STILL)
    assert pull == pytest.approx((0.0, -0.25 * 8.1, 0.0))


def test_axial_flow_uses_skin_friction() -> None:
    pull = TetherPull(LINE, 1000.0, 20.0).force((20.0, 0.0, 0.0), STILL, (0.3, 0.0, 0.0))
    skin = 0.5 * 1000.0 * 0.01 * math.pi * 0.0075 * 20.0 * 0.3**2
    assert pull == pytest.approx((0.5 * skin, 0.0, 0.0))


def test_taut_tether_pulls_and_never_pushes() -> None:
    pull = TetherPull(LINE, 1000.0, 20.0)
    assert pull.force((0.0, 19.99, 0.0), STILL, STILL) == pytest.approx(STILL)
    stretch = 50.0 / LINE.stiffness_npm
    assert pull.force((0.0, 20.0 + stretch, 0.0), STILL, STILL) == pytest.approx((0.0, -50.0, 0.0))
    assert LINE.stiffness_npm == pytest.approx(6.437e7 * 0.25 * math.pi * 0.0075**2 / 20.0)
    coming_back = pull.force((0.0, 20.01, 0.0), (0.0, -5.0, 0.0), STILL)
    assert coming_back[1] > 0.0  # drag alone: it does not shove the vehicle home


def test_force_at_anchor_is_zero() -> None:
    assert TetherPull(LINE, 1000.0, 20.0).force(STILL, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)) == STILL


@pytest.mark.parametrize(
    "change",
    [
        {"length_m": 0.0},
        {"length_m": "35"},
        {"diameter_m": -1.0},
        {"modulus_pa": math.nan},
        {"modulus_pa": 1e15},
        {"across": -1.2},
        {"damping_share": math.inf},
        {"anchor_m": (0.0, 0.0)},
        {"attachment_m": "stern"},
    ],
)
def test_invalid_numbers_raise(change: dict[str, Any]) -> None:
    (name,) = change
    with pytest.raises(ParameterError, match=f"The tether's {name} is"):
        Tether(**{"anchor_m": STILL, **change})


def test_diameter_in_millimetres_and_nan_position_raise() -> None:
    with pytest.raises(ParameterError, match=r"The tether's diameter_m is 7\.5: millimetres\?"):
        Tether(STILL, diameter_m=7.5)
    with pytest.raises(ParameterError, match="The tether's anchor_m of z is nan"):
        Tether((0.0, 0.0, math.nan))
