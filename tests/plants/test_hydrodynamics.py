"""One step of `Hydrodynamics` compared with the same equation in matrices."""

import numpy as np
import pytest

from snr_sim.plants.urov.hydrodynamics import AT_REST, ITERATIONS, Hydrodynamics, product_with
from tests.plants.vehicles import HEAVY

RNG = np.random.default_rng(11)
SKEW = RNG.normal(size=(6, 6))
LOPSIDED = np.diag([13.5, 13.5, 13.5, 0.26, 0.23, 0.37]) + 0.05 * SKEW @ SKEW.T  # all of it coupled
STEP_S = 0.005


def cross(vector: np.ndarray) -> np.ndarray:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def coriolis(mass: np.ndarray, nu: np.ndarray) -> np.ndarray:
    linear, angular = np.split(mass @ nu, 2)
    return np.block([[np.zeros((3, 3)), -cross(linear)], [-cross(linear), -cross(angular)]])


def in_matrices(
    mass: np.ndarray,
    wet: float,
    nu: np.ndarray,
    up: np.ndarray,
    push: np.ndarray,
    net_n: float,
    arm: np.ndarray,
    dt_s: float,
    rounds: int,
) -> np.ndarray:
    """The acceleration by so many rounds: M nu' = push + restoring - C nu - D nu, all in the middle of the step."""
    change = np.zeros(6)
    for _ in range(rounds):
        middle = nu + 0.5 * dt_s * change
        # up - up0 = dt / 2 (up x w), for the mean of `up`
        mean_up = np.linalg.solve(np.eye(3) + 0.5 * dt_s * cross(middle[3:]), up)
        restoring = np.concatenate([net_n * mean_up, np.cross(arm, mean_up)])
        damping = wet * (np.array(HEAVY.linear_damping) + np.array(HEAVY.quadratic_damping) * abs(middle))
        force = push + restoring - coriolis(mass, middle) @ middle - damping * middle
        change = np.linalg.solve(mass, force)
    return change


@pytest.mark.parametrize("dt_s", [0.0, STEP_S])
@pytest.mark.parametrize("wet", [1.0, 0.5])
@pytest.mark.parametrize("rigid", [np.diag(np.diag(LOPSIDED)), LOPSIDED], ids=["diagonal", "full"])
def test_advance_equals_matrix_form(rigid: np.ndarray, wet: float, dt_s: float) -> None:
    hydro = Hydrodynamics(HEAVY, rigid)
    hydro.set_mass(rigid, wet)
    assert hydro.mass == pytest.approx(rigid + wet * HEAVY.added_mass)
    for _ in range(20):
        nu, push, arm = RNG.normal(size=6), 10.0 * RNG.normal(size=6), RNG.normal(size=3)
        up = RNG.normal(size=3)
        up /= np.linalg.norm(up)
        # From a guess of zero, rounds continue until they converge; those of the matrices do far more rounds.
        middle, change = hydro.advance(nu.tolist(), tuple(up), push.tolist(), 1.5, tuple(arm), AT_REST, dt_s)
        expected = in_matrices(hydro.mass, wet, nu, up, push, 1.5, arm, dt_s, 30)
        settled = 1e-12 if dt_s == 0.0 else 1e-3  # TOLERANCE is of half a step's change of velocity
        assert change == pytest.approx(expected.tolist(), rel=1e-9, abs=settled)
        assert middle == pytest.approx((nu + 0.5 * dt_s * np.array(change)).tolist())


def test_two_iterations_from_good_guess_equal_matrix_form() -> None:
    """To the last digits: nothing is settled by further rounds."""
    hydro = Hydrodynamics(HEAVY, LOPSIDED)
    nu, up, push, arm = 0.01 * RNG.normal(size=6), np.array([0.0, 0.0, 1.0]), np.zeros(6), np.array([0.0, 0.0, 1.3])
    _, change = hydro.advance(nu.tolist(), (0.0, 0.0, 1.0), push.tolist(), 0.01, (0.0, 0.0, 1.3), AT_REST, 1e-4)
    assert change == pytest.approx(in_matrices(hydro.mass, 1.0, nu, up, push, 0.01, arm, 1e-4, ITERATIONS).tolist())


def test_subtract_impulse_changes_velocity_by_inverse_mass() -> None:
    hydro, momentum, nu = Hydrodynamics(HEAVY, LOPSIDED), RNG.normal(size=6), RNG.normal(size=6)
    expected = nu - np.linalg.solve(hydro.mass, momentum)
    assert hydro.subtract_impulse(nu.tolist(), momentum.tolist()) == pytest.approx(expected.tolist())
    assert product_with(LOPSIDED)(*nu) == pytest.approx((LOPSIDED @ nu).tolist())
