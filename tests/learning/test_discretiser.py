"""Cells of a grid: at edges, beyond them, and the same one by one as all at once."""

import numpy as np
import pytest

from snr_sim.learning.discretiser import Discretiser
from snr_sim.prelude.errors import ParameterError

GRID = Discretiser(("altitude_m", "velocity_mps", "side"), ((1.0, 10.0, 100.0), (-2.0, 0.0, 2.0), (0.0,)))


def test_an_edge_belongs_to_what_is_above_it() -> None:
    cells = [GRID.cell([altitude, -5.0, -1.0]) for altitude in (-1e9, 0.999, 1.0, 9.999, 10.0, 100.0, 1e9)]
    assert cells == [0, 0, 8, 8, 16, 24, 24]
    assert GRID.count == 4 * 4 * 2


def test_velocities_of_either_sign_are_told_apart() -> None:
    assert GRID.cell([50.0, -0.01, 0.0]) != GRID.cell([50.0, 0.01, 0.0])


def test_many_at_once_lie_in_the_same_cells_as_one_by_one() -> None:
    rng = np.random.default_rng(3)
    observations = np.concatenate([rng.normal(0.0, 50.0, (500, 3)), rng.choice([-2.0, 0.0, 1.0, 2.0, 10.0], (500, 3))])
    assert GRID.cells(observations).tolist() == [GRID.cell(one) for one in observations.tolist()]
    assert len(set(GRID.cells(observations))) > 20


@pytest.mark.parametrize("observation", [[1.0, 2.0], [1.0, 2.0, 3.0, 4.0]])
def test_an_observation_of_another_length_is_refused(observation: list[float]) -> None:
    with pytest.raises(ParameterError, match="altitude_m, velocity_mps, side"):
        GRID.cell(observation)


def test_nan_lies_in_no_cell() -> None:
    with pytest.raises(ParameterError, match="'velocity_mps' is NaN"):
        GRID.cell([1.0, float("nan"), 0.0])


@pytest.mark.parametrize("edges", [(1.0, 1.0), (2.0, 1.0), (0.0, float("inf")), (float("nan"),)])
def test_edges_that_do_not_grow_are_refused_by_name(edges: tuple[float, ...]) -> None:
    with pytest.raises(ParameterError, match="edges of 'speed' do not grow"):
        Discretiser(("speed",), (edges,))


def test_a_name_without_edges_is_refused() -> None:
    with pytest.raises(ParameterError, match="2 names for 1 lists"):
        Discretiser(("a", "b"), ((0.0,),))
