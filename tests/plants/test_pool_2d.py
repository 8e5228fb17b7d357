import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from snr_sim.plants.mujoco_body import MujocoBody
from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.plants.urov.pool import BODY, Gate, Pool
from snr_sim.plants.urov.pool_2d import Pool2D
from snr_sim.plants.urov.vehicle_file import read_vehicle

VEHICLES = Path(__file__).parents[2] / "robots" / "urov" / "vehicles"
HEAVY = read_vehicle(VEHICLES / "benzon2022.toml")
POOL = Pool(gates=(Gate("gate", (2.0, 0.5, -2.0), heading_rad=0.3),))
AT_REST = (0.0, 0.0, 0.0)


def cut(x: float = 0.0, y: float = 0.0, z: float = -1.0, pitch: float = 0.0) -> Pool2D:
    made = Pool2D(POOL, HEAVY)
    made.place(y, (x, z, pitch), AT_REST)
    return made


def test_its_mass_is_the_one_that_mujoco_makes_of_the_same_vehicle() -> None:
    lopsided = replace(HEAVY, centre_of_mass_m=(0.02, 0.01, -0.03))
    world = MujocoWorld(POOL.mjcf(lopsided), 0.005, (BODY,))
    assert np.allclose(Pool2D(POOL, lopsided).rigid, MujocoBody(world, BODY).rigid, atol=1e-9)


def test_where_nothing_is_near_nothing_touches() -> None:
    assert cut().touches() == []
    assert cut(z=3.0).touches() == []


def test_level_on_the_floor_both_ends_of_the_frame_touch_it() -> None:
    touches = cut(z=-3.875).touches()
    assert sorted(touch.arm_x for touch in touches) == pytest.approx([-0.2285, 0.2285])
    for touch in touches:
        assert tuple(touch) == pytest.approx((0.0, 1.0, touch.arm_x, -0.127, 0.002))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_tilted_at_a_wall_one_corner_touches_it(side: float) -> None:
    (touch,) = cut(x=side * 12.3, pitch=0.4).touches()
    assert (touch.out_x, touch.out_z) == pytest.approx((-side, 0.0))
    reach = 0.2285 * math.cos(0.4) + 0.127 * math.sin(0.4)
    assert touch.depth_m == pytest.approx(12.3 + reach - 12.5)
    assert side * touch.arm_x == pytest.approx(reach)
    assert side * touch.arm_z == pytest.approx(0.127 * math.cos(0.4) - 0.2285 * math.sin(0.4))


@pytest.mark.parametrize(("y", "is_there"), [(0.5, True), (1.0, True), (-0.1, True), (1.5, False), (-0.4, False)])
def test_a_gate_stands_where_the_cut_meets_its_bars(y: float, is_there: bool) -> None:
    at = 2.0 - math.tan(0.3) * (y - 0.5)
    assert bool(cut(at, y, -1.5).touches()) == is_there
    assert bool(cut(at, y, -2.5).touches()) == is_there
    assert not cut(at, y, -2.0).touches()
    below = 2.475 if is_there else 4.0
    assert cut(y=y).height_over_ground_m((at, y, -2.0)) == pytest.approx(below - 2.0)


def test_it_drifts_as_it_moves_and_turns_nose_down_with_positive_pitch() -> None:
    made = cut()
    made.move_at((1.0, 0.5, 0.2))
    made.drift(0.5)
    assert made.where() == pytest.approx((0.5, -0.75, 0.1))
    (touch, *_) = cut(z=-3.9, pitch=0.3).touches()
    assert touch.arm_x > 0.0  # it is the nose that is down


def test_a_snapshot_puts_all_of_it_back_to_the_bit() -> None:
    made = cut(0.1, 0.2, -0.3, 0.4)
    made.move_at((0.7, 0.11, 0.13))
    made.drift(1.0 / 3.0)
    held = made.snapshot()
    made.drift(0.5)
    other = cut()
    for again in (made, other):
        again.restore(held)
        assert again.snapshot() == held
