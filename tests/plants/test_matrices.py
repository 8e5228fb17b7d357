import numpy as np
import pytest

from snr_sim.plants.matrices import inverse, mujoco_mass_matrix, product
from snr_sim.prelude.errors import ParameterError


def mass_of(seed: int, size: int = 6) -> np.ndarray:
    """Return a symmetric positive definite matrix."""
    root = np.random.default_rng(seed).normal(size=(size, size))
    return root @ root.T + 0.1 * np.eye(size)


@pytest.mark.parametrize("seed", range(3))
def test_product_equals_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, other = rng.normal(size=(3, 6)), rng.normal(size=(6, 2))
    assert product(one, other) == pytest.approx(one @ other, abs=1e-13)


@pytest.mark.parametrize("size", [1, 3, 6])
def test_inverse_times_matrix_is_identity(size: int) -> None:
    mass = mass_of(size, size)
    assert mass @ inverse(mass) == pytest.approx(np.eye(size), abs=1e-10)


def test_inverse_of_diagonal_matrix_is_exact() -> None:
    sizes = np.array([12.0, 7.0, 3.0])
    assert (inverse(np.diag(sizes)) == np.diag(1.0 / sizes)).all()


@pytest.mark.parametrize("matrix", [np.zeros((2, 2)), np.diag([1.0, -1.0]), np.diag([1.0, np.nan])])
def test_inverse_of_indefinite_matrix_raises(matrix: np.ndarray) -> None:
    with pytest.raises(ParameterError, match="positive definite"):
        inverse(matrix)


def test_mujoco_mass_matrix_keeps_kinetic_energy() -> None:
    mass, rng = mass_of(5), np.random.default_rng(6)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    body = rng.normal(size=6)
    seen = np.zeros((6, 6))
    seen[np.tril_indices(6)] = mujoco_mass_matrix(mass, rotation.ravel().tolist())
    seen += np.tril(seen, -1).T
    velocity = np.concatenate([rotation @ body[:3], body[3:]])
    assert velocity @ seen @ velocity == pytest.approx(body @ mass @ body, rel=1e-12)
