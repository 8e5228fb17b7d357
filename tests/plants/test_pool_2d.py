import math
from dataclasses import replace

import numpy as np
import pytest

from snr_sim.plants.mujoco_body import MujocoBody
from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.plants.urov.pool import BODY, Gate, Pool
from snr_sim.plants.urov.pool_2d import Pool2D
from tests.plants.vehicles import HEAVY

POOL = Pool(gates=(Gate("gate", (2.0, 0.5, -2.0), heading_rad=0.3),))
AT_REST = (0.0, 0.0, 0.0)


def cut(x: float = 0.0, y: float = 0.0, z: float = -1.0, pitch: float = 0.0) -> Pool2D:
    made = Pool2D(POOL, HEAVY)
    made.set_pose(y, (x, z, pitch), AT_REST)
    return made


def test_mass_matrix_equals_mujoco() -> None:
    lopsided = replace(HEAVY, centre_of_mass_m=(0.02, 0.01, -0.03))
    world = MujocoWorld(POOL.mjcf(lopsided), 0.005, (BODY,))
    assert np.allclose(Pool2D(POOL, lopsided).rigid, MujocoBody(world, BODY).rigid, atol=1e-9)


def test_contacts_in_open_water_are_empty() -> None:
    assert cut().contacts() == []
    assert cut(z=3.0).contacts() == []


def test_level_frame_on_floor_has_two_contacts() -> None:
    contacts = cut(z=-3.875).contacts()
    assert sorted(contact.arm_x for contact in contacts) == pytest.approx([-0.2285, 0.2285])
    for contact in contacts:
        assert tuple(contact) == pytest.approx((0.0, 1.0, contact.arm_x, -0.127, 0.002))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_tilted_frame_at_wall_has_one_contact(side: float) -> None:
    (contact,) = cut(x=side * 12.3, pitch=0.4).contacts()
    assert (contact.out_x, contact.out_z) == pytest.approx((-side, 0.0))
    reach = 0.2285 * math.cos(0.4) + 0.127 * math.sin(0.4)
    assert contact.depth_m == pytest.approx(12.3 + reach - 12.5)
    assert side * contact.arm_x == pytest.approx(reach)
    assert side * contact.arm_z == pytest.approx(0.127 * math.cos(0.4) - 0.2285 * math.sin(0.4))


@pytest.mark.parametrize(("y", "is_there"), [(0.5, True), (1.0, True), (-0.1, True), (1.5, False), (-0.4, False)])
def test_gate_bars_are_where_cut_meets_them(y: float, is_there: bool) -> None:
    at = 2.0 - math.tan(0.3) * (y - 0.5)
    assert bool(cut(at, y, -1.5).contacts()) == is_there
    assert bool(cut(at, y, -2.5).contacts()) == is_there
    assert not cut(at, y, -2.0).contacts()
    below = 2.475 if is_there else 4.0
    assert cut(y=y).height_over_ground_m((at, y, -2.0)) == pytest.approx(below - 2.0)


def test_drift_follows_velocity_and_positive_pitch_is_nose_down() -> None:
    made = cut()
    made.move_at((1.0, 0.5, 0.2))
    made.drift(0.5)
    assert made.plane_pose() == pytest.approx((0.5, -0.75, 0.1))
    (contact, *_) = cut(z=-3.9, pitch=0.3).contacts()
    assert contact.arm_x > 0.0  # it is the nose that is down


def test_snapshot_restores_bitwise() -> None:
    made = cut(0.1, 0.2, -0.3, 0.4)
    made.move_at((0.7, 0.11, 0.13))
    made.drift(1.0 / 3.0)
    held = made.snapshot()
    made.drift(0.5)
    other = cut()
    for again in (made, other):
        again.restore(held)
        assert again.snapshot() == held
