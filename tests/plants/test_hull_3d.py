"""The module in directions that no scenario starts it in: it is free in all six."""

import math

import pytest

from snr_sim.plants.lander.hull_3d import FOOT_KG, Hull3D
from snr_sim.plants.lander.module import LunarModule
from snr_sim.plants.lander.module_shapes import PADS_BELOW_M, PADS_M
from snr_sim.plants.lander.terrain import FLAT, make_terrain

LEVEL = (1.0, 0.0, 0.0, 0.0)
STEP_S = 0.005


def hull(
    module: LunarModule, z: float = 50.0, turn: tuple[float, ...] = LEVEL, motion: tuple[float, ...] = (0.0,) * 6,
    mass_kg: float = 7500.0, ground: object = FLAT,
) -> Hull3D:  # fmt: skip
    made = Hull3D(module, ground, STEP_S)  # type: ignore[arg-type]
    made.put((0.0, 0.0, z, *turn), motion)
    made.set_mass(mass_kg)
    made.update()
    return made


def run(made: Hull3D, time_s: float) -> None:
    for _ in range(round(time_s / STEP_S)):
        made.move()
        made.update()


def about(axis: tuple[float, float, float], angle: float) -> tuple[float, ...]:
    sin = math.sin(0.5 * angle)
    return (math.cos(0.5 * angle), *(sin * value for value in axis))


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("mass_kg", [7000.0, 7500.0, 9000.0])
def test_torque_accelerates_by_gyration_radius_about_each_axis(apollo: LunarModule, axis: int, mass_kg: float) -> None:
    made = hull(apollo, mass_kg=mass_kg)
    torque = [0.0, 0.0, 0.0]
    torque[axis] = 3000.0
    made.push((0.0, 0.0, 0.0), (torque[0], torque[1], torque[2]))
    run(made, 1.0)
    rates = made.motion[3:6]
    # The feet lag by less than a tenth of a millimetre: 1e-3.
    assert rates[axis] == pytest.approx(3000.0 / (mass_kg * apollo.gyration_m**2), rel=1e-3)
    assert sum(map(abs, rates)) == pytest.approx(abs(rates[axis]), abs=1e-9)
    # Its centre of mass stays where it was but for the fall: the feet's mass is balanced.
    assert made.coordinates[:2] == pytest.approx([0.0, 0.0], abs=1e-4)


@pytest.mark.parametrize("mass_kg", [7000.0, 8000.0])
def test_force_accelerates_centre_without_rotation(apollo: LunarModule, mass_kg: float) -> None:
    made = hull(apollo, turn=about((0.0, 0.0, 1.0), 0.7), mass_kg=mass_kg)
    made.push((0.0, 4000.0, 1.62 * mass_kg), (0.0, 0.0, 0.0))
    run(made, 2.0)
    assert made.motion[1] == pytest.approx(4000.0 / mass_kg * 2.0, rel=1e-4)
    assert made.motion[2] == pytest.approx(0.0, abs=1e-3)
    assert max(map(abs, made.motion[3:6])) < 1e-4


@pytest.mark.parametrize("heading", [0.0, 0.3, math.pi / 4, math.pi / 2])
def test_rest_at_any_heading_loads_four_feet_with_weight(apollo: LunarModule, heading: float) -> None:
    made = hull(apollo, z=4.0, turn=about((0.0, 0.0, 1.0), heading))
    run(made, 8.0)
    assert made.contacts == set(PADS_M)
    carried = sum(0.5 * apollo.leg.spring_npm * made.deflection_m(name)[2] for name in PADS_M)
    assert carried == pytest.approx((7500.0 - 4.0 * FOOT_KG) * 1.62, rel=1e-3)
    assert max(map(abs, made.motion)) < 1e-3


def test_landing_rolled_sideways_stays_in_plane(apollo: LunarModule) -> None:
    made = hull(apollo, z=4.2, turn=about((1.0, 0.0, 0.0), 0.1), motion=(0.0, 0.3, -1.0, 0.0, 0.0, 0.0))
    run(made, 8.0)
    assert made.contacts == set(PADS_M)
    assert abs(made.coordinates[0]) < 1e-6
    assert made.axes[8] == pytest.approx(1.0, abs=1e-4)


def test_ground_is_extruded_sideways(apollo: LunarModule) -> None:
    ground = make_terrain(5, relief_m=14.0)
    for y in (-20.0, 0.0, 12.5):
        made = Hull3D(apollo, ground, STEP_S)
        made.put((0.0, y, 4.2, *LEVEL), (0.0,) * 6)
        made.set_mass(7500.0)
        made.update()
        run(made, 6.0)
        lowest = made.coordinates[2] - PADS_BELOW_M + sum(made.deflection_m(name)[2] for name in PADS_M) / 4.0
        assert lowest == pytest.approx(ground.ground(0.0)[0], abs=0.003)


def test_upside_down_touches_with_hull(apollo: LunarModule) -> None:
    made = hull(apollo, z=3.3, turn=about((1.0, 0.0, 0.0), math.pi))
    assert made.contacts == set()
    run(made, 0.6)
    assert made.contacts == {"hull"}


def test_restored_state_continues_bitwise(apollo: LunarModule) -> None:
    made = hull(apollo, z=4.0, turn=about((0.6, 0.8, 0.0), 0.05), motion=(0.2, -0.3, -1.0, 0.0, 0.0, 0.02))
    run(made, 1.0)
    assert made.contacts
    held = made.state()
    run(made, 1.0)
    first = made.state()
    other = hull(apollo)
    for again in (made, other):
        again.put_state(held)
        again.set_mass(7500.0)
        again.update()
        run(again, 1.0)
        assert again.state() == first
