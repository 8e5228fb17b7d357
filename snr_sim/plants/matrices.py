"""Products and inverses of small matrices, with the same last bits on every processor.

numpy leaves `@`, `dot` and `linalg` to OpenBLAS, which picks other code for other processors: with and without fused
multiplication, in another order of additions. The results differ in their last bits, and a dive at the surface or in
contact with something ended in another trace. The functions here round after each operation, in one order.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from snr_sim.plants.vehicle import Matrix
from snr_sim.prelude.errors import ParameterError


def product(one: NDArray[np.float64], other: NDArray[np.float64], out: Matrix | None = None) -> Matrix:
    """Return the product of two matrices of shapes (n, k) and (k, m).

    Args:
        one: left factor.
        other: right factor.
        out: of shape (n, m), takes the product if given; may be neither factor.

    >>> product(np.array([[1.0, 2.0]]), np.array([[3.0], [4.0]])).tolist()
    [[11.0]]
    """
    total: Matrix = np.add.reduce(one[:, :, None] * other, axis=1, out=out)
    return total


def inverse(matrix: NDArray[np.float64]) -> Matrix:
    """Return the inverse of a symmetric positive definite matrix, such as one of mass.

    Without pivoting: for such a matrix Gauss and Jordan's elimination is stable in any order.

    Raises:
        ParameterError: the matrix is not positive definite.

    Source: Higham, Accuracy and Stability of Numerical Algorithms (2nd ed., 2002), section 10.1 and 14.4.

    >>> inverse(np.array([[2.0, 1.0], [1.0, 1.0]])).tolist()
    [[1.0, -1.0], [-1.0, 2.0]]
    """
    rows: list[list[float]] = matrix.tolist()
    for k, pivot_row in enumerate(rows):
        pivot = pivot_row[k]
        if not pivot > 0.0:
            raise ParameterError(
                f"The matrix {matrix.tolist()} is not positive definite.", fix="correct masses and inertias."
            )
        pivot_row[k] = 1.0
        pivot_row[:] = [value / pivot for value in pivot_row]
        for row in rows:
            factor = row[k]
            if row is not pivot_row and factor:
                row[k] = 0.0
                row[:] = [value - factor * by for value, by in zip(row, pivot_row, strict=True)]
    return np.array(rows)
