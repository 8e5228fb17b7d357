"""Thrust allocation: the thrust of each thruster, so that together they produce a required wrench.

    required wrench --> thrusts of minimum norm --> thrusts scaled to the thrusters' limits

The first step is the pseudo-inverse of the thrusters' matrix. The second keeps the direction of the wrench: if one
thruster saturates, all thrusts are scaled down. The vehicle is then slower than commanded but moves in the commanded
direction. `priority_axes` gives priority to axes that should not suffer from the others, such as heave and yaw.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from operator import mul
from typing import TYPE_CHECKING, NamedTuple

from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest
from snr_sim.prelude.sums import dot_product, ordered_sum
from snr_sim.prelude.wrench import AXES, thruster_matrix, unactuated_axes

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_ROUNDING = 1e-12  # a thruster's effectiveness below this is a rounding error of the other directions


class AllocationResult(NamedTuple):
    """Result of an allocation.

    Args:
        thrusts_n: of each thruster, positive ahead, within its limits.
        scale: fraction of the required wrench that they produce, 0 to 1; with `priority_axes`, of the axes
            without priority.
        unactuated: the axes with a required component that the thrusters cannot produce.
    """

    thrusts_n: list[float]
    scale: float
    unactuated: tuple[str, ...]


class Allocation:
    """Thrust allocation of one vehicle.

    Args:
        matrix: six rows (`prelude/wrench.py`), column i is the wrench of thruster i at 1 N.
        limits_n: minimum (negative, astern) and maximum thrust; one pair for all thrusters, or one for each.
        priority_axes: axes with priority; the others get the remaining thrust.
        failed_thrusters: indices of thrusters that do not work. The others compensate as far as possible.

    Raises:
        ParameterError: the matrix or a limit is invalid, or all thrusters have zero effect.
        UnknownNameError: `priority_axes` names an axis that does not exist.
        MissingExtraError: numpy is not installed.

    >>> catamaran = Allocation([[1, 1], [0, 0], [0, 0], [0, 0], [0, 0], [-0.5, 0.5]], limits_n=(-10, 20))
    >>> catamaran.unactuated
    ('sway', 'heave', 'roll', 'pitch')
    >>> [round(thrust, 6) for thrust in catamaran.allocate([20.0, 0.0, 0.0, 0.0, 0.0, 5.0]).thrusts_n]
    [5.0, 15.0]
    >>> catamaran.allocate([80.0, 0.0, 0.0, 0.0, 0.0, 0.0]).scale
    0.5
    """

    def __init__(
        self,
        matrix: Sequence[Sequence[float]] | NDArray[np.float64],
        limits_n: tuple[float, float] | Sequence[tuple[float, float]],
        priority_axes: Sequence[str] = (),
        failed_thrusters: Sequence[int] = (),
    ) -> None:
        given = thruster_matrix(matrix)
        self.count: int = given.shape[1]
        for axis in priority_axes:
            _check_axis(axis)
        for number in failed_thrusters:
            if not 0 <= number < self.count:
                raise ParameterError(f"There is no thruster {number!r}.", fix=f"0 to {self.count - 1}.")
        given[:, list(failed_thrusters)] = 0.0
        self.unactuated: tuple[str, ...] = unactuated_axes(given)
        if self.unactuated == AXES:
            raise ParameterError(
                "No thruster pushes anywhere: their matrix is all zeros.", fix="give each a direction."
            )
        self._given = given.tolist()
        self._limits = _checked_limits(limits_n, self.count)
        rest = [i for i, axis in enumerate(AXES) if axis not in priority_axes]
        self._groups = (
            [[AXES.index(axis) for axis in priority_axes], rest] if priority_axes and rest else [list(range(len(AXES)))]
        )
        inverse = _inverse(self._given, self.unactuated)
        self._of_wrench = [[[row[i] for i in group] for row in inverse] for group in self._groups]

    def require(self, *axes: str) -> None:
        """Check that the thrusters can produce a force along or a moment about these axes.

        Raises:
            ParameterError: they cannot; the message names the axes that are missing.
            UnknownNameError: an axis does not exist.
        """
        for axis in axes:
            _check_axis(axis)
        unactuated = [axis for axis in axes if axis in self.unactuated]
        if unactuated:
            raise ParameterError(
                f"No combination of the {self.count} thrusters pushes {' or '.join(unactuated)} by itself.",
                fix="ask for " + ", ".join(axis for axis in AXES if axis not in self.unactuated) + " only.",
            )

    def allocate(self, wrench: Sequence[float]) -> AllocationResult:
        """Return thrusts that produce the required wrench, or as much of it as possible in its direction.

        Args:
            wrench: six numbers, [N] and [N m], body frame.

        Raises:
            ParameterError: the wrench does not have six finite numbers.
        """
        if len(wrench) != len(AXES) or not math.isfinite(ordered_sum(wrench)):
            raise ParameterError(
                f"A wrench of {list(wrench)!r}.", fix="six finite numbers: " + ", ".join(AXES) + " [N, N m]."
            )
        thrusts = [0.0] * self.count
        scale = 1.0
        for group, of_wrench in zip(self._groups, self._of_wrench, strict=True):
            requested = [wrench[i] for i in group]
            more = [dot_product(row, requested) for row in of_wrench]
            scale = self._room(thrusts, more)
            thrusts = [thrust + scale * extra for thrust, extra in zip(thrusts, more, strict=True)]
        unactuated = tuple(axis for axis in self.unactuated if wrench[AXES.index(axis)] != 0.0)
        return AllocationResult(thrusts, scale, unactuated)

    def wrench_of(self, thrusts_n: Sequence[float]) -> list[float]:
        """Return the wrench that these thrusts produce together."""
        return [dot_product(row, thrusts_n) for row in self._given]

    def _room(self, thrusts: list[float], more: list[float]) -> float:
        """Return the largest fraction, up to 1, of `more` that can be added to thrusts within all limits."""
        scale = 1.0
        for thrust, extra, (min_n, max_n) in zip(thrusts, more, self._limits, strict=True):
            if extra > 0.0 and thrust + scale * extra > max_n:
                scale = (max_n - thrust) / extra
            elif extra < 0.0 and thrust + scale * extra < min_n:
                scale = (min_n - thrust) / extra
        return max(0.0, scale)


def _inverse(given: list[list[float]], unactuated: tuple[str, ...]) -> list[list[float]]:
    """Return the pseudo-inverse, n x 6, of the actuated axes; the columns of the other axes are zeros.

    Without the unactuated axes the remaining rows are independent, so their requirements are met exactly. With them,
    least squares would trade a little surge for a little less of the pitch that it causes.

    For independent rows R it is R^T (R R^T)^-1. That is computed in fractions and rounded once, at the end: the result
    of a linear algebra library differs in its last bits from one processor to another, and so would every trace.
    """
    reached = [i for i, axis in enumerate(AXES) if axis not in unactuated]
    rows = [[Fraction(value) for value in given[i]] for i in reached]
    # R R^T X = R, by Gauss and Jordan.
    solved = [[sum(map(mul, row, other)) for other in rows] + row for row in rows]  # exact: fractions
    for k, pivot_row in enumerate(solved):
        pivot_row[:] = [value / pivot_row[k] for value in pivot_row]
        for row in solved:
            if row is not pivot_row and row[k]:
                row[:] = [value - row[k] * by for value, by in zip(row, pivot_row, strict=True)]
    inverse = [[0.0] * len(AXES) for _ in given[0]]
    for axis, row in zip(reached, solved, strict=True):
        for thruster, value in zip(inverse, row[len(rows) :], strict=True):
            thruster[axis] = float(value) if abs(value) > _ROUNDING else 0.0
    return inverse


def _check_axis(axis: str) -> None:
    if axis not in AXES:
        raise UnknownNameError(f"There is no axis '{axis}'.", fix=suggest(axis, AXES))


def _checked_limits(
    limits_n: tuple[float, float] | Sequence[tuple[float, float]], count: int
) -> list[tuple[float, float]]:
    pairs: list[tuple[float, float]] = (
        [limits_n] * count if len(limits_n) == 2 and isinstance(limits_n[0], (int, float)) else list(limits_n)  # type: ignore[list-item, arg-type]
    )
    if len(pairs) != count:
        raise ParameterError(f"Limits for {len(pairs)} thrusters of {count}.", fix="one pair for all, or one for each.")
    for min_n, max_n in pairs:
        if not (math.isfinite(min_n) and math.isfinite(max_n) and min_n <= 0.0 <= max_n):
            raise ParameterError(f"A thruster with the limits {min_n!r} and {max_n!r} N.", fix="such as (-40.0, 51.0).")
    return pairs
