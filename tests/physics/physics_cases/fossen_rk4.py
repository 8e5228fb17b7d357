"""Reference for the plant: Fossen's equation as in the book, in matrices, solved by Runge and Kutta.

It shares nothing with the plant but the vehicle's numbers. Rigid body and added mass keep a C of their own, the
current enters by its derivative, and the scheme is another (fourth order). No surface, no contacts, no MuJoCo.

Source: Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2011): C by (3.46), current
by (8.1) to (8.4).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from snr_sim.plants.urov.vehicle import Vehicle

Array = NDArray[np.float64]


def cross(vector: Array) -> Array:
    """Return the matrix that takes the cross product with a vector."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def coriolis(mass: Array, nu: Array) -> Array:
    """Return the skew-symmetric C of a 6 x 6 mass matrix."""
    linear = mass[:3, :3] @ nu[:3] + mass[:3, 3:] @ nu[3:]
    angular = mass[3:, :3] @ nu[:3] + mass[3:, 3:] @ nu[3:]
    c = np.zeros((6, 6))  # np.block takes 30 us, and this is called 64 000 times
    c[:3, 3:] = c[3:, :3] = -cross(linear)
    c[3:, 3:] = -cross(angular)
    return c


def rotation(q: Array) -> Array:
    """Return the matrix of a quaternion (w, x, y, z), by Rodrigues."""
    q = q / np.linalg.norm(q)
    turn = cross(q[1:])
    return np.eye(3) + 2.0 * q[0] * turn + 2.0 * turn @ turn


class Fossen:
    """One vehicle in water without a surface.

    Args:
        vehicle: its numbers, as trimmed.
        current: velocity of the water, world frame.
        density_kgm3: of the water.
        gravity_mps2: pulls down.
    """

    def __init__(
        self, vehicle: Vehicle, current: Array | None = None, density_kgm3: float = 1000.0, gravity_mps2: float = 9.81
    ) -> None:
        place = cross(np.array(vehicle.centre_of_mass_m))
        inertia = vehicle.inertia_kgm2 - vehicle.mass_kg * place @ place
        mass = vehicle.mass_kg
        self.rigid = np.block([[mass * np.eye(3), -mass * place], [mass * place, inertia]])
        self.added = vehicle.added_mass
        self.linear = np.diag(vehicle.linear_damping)
        self.quadratic = np.array(vehicle.quadratic_damping)
        weight, buoyancy = mass * gravity_mps2, density_kgm3 * gravity_mps2 * vehicle.volume_m3
        middle = cross(np.array(vehicle.centre_of_buoyancy_m))
        # Force and moment of weight and buoyancy, by the direction that is up.
        self.restoring = np.vstack([(buoyancy - weight) * np.eye(3), buoyancy * middle - weight * place])
        self.current = np.zeros(3) if current is None else np.array(current)
        self.inverse = np.linalg.inv(self.rigid + self.added)

    def rate(self, state: Array, wrench: Array) -> Array:
        """Return the derivative of (position, quaternion, nu), 13 numbers."""
        q, nu = state[3:7], state[7:]
        turn = rotation(q)
        flow = turn.T @ self.current
        nu_r = nu - np.concatenate([flow, np.zeros(3)])
        flow_rate = np.concatenate([cross(flow) @ nu[3:], np.zeros(3)])
        restoring = self.restoring @ turn[2]  # up is the third row: what the world's z is in the body
        damping = self.linear + np.diag(self.quadratic * np.abs(nu_r))
        force = wrench + restoring - coriolis(self.rigid, nu) @ nu - coriolis(self.added, nu_r) @ nu_r
        nu_rate = self.inverse @ (force - damping @ nu_r + self.added @ flow_rate)
        p, q1, q2 = nu[3:]
        spin = 0.5 * np.array(
            [[0.0, -p, -q1, -q2], [p, 0.0, q2, -q1], [q1, -q2, 0.0, p], [q2, q1, -p, 0.0]]
        )  # right multiplication by the rate
        return np.concatenate([turn @ nu[:3], spin @ q, nu_rate])

    def run(self, state: Array, wrench_at: Callable[[float], Array], time_s: float, step_s: float = 0.002) -> Array:
        """Return the state after a time; the wrench is held for each step at what it is in its middle."""
        for i in range(round(time_s / step_s)):
            wrench = wrench_at((i + 0.5) * step_s)
            k1 = self.rate(state, wrench)
            k2 = self.rate(state + 0.5 * step_s * k1, wrench)
            k3 = self.rate(state + 0.5 * step_s * k2, wrench)
            k4 = self.rate(state + step_s * k3, wrench)
            state = state + step_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            state[3:7] /= np.linalg.norm(state[3:7])
        return state
