import math
from dataclasses import replace

import numpy as np
import pytest

from snr_sim.plants.urov.hydrodynamics import AT_REST, Hydrodynamics
from snr_sim.plants.urov.water_2d import Water2D
from tests.plants.vehicles import HEAVY

UNDAMPED = replace(HEAVY, linear_damping=(0.0,) * 6, quadratic_damping=(0.0,) * 6)
# Coupled as well: a centre of mass off the origin, and added mass that is not diagonal.
MASS = np.diag([20.0, 21.0, 32.0, 0.5, 0.4, 0.6])
MASS[0, 4] = MASS[4, 0] = 0.7
MASS[2, 4] = MASS[4, 2] = -0.5
MASS[0, 2] = MASS[2, 0] = 1.5


def water(damped: bool = False) -> Water2D:
    made = Water2D(HEAVY if damped else UNDAMPED)
    made.set_mass(MASS, 1.0)
    return made


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("pitch", [0.0, 0.7, -2.5])
def test_acceleration_equals_fossen_equation_at_any_attitude(damped: bool, pitch: float) -> None:
    cos, sin = math.cos(pitch), math.sin(pitch)
    u, w, q = 0.8, -0.5, 0.6
    push, net_n, arm = (5.0, -3.0, 0.4), 1.5, (0.2, 1.3)
    fossen = Hydrodynamics(HEAVY if damped else UNDAMPED, MASS - HEAVY.added_mass)
    nu, up = (u, 0.0, w, 0.0, q, 0.0), (-sin, 0.0, cos)
    wrench = (push[0], 0.0, push[1], 0.0, push[2], 0.0)
    change = fossen.advance(nu, up, wrench, net_n, (arm[0], 0.0, arm[1]), AT_REST, 0.0)[1]
    # Seen from the world, the numbers of the velocity change also as the body turns.
    along = change[0] + q * w, change[2] - q * u
    expected = cos * along[0] + sin * along[1], cos * along[1] - sin * along[0], change[4]
    dt_s = 1e-6
    velocity = cos * u + sin * w, cos * w - sin * u, q
    after = water(damped).advance(velocity, pitch, push, net_n, arm, dt_s)
    for before, now, target in zip(velocity, after, expected, strict=True):
        assert (now - before) / dt_s == pytest.approx(target, abs=1e-4)


def test_undamped_free_motion_keeps_momentum_and_energy() -> None:
    free, pitch, velocity, dt_s = water(), 0.3, (1.0, -0.4, 1.2), 0.005
    block = MASS[np.ix_((0, 2, 4), (0, 2, 4))]

    def momentum_and_energy() -> tuple[tuple[float, float], float]:
        cos, sin = math.cos(pitch), math.sin(pitch)
        vx, vz, q = velocity
        nu = np.array([cos * vx - sin * vz, sin * vx + cos * vz, q])
        p1, p3, _ = block @ nu
        return (cos * p1 + sin * p3, cos * p3 - sin * p1), 0.5 * nu @ block @ nu

    before, energy = momentum_and_energy()
    for _ in range(4000):
        after = free.advance(velocity, pitch, (0.0, 0.0, 0.0), 0.0, (0.0, 0.0), dt_s)
        pitch += 0.5 * dt_s * (velocity[2] + after[2])
        velocity = after
    assert momentum_and_energy()[0] == pytest.approx(before, rel=1e-5)
    assert momentum_and_energy()[1] == pytest.approx(energy, rel=1e-3)
    assert abs(pitch) > 1.0


def test_half_step_quarters_error() -> None:
    def end(dt_s: float) -> tuple[float, float, float]:
        damped, pitch, velocity = water(damped=True), 0.3, (1.0, -0.4, 1.2)
        for _ in range(round(3.0 / dt_s)):
            after = damped.advance(velocity, pitch, (10.0, 4.0, 0.3), 1.5, (0.0, 1.3), dt_s)
            pitch += 0.5 * dt_s * (velocity[2] + after[2])
            velocity = after
        return velocity

    exact = end(0.02 / 16)
    coarse, fine = (math.dist(end(dt_s), exact) for dt_s in (0.02, 0.01))
    assert fine < 0.3 * coarse


@pytest.mark.parametrize("pitch", [0.0, 0.7])
def test_mobility_equals_velocity_change_per_impulse(pitch: float) -> None:
    still = water()
    cos, sin = math.cos(pitch), math.sin(pitch)
    world = 3.0, -2.0, 0.1
    body = cos * world[0] - sin * world[1], sin * world[0] + cos * world[1], world[2]
    dt_s = 1e-6
    pushed = still.advance((0.0, 0.0, 0.0), pitch, tuple(value / dt_s for value in body), 0.0, (0.0, 0.0), dt_s)  # type: ignore[arg-type]
    assert pushed == pytest.approx(tuple(np.array(still.mobility(pitch)) @ world), rel=1e-5)
