"""Tile coding: values of actions that generalise to nearby states (Sutton and Barto, second edition, section 9.5.4).

A table has no value for a cell that was not visited. Here several grids, each shifted a little against the others,
cover the same numbers; an observation lies in one tile of each, and what it is worth is the sum over its tiles. So what
is learned in one state counts in part for all states that share tiles with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from snr_sim.prelude.errors import ParameterError

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
MAX_TILES = 10_000_000


class Axis(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How one number is cut.

    Args:
        name: of the number.
        low, high: values outside are clipped.
        intervals: how many.
        sqrt_spacing: cut at equal steps of its square root, so finer near 0, on either side.
    """

    name: str
    low: float
    high: float
    intervals: int
    sqrt_spacing: bool = msgspec.field(default=True, name="is_rooted")  # the name in saved policies


class TileCoder:
    """Grids over the same numbers.

    Args:
        axes: how each number is cut.
        tilings: how many grids; shifted by 1, 3, 5, ... parts of an interval in the first, second, third number.

    Raises:
        ParameterError: an axis is empty, or there are no tilings, or too many tiles.

    >>> coder = TileCoder([Axis("speed_mps", -4.0, 4.0, 4)], tilings=2)
    >>> coder.tiles(np.array([[0.5], [0.9], [100.0]])).tolist()
    [[2, 8], [2, 8], [3, 9]]
    """

    def __init__(self, axes: Sequence[Axis], tilings: int) -> None:
        for axis in axes:
            if (
                not (math.isfinite(axis.low) and math.isfinite(axis.high) and axis.low < axis.high)
                or axis.intervals < 1
            ):
                raise ParameterError(f"The axis {axis} is empty.", fix="low below high, and one interval or more.")
        self.axes: tuple[Axis, ...] = tuple(axes)
        self.tilings: int = tilings
        sizes = [axis.intervals + 1 for axis in axes]  # one more, as all but the first grid are shifted
        self.count: int = tilings * math.prod(sizes)
        if not axes or tilings < 1 or self.count > MAX_TILES:
            raise ParameterError(
                f"{tilings} grids of {math.prod(sizes)} tiles.",
                fix=f"1 to {MAX_TILES} tiles in all, of one number or more.",
            )
        self._has_sqrt_spacing = np.array([axis.sqrt_spacing for axis in axes])
        self._low, self._high = self._spaced(np.array([(axis.low, axis.high) for axis in axes]).T)
        self._intervals = np.array([axis.intervals for axis in axes])
        odd = 2 * np.arange(len(axes)) + 1
        self._shifts = (np.arange(tilings)[:, None] * odd % tilings) / tilings
        self._strides = np.cumprod([1, *sizes[:-1]])
        self._firsts = np.arange(tilings) * math.prod(sizes)

    def tiles(self, observations: Floats) -> Ints:
        """Return the tiles of observations, shape (n, axes), as numbers of shape (n, tilings)."""
        shares = np.clip((self._spaced(observations) - self._low) / (self._high - self._low), 0.0, 1.0 - 1e-9)
        places = (shares * self._intervals)[:, None, :] + self._shifts
        tiles: Ints = places.astype(np.int64) @ self._strides + self._firsts
        return tiles

    def _spaced(self, values: Floats) -> Floats:
        return np.where(self._has_sqrt_spacing, np.sign(values) * np.sqrt(np.abs(values)), values)


class TiledValues:
    """What actions are worth, by the tiles of a coder; at first nothing.

    Attributes:
        weights: shape (tiles, actions); a value is the sum over the tiles.
        visits: shape (tiles, actions), how often a weight was learned.
    """

    def __init__(self, coder: TileCoder, actions: int) -> None:
        self.coder: TileCoder = coder
        self.weights: Floats = np.zeros((coder.count, actions))
        self.visits: Ints = np.zeros((coder.count, actions), np.int64)

    def of(self, tiles: Ints) -> Floats:
        """Return the values of all actions, shape (n, actions), where the tiles are, shape (n, tilings)."""
        values: Floats = self.weights.take(tiles, axis=0).sum(axis=1)  # a third of the time of `weights[tiles]`
        return values

    def best(self, observations: Floats) -> Ints:
        """Return the action that is worth most for each observation, shape (n,); the first of several."""
        chosen: Ints = np.argmax(self.of(self.coder.tiles(observations)), axis=1)
        return chosen

    def learn(self, tiles: Ints, actions: Ints, targets: Floats, min_step_size: float) -> None:
        """Move values towards targets; of several for one weight, by their mean.

        Args:
            tiles: where, shape (n, tilings).
            actions: of which, shape (n,).
            targets: what they should have been, shape (n,).
            min_step_size: minimum step size of an update; at first nearly 1, and less from visit to visit.
        """
        tilings = tiles.shape[1]
        places = tiles * self.weights.shape[1] + actions[:, None]
        weights, visits = self.weights.reshape(-1), self.visits.reshape(-1)
        misses = np.repeat((targets - weights[places].sum(axis=1)) / tilings, tilings)
        places = places.ravel()
        counts = np.bincount(places, minlength=len(weights))
        sums = np.bincount(places, misses, minlength=len(weights))
        hit = np.flatnonzero(counts > 0)  # of booleans: a tenth of the time
        visits[hit] += counts[hit]
        steps = np.maximum(min_step_size, (1.0 + visits[hit] / 30.0) ** -0.7)
        weights[hit] += steps * sums[hit] / counts[hit]


def explore(values: Floats, epsilon: float, rng: np.random.Generator) -> Ints:
    """Return the action of the highest value in each row, with probability epsilon a random one."""
    actions: Ints = np.argmax(values, axis=1)
    explores = rng.random(len(actions)) < epsilon
    actions[explores] = rng.integers(0, values.shape[1], int(explores.sum()))
    return actions
