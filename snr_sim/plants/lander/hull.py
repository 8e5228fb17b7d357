"""Hull of a lander as a rigid body in pymunk: impulses and contact detection.

The body in pymunk has a mass of 1 kg and the square of the radius of gyration as its moment of inertia, so impulses
are changes of velocity, per kilogram of the current mass. The motion is the same, and it avoids setting a new mass in
pymunk at every step, which takes 2 us.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

from snr_sim.plants.lander.legs import BodyPose
from snr_sim.plants.lander.module_shapes import HULL_M
from snr_sim.plants.lander.terrain import Terrain
from snr_sim.plants.pymunk_engine import pymunk_module

HULL, GROUND = 1, 2  # pymunk's collision types


class Hull:
    """A body of a radius of gyration over ground, in a world of its own."""

    def __init__(self, gyration_m: float, gravity_mps2: float, terrain: Terrain) -> None:
        pymunk = pymunk_module()
        space = pymunk.Space()
        space.gravity = 0.0, -gravity_mps2
        body = pymunk.Body(1.0, gyration_m**2)
        outline = pymunk.Poly(body, HULL_M)
        outline.collision_type = HULL
        ground = [pymunk.Segment(space.static_body, a, b, 0.0) for a, b in pairwise(terrain.points_m())]
        for segment in ground:
            segment.collision_type = GROUND
        space.add(body, outline, *ground)
        space.on_collision(HULL, GROUND, begin=self._on_contact)
        self.terrain: Terrain = terrain
        self.has_touched: bool = False  # and it stays true: a world that has seen a contact remembers it
        self._body = body
        # Bound once: they are called at every step. `move` moves on by a time [s]: position by velocity, then velocity
        # by gravity. `push` applies a kick (x, z) [m/s] at a point [m], both in the body's frame.
        self.move: Callable[[float], None] = space.step
        self.push: Callable[..., None] = body.apply_impulse_at_local_point
        self.push_in_world: Callable[..., None] = body.apply_impulse_at_world_point

    def _on_contact(self, arbiter: Any, space: Any, data: Any) -> None:
        self.has_touched = True
        arbiter.process_collision = False  # the flight is over; a bounce would change the last velocity

    def turn(self, rate_radps: float) -> None:
        """Add to the rate of turning."""
        self._body.angular_velocity += rate_radps

    def pose(self) -> BodyPose:
        """Return position and velocity as pymunk holds them."""
        body = self._body
        x, z = body.position
        vx, vz = body.velocity
        return BodyPose(x, z, body.angle, vx, vz, body.angular_velocity)

    def put(self, pose: BodyPose) -> None:
        """Put the body at `pose`, bitwise."""
        body = self._body
        body.position = pose.x_m, pose.z_m
        body.angle = pose.attitude_rad
        body.velocity = pose.vx_mps, pose.vz_mps
        body.angular_velocity = pose.rate_radps
