import math

import numpy as np
import pytest

from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.wrench import AXES, thruster_matrix, unactuated_axes


def test_six_independent_thrusters_actuate_every_axis() -> None:
    assert unactuated_axes(np.eye(6)) == ()
    assert unactuated_axes(np.random.default_rng(1).normal(size=(6, 8))) == ()


@pytest.mark.parametrize("missing", range(6))
def test_axis_without_thruster_is_unactuated(missing: int) -> None:
    matrix = np.eye(6)
    matrix[missing] = 0.0
    assert unactuated_axes(matrix) == (AXES[missing],)


def test_of_two_coupled_axes_the_weaker_is_unactuated() -> None:
    """Thrusters 7 cm under the centre pitch the vehicle when they push it ahead; pitch is the axis to leave out."""
    matrix = np.eye(6)
    matrix[4] = -0.07 * matrix[0]
    assert unactuated_axes(matrix) == ("pitch",)
    matrix[4] = -1.5 * matrix[0]  # far below, they are levers first of all
    assert unactuated_axes(matrix) == ("surge",)


def test_unactuated_axis_count_equals_missing_rank() -> None:
    rng = np.random.default_rng(2)
    for rank in range(1, 7):
        matrix = rng.normal(size=(6, rank)) @ rng.normal(size=(rank, 8))
        lacking = unactuated_axes(matrix)
        assert len(lacking) == 6 - rank
        assert np.linalg.matrix_rank(matrix[[i for i, axis in enumerate(AXES) if axis not in lacking]]) == rank


def test_empty_thruster_set_has_no_actuated_axes() -> None:
    assert unactuated_axes(np.zeros((6, 4))) == AXES


@pytest.mark.parametrize(
    "matrix",
    [np.zeros((5, 8)), np.zeros(6), [], np.full((6, 1), math.nan), [[1]] * 5 + [[1, 2]], [["x"]] * 6, np.zeros((6, 0))],
)
def test_invalid_thruster_matrix_is_rejected(matrix: object) -> None:
    with pytest.raises(ParameterError, match="six rows"):
        thruster_matrix(matrix)  # type: ignore[arg-type]
