"""Pose and velocity of the vehicle: the state that all its parts share."""

from __future__ import annotations

from snr_sim.plants.attitude import Quaternion, Rotation
from snr_sim.plants.urov.vehicle import Six, Vector


class Motion:
    """The state of motion. What moves the vehicle writes it; forces and sensors read it."""

    __slots__ = (
        "acceleration_world", "attitude", "current", "position", "rate", "rotation", "step_s", "steps", "velocity",
    )  # fmt: skip

    position: Vector  # of the vehicle's origin, world frame [m]
    attitude: Quaternion  # unit quaternion from the body's frame to the world's
    rotation: Rotation  # the same as a matrix
    velocity: Vector  # of the origin, world frame [m/s]
    rate: Vector  # angular velocity, body frame [rad/s]
    acceleration_world: Vector  # of the last step, world frame [m/s2]
    current: Vector  # velocity of the water, world frame [m/s]

    def __init__(self, step_s: float) -> None:
        self.step_s: float = step_s  # of integration
        self.steps: int = 0  # since the reset

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset: a count, so that nothing adds up."""
        return self.steps * self.step_s

    def through_water(self) -> Six:
        """Return the velocity relative to the water, body frame: along x, y, z [m/s], about x, y, z [rad/s]."""
        r11, r12, r13, r21, r22, r23, r31, r32, r33 = self.rotation
        (vx, vy, vz), (cx, cy, cz), (p, q, r) = self.velocity, self.current, self.rate
        x, y, z = vx - cx, vy - cy, vz - cz
        return (
            r11 * x + r21 * y + r31 * z, r12 * x + r22 * y + r32 * z, r13 * x + r23 * y + r33 * z, p, q, r,
        )  # fmt: skip

    def in_world(self, x: float, y: float, z: float) -> Vector:
        """Return a vector of the body's frame in the world's."""
        r11, r12, r13, r21, r22, r23, r31, r32, r33 = self.rotation
        return r11 * x + r12 * y + r13 * z, r21 * x + r22 * y + r23 * z, r31 * x + r32 * y + r33 * z

    def in_body(self, x: float, y: float, z: float) -> Vector:
        """Return a vector of the world's frame in the body's."""
        r11, r12, r13, r21, r22, r23, r31, r32, r33 = self.rotation
        return r11 * x + r21 * y + r31 * z, r12 * x + r22 * y + r32 * z, r13 * x + r23 * y + r33 * z
