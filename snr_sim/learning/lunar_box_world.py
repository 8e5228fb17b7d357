"""The world of gymnasium's LunarLander-v3 under pymunk: a hull on two sprung legs above rough ground.

Sizes, powers and joints are those that LunarLander-v3 of gymnasium 1.4 states (its constants, in pixels of which 30
are a unit of length); the engine is Chipmunk, not Box2D. What they do differently, and how it is met:

- Box2D pulls first and moves then, Chipmunk the other way round. So everything starts with one step's pull, which is
  taken off what is observed until something touches: in free flight both move alike.
- A leg weighs 1.5 % of the hull that stands on it, for which Box2D's solver goes round 180 times. Here some of the
  hull's mass is in the legs: as a whole, with legs out, the lander has the same mass, centre and moment of inertia.
- Box2D's joint drives legs against a limit. Here the motor stops when they are out, or the two would never be still.
- Box2D multiplies frictions and takes the root, Chipmunk multiplies them.
- Box2D puts to sleep what has been still for half a second (slower than 0.01 and 2 degrees a second); here it is
  counted by hand, as Chipmunk asks for energies.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from snr_sim.plants.hull import pymunk_module

STEPS_HZ = 50
STEP_S = 1.0 / STEPS_HZ
PIXELS = 30.0  # in a unit of length
WIDTH, HEIGHT = 600 / PIXELS, 400 / PIXELS
CHUNKS = 11  # corners of the ground
PAD_Y = HEIGHT / 4

HULL = [(x / PIXELS, y / PIXELS) for x, y in ((-14, 17), (-17, 0), (-17, -10), (17, -10), (17, 0), (14, 17))]
MASS, CENTRE_Y, MOMENT = 4.9589, 0.0889, 0.9122  # of hull (density 5) and legs (1), out; about that centre
WIND_ARM = 0.0125  # the original's forces act at the middle of its hull, so far above the centre of it all
START_ARM = 0.0210  # at the start the original's legs still hang straight down
HULL_FRICTION, LEG_FRICTION = 0.1, math.sqrt(0.2 * 0.1)  # on ground of 1: the roots of Box2D's products
LEG_AWAY, LEG_DOWN = 20 / PIXELS, 18 / PIXELS
LEG_HALF = 2 / PIXELS, 8 / PIXELS
LEG = [(x * LEG_HALF[0], y * LEG_HALF[1]) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
SIDES = -1, 1  # of the joint at a leg; the leg itself is on the other side
LEG_TORQUE = 40.0
LEG_MOTOR_RADPS = 0.3
LEG_OUT_RAD, LEG_IN_RAD = 0.35, 0.85  # 0.4 and 0.9 from the 0.05 that the original's legs begin with
LEG_SERVO_PER_S = 10.0  # the motor's speed for each radian that a leg is in
LEG_MASS, LEG_MOMENT = 0.4, 0.05  # instead of 0.071 and 0.0018; the hull has the rest

MAIN_POWER, SIDE_POWER = 13.0, 0.6
MAIN_DOWN = 4 / PIXELS
SIDE_AWAY, SIDE_UP, SIDE_ARM = 12 / PIXELS, 14 / PIXELS, 17 / PIXELS
SPREAD = 1 / PIXELS  # of where an engine pushes, either way

STILL_MPS, STILL_RADPS, STILL_S = 0.01, math.radians(2.0), 0.5
ON_HULL, ON_LEG, GROUND = 1, 2, 4  # pymunk's collision types; legs are 2 and 3
HITS_GROUND, HITS_BODIES = 0b01, 0b10
ITERATIONS = 10  # of Chipmunk's solver
SLOP = 0.005  # what may overlap


class LunarBoxWorld:
    """One world: the ground, the lander above its middle, nothing moving.

    Args:
        heights: of the ground at `CHUNKS` equal distances.
        gravity: less than 0, along y.

    Attributes:
        hull: the body; `position` is the origin of its corners.
        is_crashed: whether the hull has touched the ground.
        steps_still: for how many steps everything has been still.
    """

    def __init__(self, heights: Sequence[float], gravity: float) -> None:
        pymunk = pymunk_module()
        self.heights = list(heights)
        self._space: Any = pymunk.Space()
        self._space.gravity = 0.0, gravity
        self._space.iterations = ITERATIONS
        self._space.collision_slop = SLOP
        corners = [(WIDTH / (CHUNKS - 1) * i, float(height)) for i, height in enumerate(heights)]
        for start, end in [*pairwise(corners), ((0.0, 0.0), (WIDTH, 0.0))]:
            line = pymunk.Segment(self._space.static_body, start, end, 0.0)
            line.friction, line.collision_type = 1.0, GROUND
            line.filter = pymunk.ShapeFilter(categories=HITS_GROUND, mask=HITS_BODIES)
            self._space.add(line)

        legs = [_leg_place(side) for side in SIDES]
        mass, moment = MASS - 2.0 * LEG_MASS, MOMENT
        centre_y = (MASS * CENTRE_Y - LEG_MASS * sum(y for _, y in legs)) / mass
        moment -= mass * (centre_y - CENTRE_Y) ** 2
        moment -= sum(LEG_MOMENT + LEG_MASS * (x**2 + (y - CENTRE_Y) ** 2) for x, y in legs)
        self.hull = self._body(pymunk, HULL, (mass, moment), HULL_FRICTION, ON_HULL)
        self.hull.center_of_gravity = 0.0, centre_y
        self.hull.position = WIDTH / 2, HEIGHT
        self._motors: list[Any] = []
        self.legs = [self._leg(pymunk, i) for i in range(2)]
        self._pull_mps = gravity * STEP_S
        for body in (self.hull, *self.legs):
            body.velocity = 0.0, self._pull_mps
        self.is_crashed = False
        self.steps_still = 0
        self._touching = [0, 0]
        self._space.on_collision(ON_HULL, GROUND, begin=self._crash)
        for i in range(2):
            self._space.on_collision(ON_LEG + i, GROUND, begin=self._touch, separate=self._lift, data=i)

    def _body(
        self,
        pymunk: Any,
        corners: Sequence[tuple[float, float]],
        mass_and_moment: tuple[float, float],
        friction: float,
        kind: int,
    ) -> Any:
        body = pymunk.Body(*mass_and_moment)
        shape = pymunk.Poly(body, corners)
        shape.filter = pymunk.ShapeFilter(categories=HITS_BODIES, mask=HITS_GROUND)
        shape.friction, shape.collision_type = friction, kind
        self._space.add(body, shape)
        return body

    def _leg(self, pymunk: Any, i: int) -> Any:
        side = SIDES[i]
        leg = self._body(pymunk, LEG, (LEG_MASS, LEG_MOMENT), LEG_FRICTION, ON_LEG + i)
        leg.angle = -side * LEG_OUT_RAD
        x, y = _leg_place(side)
        leg.position = self.hull.position.x + x, self.hull.position.y + y
        motor = pymunk.SimpleMotor(self.hull, leg, 0.0)
        motor.max_force = LEG_TORQUE
        low, high = sorted((-side * LEG_OUT_RAD, -side * LEG_IN_RAD))
        self._space.add(
            pymunk.PivotJoint(self.hull, leg, (0.0, 0.0), (side * LEG_AWAY, LEG_DOWN)),
            pymunk.RotaryLimitJoint(self.hull, leg, low, high),
            motor,
        )
        self._motors.append(motor)
        return leg

    def _crash(self, arbiter: Any, space: Any, data: Any) -> None:
        self.is_crashed = True

    def _touch(self, arbiter: Any, space: Any, data: Any) -> None:
        self._touching[data] += 1

    def _lift(self, arbiter: Any, space: Any, data: Any) -> None:
        self._touching[data] -= 1

    @property
    def contacts(self) -> tuple[bool, bool]:
        """Which of the legs touch the ground."""
        return self._touching[0] > 0, self._touching[1] > 0

    @property
    def is_asleep(self) -> bool:
        """Whether everything has been still for so long that it stands."""
        return self.steps_still >= STILL_S * STEPS_HZ

    def kick(self, force: tuple[float, float], torque: float = 0.0, arm: float = WIND_ARM) -> None:
        """Has a force and a torque act for one step, on the lander as a whole.

        Args:
            force: in the world's frame.
            torque: beside that of the force.
            arm: how far above the lander's centre of mass the force acts.
        """
        hull = self.hull
        sin, cos = math.sin(hull.angle), math.cos(hull.angle)
        turn = (torque - arm * (cos * force[0] + sin * force[1])) * STEP_S / MOMENT
        x, y = hull.local_to_world((0.0, CENTRE_Y))
        for body in (hull, *self.legs):
            at_x, at_y = body.local_to_world(body.center_of_gravity)
            vx, vy = body.velocity
            vx += force[0] * STEP_S / MASS - turn * (at_y - y)
            body.velocity = vx, vy + force[1] * STEP_S / MASS + turn * (at_x - x)
            body.angular_velocity += turn

    def fire_main(self, power: float, spread: tuple[float, float]) -> None:
        """Fires the main engine for one step.

        Args:
            power: 0.5 to 1.
            spread: where it pushes, along and across, -1 to 1.
        """
        hull = self.hull
        cos, sin = hull.rotation_vector
        along, across = MAIN_DOWN + 2.0 * SPREAD * spread[0], SPREAD * spread[1]
        out_x, out_y = sin * along - cos * across, -cos * along - sin * across
        x, y = hull.position
        impulse = -out_x * MAIN_POWER * power, -out_y * MAIN_POWER * power
        hull.apply_impulse_at_world_point(impulse, (x + out_x, y + out_y))

    def fire_side(self, power: float, side: float, spread: tuple[float, float]) -> None:
        """Fires the orientation engine of a side for one step.

        Args:
            power: 0.5 to 1.
            side: -1 the left engine, 1 the right one.
            spread: where it pushes, along and across, -1 to 1.
        """
        hull = self.hull
        cos, sin = hull.rotation_vector
        along, across = SPREAD * spread[0], 3.0 * SPREAD * spread[1] + side * SIDE_AWAY
        out_x, out_y = sin * along - cos * across, -cos * along - sin * across
        x, y = hull.position
        impulse = -out_x * SIDE_POWER * power, -out_y * SIDE_POWER * power
        # That the arm sideways is not as long as the one upwards is so in the original: it turns with the tilt.
        hull.apply_impulse_at_world_point(impulse, (x + out_x - sin * SIDE_ARM, y + out_y + cos * SIDE_UP))

    def velocity(self) -> tuple[float, float]:
        """Returns the velocity of the hull's centre of mass."""
        x, y = self.hull.velocity
        return (x, y) if any(self._touching) else (x, y - self._pull_mps)

    def step(self) -> None:
        """Moves on by a fiftieth of a second."""
        if not any(self._touching):
            self._space.step(STEP_S)
            self.steps_still = 0
            return
        self._drive_legs()
        self._space.step(STEP_S)
        self.steps_still = self.steps_still + 1 if all(map(_is_still, (self.hull, *self.legs))) else 0

    def _drive_legs(self) -> None:
        """Has the motors push legs out that were pushed in, the last bit more and more slowly."""
        angle_rad = self.hull.angle
        for side, leg, motor in zip(SIDES, self.legs, self._motors, strict=True):
            in_rad = side * (angle_rad - leg.angle) - LEG_OUT_RAD
            motor.rate = -side * max(-LEG_MOTOR_RADPS, min(LEG_MOTOR_RADPS, LEG_SERVO_PER_S * in_rad))


def _leg_place(side: int) -> tuple[float, float]:
    """Returns where the middle of a leg is that is out, from the origin of the hull."""
    cos, sin = math.cos(LEG_OUT_RAD), -side * math.sin(LEG_OUT_RAD)
    return sin * LEG_DOWN - cos * side * LEG_AWAY, -sin * side * LEG_AWAY - cos * LEG_DOWN


def _is_still(body: Any) -> bool:
    x, y = body.velocity
    return bool(x * x + y * y < STILL_MPS**2 and abs(body.angular_velocity) < STILL_RADPS)
