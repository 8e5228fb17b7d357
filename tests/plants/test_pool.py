import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.plants.urov.pool import Gate, Pool
from snr_sim.prelude.errors import ParameterError
from tests.plants.vehicles import HEAVY

RED = Gate("red", (1.0, 0.0, -1.0))


@pytest.mark.parametrize(
    "change",
    [
        {"depth_m": -4.0},
        {"length_m": 0.0},
        {"density_kgm3": math.nan},
        {"density_kgm3": 1.0},
        {"width_m": math.inf},
        {"gravity_mps2": -9.81},
        {"temperature_c": math.nan},
        {"gates": RED},
    ],
)
def test_invalid_pool_raises(change: dict[str, Any]) -> None:
    (name,) = change
    with pytest.raises(ParameterError, match=f"The pool's {name} is"):
        Pool(**change)


def test_duplicate_gate_name_raises() -> None:
    with pytest.raises(ParameterError, match="Two gates have one name: red, red"):
        Pool(gates=(RED, RED))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width_m": -1.0}, r"Gate 'red': width_m is -1\.0"),
        ({"height_m": math.nan}, "Gate 'red': height_m is nan"),
        ({"heading_rad": 90.0}, r"Gate 'red': heading_rad is 90\.0: degrees\?"),
        ({"position_m": (0.0, -1.0)}, r"Gate 'red': position_m is \(0\.0, -1\.0\): 2 numbers, not 3"),
        ({"name": ""}, "A gate is named ''"),
        ({"name": "floor"}, "A gate is named 'floor'"),
    ],
)
def test_invalid_gate_raises_with_name(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        replace(RED, **change)


def test_gate_outside_pool_raises() -> None:
    for position in ((0.0, 0.0, 1.5), (13.0, 0.0, -1.0), (0.0, 0.0, -4.5)):
        with pytest.raises(ParameterError, match=r"Gate 'red' is at .*, which is not in the pool") as caught:
            Pool(gates=(replace(RED, position_m=position),))
        assert "under water z is negative" in caught.value.fix


def test_gate_accepts_any_name_and_numpy_numbers() -> None:
    pool = Pool(gravity_mps2=np.float64(9.81), gates=[Gate('<"a&b>', (np.float64(1.0), 0.0, -1.0))])
    world = MujocoWorld(pool.mjcf(HEAVY), 0.005)
    assert world.model.geom('<"a&b>_0').name


def test_gate_is_perpendicular_to_its_heading() -> None:
    corners = Gate("red", (5.0, 1.0, -2.0), math.radians(90.0), width_m=2.0, height_m=1.0).corners_m()
    assert [[round(value, 9) for value in corner] for corner in corners] == [
        [4.0, 1.0, -1.5], [4.0, 1.0, -2.5], [6.0, 1.0, -2.5], [6.0, 1.0, -1.5],
    ]  # fmt: skip


def test_clearance_never_exceeds_distance() -> None:
    pool = Pool(gates=(RED,))
    assert pool.clearance_m((0.0, 0.0, -3.9)) == pytest.approx(0.1)
    assert pool.clearance_m((12.0, 0.0, -2.0)) == pytest.approx(0.5)
    assert pool.clearance_m((-9.0, 5.75, -2.0)) == pytest.approx(0.5)
    corner = RED.corners_m()[0]
    for beyond_m in (0.0, 0.2, 0.5):
        position = (corner[0], corner[1], corner[2] + beyond_m)
        assert pool.clearance_m(position) <= beyond_m
    assert pool.clearance_m((5.0, 0.0, -1.0)) == pytest.approx(3.0)  # down to the floor: the gate is farther
