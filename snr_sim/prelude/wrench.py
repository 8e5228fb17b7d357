"""Wrenches: force and moment in one vector, and which of their axes a set of thrusters can produce at all.

A wrench has six numbers in the body frame (x forward, y left, z up): force along x, y, z [N], then moment about x, y, z
[N m]. Thrusters are a matrix of six rows: column i is the wrench of thruster i at 1 N.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from snr_sim.prelude.errors import MissingExtraError, ParameterError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

AXES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
ARM_M = 0.15  # compares moments with forces: about the arm of a small vehicle's thrusters
_RANK_TOLERANCE = 1e-6  # values below this fraction of the largest are rounding errors


def thruster_matrix(columns_by_axis: Sequence[Sequence[float]] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return thrusters as an array of shape (6, n), checked.

    Raises:
        ParameterError: it does not have six rows of equal length, or a value is not a finite number.
        MissingExtraError: numpy is not installed.
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


def unactuated_axes(matrix: NDArray[np.float64]) -> tuple[str, ...]:
    """Return the axes that thrusters cannot produce independently: one for each missing rank of their matrix.

    Thrusters below the centre push the nose up whenever they push ahead. If no thruster can counter that, pitch is
    missing and not surge: of the coupled axes, the one that the thrusters reach least, with moments scaled by `ARM_M`.
    """
    np = _numpy()
    scaled = matrix * np.array([[1.0]] * 3 + [[1.0 / ARM_M]] * 3)
    rows = list(range(len(AXES)))
    while True:
        left, sizes, _ = np.linalg.svd(scaled[rows])  # decides no run: rank, far from its limit
        rank = int((sizes > _RANK_TOLERANCE * max(1.0, float(sizes.max(initial=0.0)))).sum())
        if rank == len(rows):
            return tuple(axis for i, axis in enumerate(AXES) if i not in rows)
        out_of_reach = (left[:, rank:] ** 2).sum(axis=1)  # the fraction of each axis that no thrust can produce
        del rows[int(out_of_reach.argmax())]
        if not rows:
            return AXES


def _numpy() -> Any:
    try:
        import numpy as np  # slow to import, and only vehicles with thrusters need it
    except ImportError:
        raise MissingExtraError("numpy", "sim") from None
    return np
