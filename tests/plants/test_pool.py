import math

import pytest

from snr_sim.plants.pool import Gate, Pool
from snr_sim.prelude.errors import ParameterError


@pytest.mark.parametrize(
    "change", [{"depth_m": -4.0}, {"length_m": 0.0}, {"density_kgm3": math.nan}, {"width_m": math.inf}]
)
def test_a_pool_that_cannot_be_is_refused(change: dict[str, float]) -> None:
    (name,) = change
    with pytest.raises(ParameterError, match=f"The pool's {name} is"):
        Pool(**change)


def test_a_gate_named_twice_is_refused() -> None:
    gate = Gate("red", (1.0, 0.0, -1.0))
    with pytest.raises(ParameterError, match="Two gates have one name: red, red"):
        Pool(gates=(gate, gate))


def test_a_gate_stands_across_its_heading() -> None:
    corners = Gate("red", (5.0, 1.0, -2.0), math.radians(90.0), width_m=2.0, height_m=1.0).corners_m()
    assert [[round(value, 9) for value in corner] for corner in corners] == [
        [4.0, 1.0, -1.5], [4.0, 1.0, -2.5], [6.0, 1.0, -2.5], [6.0, 1.0, -1.5],
    ]  # fmt: skip
