"""Two sprung, damped feet on the ground: how hard each pushes the module, and where it grips.

    normal force = spring * depth + damper * speed of giving way, never pulling
    side force   = spring * distance from the grip + damper * speed sideways, at most friction * normal force

A foot that is pulled harder takes its grip along. All there is to remember is where each grips, so a contact can be
put back to the bit, which the ones of pymunk cannot: they keep impulses that nothing can write.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

from snr_sim.plants.lander.module import Leg
from snr_sim.plants.lander.module_shapes import PADS_APART_M, PADS_BELOW_M
from snr_sim.plants.lander.terrain import Terrain

FEET_M = ((-0.5 * PADS_APART_M, -PADS_BELOW_M), (0.5 * PADS_APART_M, -PADS_BELOW_M))
MAX_CONTACT_RADIUS_M = math.hypot(*FEET_M[0])  # no part of the module that can touch is farther from its centre of mass

Grip: TypeAlias = tuple[float, float] | None  # the point on the ground that a foot grips, if it touches
Kick: TypeAlias = tuple[float, float, float]  # change of velocity x, z [m/s]; twist [m2/s], a moment's per kilogram


class BodyPose(NamedTuple):
    """Where the module is and how it moves, world frame, at one moment."""

    x_m: float
    z_m: float
    attitude_rad: float
    vx_mps: float
    vz_mps: float
    rate_radps: float


class Legs:
    """Both legs of a module of a radius of gyration; they push for a step at a time."""

    def __init__(self, leg: Leg, gyration_m: float, step_s: float) -> None:
        self._leg = leg
        self._gyration2 = gyration_m**2
        self._step_s = step_s
        self.grips_m: tuple[Grip, Grip] = (None, None)

    def stand(self, body: BodyPose, mass_kg: float, ground: Terrain, push: Callable[..., None]) -> int:
        """Push with each foot that touches, for one step; return how many do.

        A leg pushes as if its foot were where it would be without ground, so the spring's work is its energy to the
        last joule. Dampers use the velocity of the middle of the step, solved for: they can stop a foot, never turn it.

        Args:
            body: where the module is.
            mass_kg: its mass.
            ground: under it.
            push: called with a kick (x, z) and the point it acts at, world frame.
        """
        x, z, attitude, vx, vz, rate = body
        cos, sin = math.cos(attitude), math.sin(attitude)
        spring, damper, friction = self._leg.spring_npm, self._leg.damper_nspm, self._leg.friction
        gyration2, per_kg = self._gyration2, self._step_s / mass_kg
        half_damper = 0.5 * damper * per_kg
        grips: list[Grip] = [None, None]
        for i, (foot_x, foot_z) in enumerate(FEET_M):
            rx, rz = cos * foot_x - sin * foot_z, sin * foot_x + cos * foot_z
            px, pz = x + rx, z + rz
            height, slope = ground.ground(px)
            nz = 1.0 / math.sqrt(1.0 + slope * slope)
            nx = -slope * nz
            depth = (height - pz) * nz
            if depth <= 0.0:
                continue
            ux, uz = vx - rate * rz, vz + rate * rx
            arm_normal, arm_side = rx * nz - rz * nx, -rx * nx - rz * nz
            normal = spring * depth - damper * (ux * nx + uz * nz)
            normal = max(0.0, normal / (1.0 + half_damper * (1.0 + arm_normal * arm_normal / gyration2)))
            hold = friction * normal
            # How far the foot is from where it grips, along the ground; a grip that holds no more slides after it.
            grip = self.grips_m[i]
            bent = 0.0 if grip is None else (px - grip[0]) * nz - (pz - grip[1]) * nx
            bent = min(hold / spring, max(-hold / spring, bent))
            grips[i] = px + depth * nx - bent * nz, pz + depth * nz + bent * nx
            side = -spring * bent - damper * (ux * nz - uz * nx)
            side = min(hold, max(-hold, side / (1.0 + half_damper * (1.0 + arm_side * arm_side / gyration2))))
            kick_x, kick_z = (normal * nx + side * nz) * per_kg, (normal * nz - side * nx) * per_kg
            push((kick_x, kick_z), (px, pz))
        self.grips_m = grips[0], grips[1]
        return 2 - grips.count(None)

    def deflection_m(self, i: int, pose: BodyPose, ground: Terrain) -> float:
        """Return how far leg `i` has given way along the module: so its foot shows on the ground, not under it."""
        if self.grips_m[i] is None:
            return 0.0
        foot_x, foot_z = FEET_M[i]
        cos, sin = math.cos(pose.attitude_rad), math.sin(pose.attitude_rad)
        height = ground.ground(pose.x_m + cos * foot_x - sin * foot_z)[0]
        return max(0.0, height - pose.z_m - sin * foot_x - cos * foot_z)
