import math

import numpy as np
import pytest

from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.wrench import AXES, lacking_axes, thruster_matrix


def test_six_independent_thrusters_lack_nothing() -> None:
    assert lacking_axes(np.eye(6)) == ()
    assert lacking_axes(np.random.default_rng(1).normal(size=(6, 8))) == ()


@pytest.mark.parametrize("missing", range(6))
def test_an_axis_that_nothing_pushes_is_named(missing: int) -> None:
    matrix = np.eye(6)
    matrix[missing] = 0.0
    assert lacking_axes(matrix) == (AXES[missing],)


def test_of_two_axes_that_hang_together_the_one_that_is_reached_least_lacks() -> None:
    """Thrusters 7 cm under the centre pitch the vehicle when they push it ahead; pitch is the axis to leave out."""
    matrix = np.eye(6)
    matrix[4] = -0.07 * matrix[0]
    assert lacking_axes(matrix) == ("pitch",)
    matrix[4] = -1.5 * matrix[0]  # far below, they are levers first of all
    assert lacking_axes(matrix) == ("surge",)


def test_as_many_axes_lack_as_ranks_do_and_the_others_are_independent() -> None:
    rng = np.random.default_rng(2)
    for rank in range(1, 7):
        matrix = rng.normal(size=(6, rank)) @ rng.normal(size=(rank, 8))
        lacking = lacking_axes(matrix)
        assert len(lacking) == 6 - rank
        assert np.linalg.matrix_rank(matrix[[i for i, axis in enumerate(AXES) if axis not in lacking]]) == rank


def test_nothing_at_all_lacks_everything() -> None:
    assert lacking_axes(np.zeros((6, 4))) == AXES


@pytest.mark.parametrize(
    "matrix",
    [np.zeros((5, 8)), np.zeros(6), [], np.full((6, 1), math.nan), [[1]] * 5 + [[1, 2]], [["x"]] * 6, np.zeros((6, 0))],
)
def test_what_is_no_matrix_of_thrusters_is_refused(matrix: object) -> None:
    with pytest.raises(ParameterError, match="six rows"):
        thruster_matrix(matrix)  # type: ignore[arg-type]
