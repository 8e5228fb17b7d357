"""Tiles: where an observation lies, how far what is learned spreads, and what is refused."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.learning.tile_coding import Axis, TileCoder, TiledValues
from snr_sim.prelude.errors import ParameterError

CODER = TileCoder([Axis("a", 0.0, 4.0, 4, sqrt_spacing=False), Axis("b", -9.0, 9.0, 6)], tilings=4)


@given(st.lists(st.tuples(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9)), min_size=1, max_size=8))
def test_observation_has_one_tile_per_grid(observations: list[tuple[float, float]]) -> None:
    tiles = CODER.tiles(np.array(observations))
    per_grid = CODER.count // CODER.tilings
    assert (tiles // per_grid == np.arange(4)).all()


def test_generalisation_falls_with_distance_to_zero_beyond_a_tile() -> None:
    values = TiledValues(CODER, 2)
    here = np.array([[1.5, 0.0]])
    values.learn(CODER.tiles(here), np.array([1]), np.array([8.0]), 0.0)
    learned = 8.0 * (1.0 + 1 / 30.0) ** -0.7  # the first step is nearly all of the way
    assert values.of(CODER.tiles(here))[0] == pytest.approx([0.0, learned])
    along = [float(values.of(CODER.tiles(np.array([[1.5 + d, 0.0]])))[0, 1]) for d in np.arange(0.0, 1.3, 0.1)]
    assert along == sorted(along, reverse=True)
    assert along[0] == pytest.approx(learned)
    assert along[-1] == 0.0
    assert 1 < len(set(along)) <= 5  # it falls off in steps of a fourth


def test_sqrt_spacing_is_finer_near_zero() -> None:
    coder = TileCoder([Axis("b", -9.0, 9.0, 6)], tilings=1)
    tiles = coder.tiles(np.array([[-9.0], [-3.9], [-0.9], [0.9], [1.1], [4.1], [9.0]])).ravel().tolist()
    assert tiles == [0, 1, 2, 3, 4, 5, 5]  # cut at -4, -1, 0, 1 and 4


def test_several_targets_for_one_weight_are_averaged() -> None:
    coder = TileCoder([Axis("a", 0.0, 1.0, 1)], tilings=1)
    values = TiledValues(coder, 2)
    values.learn(coder.tiles(np.zeros((3, 1))), np.zeros(3, int), np.array([1.0, 2.0, 6.0]), 0.0)
    assert values.weights[0, 0] == pytest.approx(3.0 * (1.0 + 3 / 30.0) ** -0.7)
    assert values.visits[0].tolist() == [3, 0]


def test_best_returns_first_of_equal_actions() -> None:
    assert TiledValues(CODER, 3).best(np.zeros((2, 2))).tolist() == [0, 0]


@pytest.mark.parametrize(
    ("axes", "tilings"),
    [
        ([], 8),
        ([Axis("a", 0.0, 1.0, 4)], 0),
        ([Axis("a", 1.0, 1.0, 4)], 8),
        ([Axis("a", 0.0, 1.0, 0)], 8),
        ([Axis("a", 0.0, math.inf, 4)], 8),
        ([Axis("a", math.nan, 1.0, 4)], 8),
        ([Axis("a", 0.0, 1.0, 10_000), Axis("b", 0.0, 1.0, 10_000)], 8),
    ],
)
def test_invalid_tiles_raise(axes: Any, tilings: int) -> None:
    with pytest.raises(ParameterError):
        TileCoder(axes, tilings)
