"""Three velocities of a body in water, one step on: surge, heave and pitch, as laws of momentum in the world's frame.

pymunk has one mass for all directions; in water it differs by direction. A body under water has the momentum
(P, L) = M (u, w, q), where M is its own mass and the added one, 3 x 3 in the body's frame, so P need not point where
the body moves. Seen from the water, which moves as a whole, the laws are

    P' = force,   L' = moment - (v x P)          P in the world's frame, L about the body's origin

The last term is the moment of Munk; nothing else of C(nu) is left to write down. It is another form of the
equation of `hydrodynamics.py`, which is why the two can be compared.

The step: half a drift with the old velocity, momentum by the forces in the middle, half a drift with the new one.
Velocities in the middle are means of old and new, found in a few rounds. Where nothing acts, momentum is kept to what
the rounds leave, and errors shrink with dt squared.

Frames: the plane is x forward (east), z up; pitch turns about y, nose down positive, as in the body frame FLU.

Source: Lamb, Hydrodynamics (6th ed., 1932), articles 124 and 126: Kirchhoff's equations.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from snr_sim.plants.matrices import inverse
from snr_sim.plants.urov.hydrodynamics import format_velocities
from snr_sim.plants.urov.vehicle import Vehicle
from snr_sim.prelude.errors import PlantError

PLANE = (0, 2, 4)  # surge, heave and pitch among the six axes
ITERATIONS = 4  # with three, momentum that is left alone drifts by 3e-4 in 20 s at 10 ms, with four by 2e-7
TOLERANCE = 1e-6  # m/s, rad/s: a round that changes the velocity by more is not the last
MAX_ITERATIONS, RELAXATION = 100, 0.2  # relaxation factor, where drag is so large that rounds overshoot
DIVERGED = 1e9  # the same, of a round that leads nowhere

Three: TypeAlias = tuple[float, float, float]  # along x and z, then about y


class Water2D:
    """Mass and damping of one body in its plane of symmetry."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._linear = [vehicle.linear_damping[axis] for axis in PLANE]
        self._quadratic = [vehicle.quadratic_damping[axis] for axis in PLANE]

    def set_mass(self, mass: NDArray[np.float64], wet: float) -> None:
        """Set the mass of body and water, 6 x 6, of which the plane's part is used, and its wet fraction."""
        self._wet = wet
        block = mass[np.ix_(PLANE, PLANE)]
        self._mass: list[list[float]] = block.tolist()
        self._inverse: list[list[float]] = inverse(block).tolist()

    def advance(
        self,
        velocity: Three,
        pitch: float,
        wrench: Three,
        net_n: float,
        static_moment_nm: tuple[float, float],
        dt_s: float,
    ) -> Three:
        """Return the velocity through the water a step later.

        Args:
            velocity: at the step's begin, world frame [m/s], and rate of pitch [rad/s].
            pitch: at the step's begin.
            wrench: along x, z and about y in the middle of the step, body frame.
            net_n: buoyancy less weight.
            static_moment_nm: x and z of buoyancy times its position less weight times its position [N m], body frame.
            dt_s: length of the step.

        Raises:
            PlantError: the step is too long for a motion so violent, or a number is not finite.
        """
        vx0, vz0, q0 = velocity
        (m11, m12, m13), (_, m22, m23), (_, _, m33) = self._mass
        (i11, i12, i13), (_, i22, i23), (_, _, i33) = self._inverse
        (lin_u, lin_w, lin_q), (quad_u, quad_w, quad_q), wet = self._linear, self._quadratic, self._wet
        cos, sin = math.cos(pitch), math.sin(pitch)
        u, w = cos * vx0 - sin * vz0, sin * vx0 + cos * vz0
        p1, p3 = m11 * u + m12 * w + m13 * q0, m12 * u + m22 * w + m23 * q0
        momentum_x, momentum_z, momentum_q = cos * p1 + sin * p3, cos * p3 - sin * p1, m13 * u + m23 * w + m33 * q0
        middle = pitch + 0.5 * dt_s * q0
        cos_m, sin_m = math.cos(middle), math.sin(middle)
        x, z, moment = (
            wrench[0] - net_n * sin_m,
            wrench[1] + net_n * cos_m,
            wrench[2] - static_moment_nm[1] * sin_m - static_moment_nm[0] * cos_m,
        )
        vx, vz, q = velocity
        for i in range(MAX_ITERATIONS):
            vx_m, vz_m, q_m = 0.5 * (vx0 + vx), 0.5 * (vz0 + vz), 0.5 * (q0 + q)
            u, w = cos_m * vx_m - sin_m * vz_m, sin_m * vx_m + cos_m * vz_m
            p1, p3 = m11 * u + m12 * w + m13 * q_m, m12 * u + m22 * w + m23 * q_m
            force_1 = x - wet * u * (lin_u + quad_u * abs(u))
            force_3 = z - wet * w * (lin_w + quad_w * abs(w))
            turning = moment - wet * q_m * (lin_q + quad_q * abs(q_m)) + p3 * u - p1 * w
            px = momentum_x + dt_s * (cos_m * force_1 + sin_m * force_3)
            pz = momentum_z + dt_s * (cos_m * force_3 - sin_m * force_1)
            pq = momentum_q + dt_s * turning
            end = middle + 0.5 * dt_s * q
            cos, sin = math.cos(end), math.sin(end)
            p1, p3 = cos * px - sin * pz, sin * px + cos * pz
            u, w = i11 * p1 + i12 * p3 + i13 * pq, i12 * p1 + i22 * p3 + i23 * pq
            to_x, to_z, to_q = cos * u + sin * w - vx, cos * w - sin * u - vz, i13 * p1 + i23 * p3 + i33 * pq - q
            gap = abs(to_x) + abs(to_z) + abs(to_q)
            if not gap < DIVERGED:  # also a NaN
                break
            # So much drag that each round overshoots: relax.
            share = 1.0 if i < ITERATIONS else RELAXATION
            vx, vz, q = vx + share * to_x, vz + share * to_z, q + share * to_q
            if i >= ITERATIONS - 1 and gap < TOLERANCE:
                return vx, vz, q
        u, w = cos_m * vx0 - sin_m * vz0, sin_m * vx0 + cos_m * vz0
        raise PlantError(
            f"At {format_velocities((u, 0.0, w, 0.0, q0, 0.0))} through the water, a step of {dt_s:g} s is too long "
            "for what pushes and drags.",
            fix="look at the last commands and at the vehicle's numbers; or take a shorter step.",
        )

    def subtract_impulse(self, velocity: Three, pitch: float, momentum: Three) -> Three:
        """Return the velocity (world frame) of a body that has given away some momentum (body frame)."""
        x, z, turn = momentum
        du, dw, dq = (a * x + b * z + c * turn for a, b, c in self._inverse)
        cos, sin = math.cos(pitch), math.sin(pitch)
        return velocity[0] - cos * du - sin * dw, velocity[1] + sin * du - cos * dw, velocity[2] - dq

    def mobility(self, pitch: float) -> list[list[float]]:
        """Return the inverse of the mass in the world's frame, 3 x 3: what an impulse does to the velocity."""
        cos, sin = math.cos(pitch), math.sin(pitch)
        (i11, i12, i13), (_, i22, i23), (_, _, i33) = self._inverse
        x1, x2, x3 = cos * i11 + sin * i12, cos * i12 + sin * i22, cos * i13 + sin * i23
        z1, z2, z3 = cos * i12 - sin * i11, cos * i22 - sin * i12, cos * i23 - sin * i13
        xz = cos * x2 - sin * x1
        return [[cos * x1 + sin * x2, xz, x3], [xz, cos * z2 - sin * z1, z3], [x3, z3, i33]]
