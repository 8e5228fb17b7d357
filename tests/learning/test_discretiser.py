"""Cells of a grid: at edges, beyond them, and the same one by one as all at once."""

import numpy as np
import pytest

from snr_sim.learning.discretiser import Discretiser
from snr_sim.prelude.errors import ParameterError

GRID = Discretiser(("altitude_m", "velocity_mps", "side"), ((1.0, 10.0, 100.0), (-2.0, 0.0, 2.0), (0.0,)))


def test_edge_belongs_to_upper_cell() -> None:
    cells = [GRID.cell([altitude, -5.0, -1.0]) for altitude in (-1e9, 0.999, 1.0, 9.999, 10.0, 100.0, 1e9)]
    assert cells == [0, 0, 8, 8, 16, 24, 24]
    assert GRID.count == 4 * 4 * 2


def test_positive_and_negative_velocities_have_different_cells() -> None:
    assert GRID.cell([50.0, -0.01, 0.0]) != GRID.cell([50.0, 0.01, 0.0])


def test_cells_equal_cell_of_each_observation() -> None:
    rng = np.random.default_rng(3)
    observations = np.concatenate([rng.normal(0.0, 50.0, (500, 3)), rng.choice([-2.0, 0.0, 1.0, 2.0, 10.0], (500, 3))])
    assert GRID.cells(observations).tolist() == [GRID.cell(one) for one in observations.tolist()]
    assert len(set(GRID.cells(observations))) > 20


@pytest.mark.parametrize("observation", [[1.0, 2.0], [1.0, 2.0, 3.0, 4.0]])
def test_observation_of_other_length_raises(observation: list[float]) -> None:
    with pytest.raises(ParameterError, match="altitude_m, velocity_mps, side"):
        GRID.cell(observation)


def test_nan_raises() -> None:
    with pytest.raises(ParameterError, match="'velocity_mps' is NaN"):
        GRID.cell([1.0, float("nan"), 0.0])


@pytest.mark.parametrize("edges", [(1.0, 1.0), (2.0, 1.0), (0.0, float("inf")), (float("nan"),)])
def test_non_increasing_edges_raise_with_name(edges: tuple[float, ...]) -> None:
    with pytest.raises(ParameterError, match="edges of 'speed' do not grow"):
        Discretiser(("speed",), (edges,))


def test_name_without_edges_raises() -> None:
    with pytest.raises(ParameterError, match="2 names for 1 lists"):
        Discretiser(("a", "b"), ((0.0,),))
