"""From numbers to a cell of a table: how a student's Q table gets its rows."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from snr_sim.prelude.errors import ParameterError

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Discretiser:
    """Cuts each number of an observation at its edges, and numbers the cells.

    Args:
        names: of the numbers that are looked at, in the order in which an observation has them.
        edges: of each, growing. n edges make n + 1 intervals: below the first, between two, from the last on.

    Raises:
        ParameterError: edges do not grow, or there are not as many of them as names.

    >>> grid = Discretiser(("altitude_m", "velocity_mps"), ((10.0, 100.0), (0.0,)))
    >>> grid.count, grid.cell([5.0, -1.0]), grid.cell([100.0, 0.0])
    (6, 0, 5)
    """

    names: tuple[str, ...]
    edges: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        if not self.names or len(self.names) != len(self.edges):
            raise ParameterError(
                f"{len(self.names)} names for {len(self.edges)} lists of edges.", fix="a list of edges for each name."
            )
        for name, edges in zip(self.names, self.edges, strict=True):
            if not all(map(math.isfinite, edges)) or any(b <= a for a, b in pairwise(edges)):
                raise ParameterError(f"The edges of '{name}' do not grow: {edges}.", fix="such as (-5.0, 0.0, 5.0).")

    @property
    def shape(self) -> tuple[int, ...]:
        """How many intervals each number has."""
        return tuple(len(edges) + 1 for edges in self.edges)

    @property
    def count(self) -> int:
        """How many cells there are."""
        return math.prod(self.shape)

    @cached_property
    def _arrays(self) -> list[NDArray[np.float64]]:
        return [np.array(edges, np.float64) for edges in self.edges]

    def cell(self, observation: Sequence[float]) -> int:
        """Return the number of the cell that an observation lies in.

        Raises:
            ParameterError: the observation has another length, or NaN in it, which lies in no cell.
        """
        if len(observation) != len(self.names):
            raise ParameterError(
                f"An observation of {len(observation)} numbers for a table of {', '.join(self.names)}.",
                fix=f"{len(self.names)} numbers, in that order.",
            )
        cell = 0
        for name, value, edges in zip(self.names, observation, self.edges, strict=True):
            if math.isnan(value):
                raise ParameterError(f"'{name}' is NaN, which lies in no cell.", fix="look where it came from.")
            cell = cell * (len(edges) + 1) + bisect_right(edges, value)
        return cell

    def cells(self, observations: NDArray[np.floating]) -> Ints:
        """Return the cells of many observations, shape (n, k), as an array of shape (n,)."""
        cells: Ints = np.zeros(len(observations), np.int64)
        for i, edges in enumerate(self._arrays):
            cells *= len(edges) + 1
            cells += np.searchsorted(edges, observations[:, i], side="right")
        return cells
