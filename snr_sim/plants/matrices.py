"""Products and inverses of small matrices, with the same last bits on every processor.

numpy leaves `@`, `dot` and `linalg` to OpenBLAS, which picks other code for other processors: with and without fused
multiplication, in another order of additions. The results differ in their last bits, and a dive at the surface or in
contact with something ended in another trace. The functions here round after each operation, in one order.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from snr_sim.plants.urov.vehicle import Matrix
from snr_sim.prelude.errors import ParameterError


def product(one: NDArray[np.float64], other: NDArray[np.float64]) -> Matrix:
    """Return the product of two matrices of shapes (n, k) and (k, m).

    >>> product(np.array([[1.0, 2.0]]), np.array([[3.0], [4.0]])).tolist()
    [[11.0]]
    """
    total: Matrix = np.add.reduce(one[:, :, None] * other, axis=1)
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
            message = f"The matrix {matrix.tolist()} is not positive definite."
            raise ParameterError(message, fix="correct masses and inertias.")
        pivot_row[k] = 1.0
        pivot_row[:] = [value / pivot for value in pivot_row]
        for row in rows:
            factor = row[k]
            if row is not pivot_row and factor:
                row[k] = 0.0
                row[:] = [value - factor * by for value, by in zip(row, pivot_row, strict=True)]
    return np.array(rows)


def mujoco_mass_matrix(mass: Matrix, rotation: Sequence[float]) -> list[float]:
    """Return the mass of a free body for linear velocities in the world's axes and angular ones in the body's.

    With the mass made of blocks of 3 x 3, A and B above B^T and C, and the rotation R, that is R A R^T and R B above
    B^T R^T and C. Written out, for it is needed in each step in contact: `product` takes twice the time.

    Args:
        mass: 6 x 6, symmetric, in the body's axes.
        rotation: nine numbers row by row, from the body's axes to the world's.

    Returns:
        21 numbers, the lower triangle row by row, as MuJoCo keeps it.
    """
    a, b, c, d, e, f, g, h, i = rotation
    (
        (m11, _, _, _, _, _),
        (m21, m22, _, _, _, _),
        (m31, m32, m33, _, _, _),
        (m41, m42, m43, m44, _, _),
        (m51, m52, m53, m54, m55, _),
        (m61, m62, m63, m64, m65, m66),
    ) = mass.tolist()
    x1, x2, x3 = a * m11 + b * m21 + c * m31, a * m21 + b * m22 + c * m32, a * m31 + b * m32 + c * m33
    y1, y2, y3 = d * m11 + e * m21 + f * m31, d * m21 + e * m22 + f * m32, d * m31 + e * m32 + f * m33
    z1, z2, z3 = g * m11 + h * m21 + i * m31, g * m21 + h * m22 + i * m32, g * m31 + h * m32 + i * m33
    return [
        x1 * a + x2 * b + x3 * c,
        y1 * a + y2 * b + y3 * c, y1 * d + y2 * e + y3 * f,
        z1 * a + z2 * b + z3 * c, z1 * d + z2 * e + z3 * f, z1 * g + z2 * h + z3 * i,
        m41 * a + m42 * b + m43 * c, m41 * d + m42 * e + m43 * f, m41 * g + m42 * h + m43 * i, m44,
        m51 * a + m52 * b + m53 * c, m51 * d + m52 * e + m53 * f, m51 * g + m52 * h + m53 * i, m54, m55,
        m61 * a + m62 * b + m63 * c, m61 * d + m62 * e + m63 * f, m61 * g + m62 * h + m63 * i, m64, m65, m66,
    ]  # fmt: skip
