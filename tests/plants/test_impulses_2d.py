import pytest

from snr_sim.plants.impulses_2d import BAUMGARTE_FACTOR, Contact, resolve_contacts

# A body of 10 kg along x, 40 kg along z, 2 kg m2: as added mass makes one.
MOBILITY = [[0.1, 0.0, 0.0], [0.0, 0.025, 0.0], [0.0, 0.0, 0.5]]
FLOOR = Contact(0.0, 1.0, 0.0, -0.2, 0.0)
WALL = Contact(-1.0, 0.0, 0.3, 0.0, 0.0)


def test_impulse_uses_mass_of_its_direction() -> None:
    velocity, impulse = resolve_contacts((0.0, -1.0, 0.0), [FLOOR], MOBILITY, 0.0, 0.005)
    assert velocity == pytest.approx((0.0, 0.0, 0.0))
    assert impulse == pytest.approx((0.0, 40.0))
    velocity, impulse = resolve_contacts((1.0, 0.0, 0.0), [WALL], MOBILITY, 0.0, 0.005)
    assert velocity == pytest.approx((0.0, 0.0, 0.0))
    assert impulse == pytest.approx((-10.0, 0.0))


def test_corner_contact_stops_both_directions() -> None:
    velocity, impulse = resolve_contacts((1.0, -1.0, 0.0), [FLOOR, WALL], MOBILITY, 0.0, 0.005)
    assert velocity == pytest.approx((0.0, 0.0, 0.0))
    assert impulse == pytest.approx((-10.0, 40.0))


def test_two_contacts_stop_fall_and_rotation() -> None:
    feet = [Contact(0.0, 1.0, x, -0.2, 0.0) for x in (-0.3, 0.3)]
    velocity, impulse = resolve_contacts((0.0, -1.0, 0.5), feet, MOBILITY, 0.0, 0.005)
    # Turning by q moves a point at x by -q x along z: neither foot continues downwards.
    for x in (-0.3, 0.3):
        assert velocity[1] - velocity[2] * x >= -1e-6
    assert impulse[1] > 0.0


def test_separating_contact_gets_no_impulse() -> None:
    velocity, impulse = resolve_contacts((0.3, 0.4, 0.1), [FLOOR, WALL._replace(arm_x=0.0)], MOBILITY, 0.0, 0.005)
    assert velocity[1:] == pytest.approx((0.4, 0.1))
    assert impulse[1] == 0.0
    assert impulse[0] < 0.0  # only the wall


@pytest.mark.parametrize(("friction", "left"), [(0.0, 0.1), (0.05, 0.08), (10.0, 0.0)])
def test_friction_is_limited_by_normal_impulse(friction: float, left: float) -> None:
    # A contact without an arm, so that friction does not turn it; 4 N s of load.
    (vx, _, _), impulse = resolve_contacts(
        (0.1, -0.1, 0.0), [Contact(0.0, 1.0, 0.0, 0.0, 0.0)], MOBILITY, friction, 0.005
    )
    assert vx == pytest.approx(left)
    assert impulse[1] == pytest.approx(4.0)


def test_deep_penetration_is_corrected_slowly() -> None:
    (_, vz, _), _ = resolve_contacts((0.0, -1.0, 0.0), [FLOOR._replace(depth_m=0.0015)], MOBILITY, 0.0, 0.005)
    assert vz == pytest.approx(BAUMGARTE_FACTOR * 0.001 / 0.005)
    (_, vz, _), _ = resolve_contacts((0.0, -1.0, 0.0), [FLOOR._replace(depth_m=1.0)], MOBILITY, 0.0, 0.005)
    assert vz == pytest.approx(0.2)
