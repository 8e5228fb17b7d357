"""Wrenches: a force and a moment in one, and which of their axes a set of thrusters can push at all.

A wrench has six numbers in the body frame (x forward, y left, z up): force along x, y, z [N], then moment about x, y, z
[N m]. Thrusters are a matrix of six rows: column i is the wrench of thruster i at 1 N.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from snr_sim.prelude.errors import MissingExtra, ParameterError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

AXES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
ARM_M = 0.15  # compares moments with forces: about the arm of a small vehicle's thrusters
_NOTHING = 1e-6  # a size below this share of the greatest is rounding


def thruster_matrix(columns_by_axis: Sequence[Sequence[float]] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return thrusters as an array of shape (6, n), checked.

    Raises:
        ParameterError: it has not six rows of equal length, or holds what is no finite number.
        MissingExtra: numpy is not installed.
    """
    np = _numpy()
    try:
        matrix = np.array(columns_by_axis, dtype=float)
    except (TypeError, ValueError) as error:
        raise ParameterError(f"Thrusters are a matrix of six rows of numbers ({error}).", fix="6 x n.") from error
    if matrix.ndim != 2 or len(matrix) != len(AXES) or matrix.shape[1] < 1 or not np.isfinite(matrix).all():
        raise ParameterError(
            f"Thrusters are a matrix of six rows of finite numbers, not one of shape {matrix.shape}.",
            fix="a row for each of " + ", ".join(AXES) + "; a column for each thruster.",
        )
    return matrix  # type: ignore[no-any-return]


def lacking_axes(matrix: NDArray[np.float64]) -> tuple[str, ...]:
    """Return the axes that thrusters cannot push by themselves: one for each rank that their matrix lacks.

    Thrusters that sit under the centre push the nose up whenever they push ahead. If nothing can undo that, it is pitch
    that lacks and not surge: of the axes that hang together, the one that the thrusters reach least, moments counted at
    `ARM_M`.
    """
    np = _numpy()
    scaled = matrix * np.array([[1.0]] * 3 + [[1.0 / ARM_M]] * 3)
    rows = list(range(len(AXES)))
    while True:
        left, sizes, _ = np.linalg.svd(scaled[rows])  # decides no run: rank, far from its limit
        rank = int((sizes > _NOTHING * max(1.0, float(sizes.max(initial=0.0)))).sum())
        if rank == len(rows):
            return tuple(axis for i, axis in enumerate(AXES) if i not in rows)
        out_of_reach = (left[:, rank:] ** 2).sum(axis=1)  # the share of each axis that no thrust can give
        del rows[int(out_of_reach.argmax())]
        if not rows:
            return AXES


def _numpy() -> Any:
    try:
        import numpy as np  # slow to import, and only who has thrusters needs it
    except ImportError:
        raise MissingExtra("numpy", "sim") from None
    return np
