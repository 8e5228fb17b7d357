"""Six velocities of a body in water, one step on: Fossen's equation, solved for the middle of the step.

    M nu' + C(nu) nu + D(nu) nu = wrench + weight and buoyancy,          M = rigid body + wet share of the added mass

`nu` is the velocity relative to the water, in the body frame. That rigid body and added mass can share one M and one C
is exact: in water that moves as a whole, the laws of motion are those of still water, seen from the water.
So the off-diagonal terms of a current, such as M_A (w x v_r), are in here without being written down.

C is not written down either. M nu is the momentum (P, L) of body and water; seen from a turning body it changes by

    force  P x w        moment  L x w + P x v

which is -C(nu) nu for any symmetric M (Kirchhoff's equations), the moment of Munk included.

Why the middle: the step (nu1 - nu0) / dt = a((nu0 + nu1) / 2) neither makes nor loses energy or momentum by itself,
since both are quadratic in nu, and its error shrinks with dt squared. With the velocity of the step's begin, energy
without damping grew by 73 % in 20 s at 10 ms. It is an equation for nu1, solved in rounds. Two are enough (1e-5 of that
energy are lost) when the first guess is good: the last acceleration, changed once more as it changed last.

The algebra of six numbers is written out, for speed; tests/plants/test_hydrodynamics.py has the same step in matrices.

Source: Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2011), chapters 3, 6 to 8; the scheme is the
implicit midpoint rule (Hairer, Lubich, Wanner: Geometric Numerical Integration, IV.2).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from snr_sim.plants.matrices import inverse
from snr_sim.plants.urov.vehicle import Matrix, Six, Vehicle
from snr_sim.prelude.errors import PlantError
from snr_sim.prelude.wrench import AXES

Three: TypeAlias = tuple[float, float, float]
Product: TypeAlias = Callable[[float, float, float, float, float, float], Six]

ITERATIONS, MAX_ITERATIONS = 2, 60
TOLERANCE = 1e-5  # m/s, rad/s: a round that changes the middle's velocity by more is not the last
RELAXATION = 0.2  # relaxation factor once rounds overshoot: converges up to a tenfold drag, which no vehicle meets
WET_STEPS = 4096  # with 64, space and plane differed by 5e-3 m/s at the surface, however short the step
AT_REST: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Hydrodynamics:
    """Mass and damping of one body, whose dry mass matrix is `rigid`, 6 x 6 about the origin of the body frame."""

    mass: Matrix  # 6 x 6, with the wet fraction of the added mass
    wet: float  # that fraction

    def __init__(self, vehicle: Vehicle, rigid: Matrix) -> None:
        self._added = vehicle.added_mass
        self._linear, self._quadratic = vehicle.linear_damping, vehicle.quadratic_damping
        self._rigid = rigid
        self._known: dict[int, tuple[Matrix, Product, Product]] = {}
        self.set_mass(rigid, 1.0)

    def set_mass(self, rigid: Matrix, wet: float) -> None:
        """Set the dry mass, or the fraction of the body that is in the water, 0 to 1.

        The fraction counts in steps of 1 / `WET_STEPS` here, so that the inverse of each mass is computed once.
        """
        if rigid is not self._rigid:
            self._rigid, self._known = rigid, {}
        step = round(wet * WET_STEPS)
        if step not in self._known:
            mass = rigid + step / WET_STEPS * self._added
            self._known[step] = mass, product_with(mass), product_with(inverse(mass))
        self.wet = wet = step / WET_STEPS
        self._drag = [wet * value for value in self._linear], [wet * value for value in self._quadratic]
        self.mass, self._momentum, self._acceleration = self._known[step]

    def subtract_impulse(self, nu: Sequence[float], momentum: Sequence[float]) -> Six:
        """Return the velocity of a body that has given away some momentum, body frame [N s, N m s]."""
        x, y, z, k, m, n = momentum
        u, v, w, p, q, r = nu
        du, dv, dw, dp, dq, dr = self._acceleration(x, y, z, k, m, n)
        return u - du, v - dv, w - dw, p - dp, q - dq, r - dr

    def advance(
        self,
        nu: Sequence[float],
        up_body: Three,
        wrench: Sequence[float],
        net_n: float,
        static_moment_nm: Three,
        guess: Six,
        dt_s: float,
    ) -> tuple[Six, Six]:
        """Return the velocity half a step on, and the acceleration of the whole step.

        Args:
            nu: velocity relative to the water at the step's begin, body frame.
            up_body: the world's upward direction then, body frame; it turns with the body during the step.
            wrench: of all else that acts, body frame.
            net_n: buoyancy less weight.
            static_moment_nm: buoyancy times its position less weight times its position [N m], body frame.
            guess: of the acceleration of this step.
            dt_s: length of the step; with 0, the acceleration is that of this moment.

        Raises:
            PlantError: the step is too long for a motion so violent, or a number is not finite.
        """
        u0, v0, w0, p0, q0, r0 = nu
        kx, ky, kz = up_body
        wrench_x, wrench_y, wrench_z, wrench_k, wrench_m, wrench_n = wrench
        arm_x, arm_y, arm_z = static_moment_nm
        (lin_u, lin_v, lin_w, lin_p, lin_q, lin_r), (quad_u, quad_v, quad_w, quad_p, quad_q, quad_r) = self._drag
        momentum, acceleration = self._momentum, self._acceleration
        half = 0.5 * dt_s
        au, av, aw, ap, aq, ar = guess
        for i in range(MAX_ITERATIONS):
            u, v, w = u0 + half * au, v0 + half * av, w0 + half * aw
            p, q, r = p0 + half * ap, q0 + half * aq, r0 + half * ar
            # The mean of `up_body` over the step, which solves up_body - up_body0 = half * (up_body x w).
            tx, ty, tz = half * p, half * q, half * r
            along = tx * kx + ty * ky + tz * kz
            shrink = 1.0 / (1.0 + tx * tx + ty * ty + tz * tz)
            up_x = (kx + ky * tz - kz * ty + along * tx) * shrink
            up_y = (ky + kz * tx - kx * tz + along * ty) * shrink
            up_z = (kz + kx * ty - ky * tx + along * tz) * shrink
            lin_1, lin_2, lin_3, ang_1, ang_2, ang_3 = momentum(u, v, w, p, q, r)
            x = wrench_x + net_n * up_x + lin_2 * r - lin_3 * q - u * (lin_u + quad_u * abs(u))
            y = wrench_y + net_n * up_y + lin_3 * p - lin_1 * r - v * (lin_v + quad_v * abs(v))
            z = wrench_z + net_n * up_z + lin_1 * q - lin_2 * p - w * (lin_w + quad_w * abs(w))
            k = (
                wrench_k + arm_y * up_z - arm_z * up_y
                + ang_2 * r - ang_3 * q + lin_2 * w - lin_3 * v - p * (lin_p + quad_p * abs(p))
            )  # fmt: skip
            m = (
                wrench_m + arm_z * up_x - arm_x * up_z
                + ang_3 * p - ang_1 * r + lin_3 * u - lin_1 * w - q * (lin_q + quad_q * abs(q))
            )  # fmt: skip
            n = (
                wrench_n + arm_x * up_y - arm_y * up_x
                + ang_1 * q - ang_2 * p + lin_1 * v - lin_2 * u - r * (lin_r + quad_r * abs(r))
            )  # fmt: skip
            if i < ITERATIONS - 1 and half > 0.0:
                au, av, aw, ap, aq, ar = acceleration(x, y, z, k, m, n)
                continue
            before = au, av, aw, ap, aq, ar
            au, av, aw, ap, aq, ar = found = acceleration(x, y, z, k, m, n)
            b1, b2, b3, b4, b5, b6 = before
            gap = abs(au - b1) + abs(av - b2) + abs(aw - b3) + abs(ap - b4) + abs(aq - b5) + abs(ar - b6)
            if half * gap < TOLERANCE:
                break
            # So much drag that each round overshoots: relax.
            au, av, aw, ap, aq, ar = (a + RELAXATION * (b - a) for a, b in zip(before, found, strict=True))
        else:
            raise PlantError(
                f"At {format_velocities(nu)} through the water, a step of {dt_s:g} s is too long for what pushes and "
                "drags.",
                fix="look at the last commands and at the vehicle's numbers; or take a shorter step.",
            )
        middle = u0 + half * au, v0 + half * av, w0 + half * aw, p0 + half * ap, q0 + half * aq, r0 + half * ar
        return middle, (au, av, aw, ap, aq, ar)


def format_velocities(nu: Sequence[float]) -> str:
    """Return six velocities with their names, for a message."""
    return ", ".join(f"{axis} {value:.3g}" for axis, value in zip(AXES, nu, strict=True)) + " (m/s, rad/s)"


def product_with(matrix: NDArray[np.floating[Any]]) -> Product:
    """Return the function that multiplies a 6 x 6 matrix with six numbers; a diagonal one much faster."""
    rows = matrix.tolist()
    if not (matrix - np.diag(np.diag(matrix))).any():
        d1, d2, d3, d4, d5, d6 = np.diag(matrix).tolist()
        return lambda a, b, c, d, e, f: (d1 * a, d2 * b, d3 * c, d4 * d, d5 * e, d6 * f)
    (
        (a11, a12, a13, a14, a15, a16),
        (a21, a22, a23, a24, a25, a26),
        (a31, a32, a33, a34, a35, a36),
        (a41, a42, a43, a44, a45, a46),
        (a51, a52, a53, a54, a55, a56),
        (a61, a62, a63, a64, a65, a66),
    ) = rows
    return lambda a, b, c, d, e, f: (
        a11 * a + a12 * b + a13 * c + a14 * d + a15 * e + a16 * f,
        a21 * a + a22 * b + a23 * c + a24 * d + a25 * e + a26 * f,
        a31 * a + a32 * b + a33 * c + a34 * d + a35 * e + a36 * f,
        a41 * a + a42 * b + a43 * c + a44 * d + a45 * e + a46 * f,
        a51 * a + a52 * b + a53 * c + a54 * d + a55 * e + a56 * f,
        a61 * a + a62 * b + a63 * c + a64 * d + a65 * e + a66 * f,
    )
