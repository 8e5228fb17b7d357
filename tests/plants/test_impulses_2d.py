import pytest

from snr_sim.plants.urov.impulses_2d import OUT_SHARE, Touch, stopped

# A body of 10 kg along x, 40 kg along z, 2 kg m2: as added mass makes one.
MOBILITY = [[0.1, 0.0, 0.0], [0.0, 0.025, 0.0], [0.0, 0.0, 0.5]]
FLOOR = Touch(0.0, 1.0, 0.0, -0.2, 0.0)
WALL = Touch(-1.0, 0.0, 0.3, 0.0, 0.0)


def test_each_direction_is_stopped_by_its_own_mass() -> None:
    velocity, impulse = stopped((0.0, -1.0, 0.0), [FLOOR], MOBILITY, 0.0, 0.005)
    assert velocity == pytest.approx((0.0, 0.0, 0.0))
    assert impulse == pytest.approx((0.0, 40.0))
    velocity, impulse = stopped((1.0, 0.0, 0.0), [WALL], MOBILITY, 0.0, 0.005)
    assert velocity == pytest.approx((0.0, 0.0, 0.0))
    assert impulse == pytest.approx((-10.0, 0.0))


def test_in_a_corner_both_are_stopped_at_once() -> None:
    velocity, impulse = stopped((1.0, -1.0, 0.0), [FLOOR, WALL], MOBILITY, 0.0, 0.005)
    assert velocity == pytest.approx((0.0, 0.0, 0.0))
    assert impulse == pytest.approx((-10.0, 40.0))


def test_two_feet_of_a_body_stop_its_fall_and_its_turning() -> None:
    feet = [Touch(0.0, 1.0, x, -0.2, 0.0) for x in (-0.3, 0.3)]
    velocity, impulse = stopped((0.0, -1.0, 0.5), feet, MOBILITY, 0.0, 0.005)
    # Turning by q moves a point at x by -q x along z: neither foot continues downwards.
    for x in (-0.3, 0.3):
        assert velocity[1] - velocity[2] * x >= -1e-6
    assert impulse[1] > 0.0


def test_what_already_leaves_is_left_alone_and_nothing_is_ever_pulled() -> None:
    velocity, impulse = stopped((0.3, 0.4, 0.1), [FLOOR, WALL._replace(arm_x=0.0)], MOBILITY, 0.0, 0.005)
    assert velocity[1:] == pytest.approx((0.4, 0.1))
    assert impulse[1] == 0.0
    assert impulse[0] < 0.0  # only the wall


@pytest.mark.parametrize(("friction", "left"), [(0.0, 0.1), (0.05, 0.08), (10.0, 0.0)])
def test_friction_holds_up_to_its_share_of_the_load(friction: float, left: float) -> None:
    # A contact without an arm, so that friction does not turn it; 4 N s of load.
    (vx, _, _), impulse = stopped((0.1, -0.1, 0.0), [Touch(0.0, 1.0, 0.0, 0.0, 0.0)], MOBILITY, friction, 0.005)
    assert vx == pytest.approx(left)
    assert impulse[1] == pytest.approx(4.0)


def test_what_is_deep_comes_out_slowly() -> None:
    (_, vz, _), _ = stopped((0.0, -1.0, 0.0), [FLOOR._replace(depth_m=0.0015)], MOBILITY, 0.0, 0.005)
    assert vz == pytest.approx(OUT_SHARE * 0.001 / 0.005)
    (_, vz, _), _ = stopped((0.0, -1.0, 0.0), [FLOOR._replace(depth_m=1.0)], MOBILITY, 0.0, 0.005)
    assert vz == pytest.approx(0.2)
