"""The world of gymnasium's LunarLander-v3 under pymunk: a hull on two sprung legs above rough ground.

Sizes, powers and joints are those that LunarLander-v3 of gymnasium 1.4 states (its constants, in pixels of which 30
are a unit of length); the engine is Chipmunk, not Box2D. What they do differently, and how it is met:

- Box2D pulls first and moves then, Chipmunk the other way round. So everything starts with one step's pull, which is
  subtracted from observations until something touches: in free flight both move alike.
- A leg weighs 1.5 % of the hull above it, for which Box2D's solver takes 180 iterations. Here some of the
  hull's mass is in the legs: as a whole, with legs out, the lander has the same mass, centre and moment of inertia.
- Chipmunk moves first and has the joints share a push afterwards, so what pushes the lander pushes hull and legs.
- Box2D's joint drives legs against a limit. Here the motor stops when they are out, or the legs would never rest.
- Box2D multiplies frictions and takes the root, Chipmunk multiplies them.
- Box2D puts to sleep what has been still for half a second (slower than 0.01 and 2 degrees a second); here it is
  counted by hand, as Chipmunk asks for energies.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, TypeAlias

from snr_sim.plants.pymunk_engine import pymunk_module
from snr_sim.prelude.sums import ordered_sum

Point: TypeAlias = tuple[float, float]

STEPS_HZ = 50
STEP_S = 1.0 / STEPS_HZ
PIXELS = 30.0  # in a unit of length
WIDTH, HEIGHT = 600 / PIXELS, 400 / PIXELS
CHUNKS = 11  # corners of the ground
PAD_Y = HEIGHT / 4
START = WIDTH / 2, HEIGHT

HULL = [(x / PIXELS, y / PIXELS) for x, y in ((-14, 17), (-17, 0), (-17, -10), (17, -10), (17, 0), (14, 17))]
MASS, CENTRE_Y, MOMENT = 4.9589, 0.0889, 0.9122  # of hull (density 5) and legs (1), out; about that centre
WIND_ARM = 0.0125  # the original's forces act at the middle of its hull, so far above the centre of it all
START_ARM = 0.0206  # measured: the original's legs hang straight down at the start, and turn out within two steps
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
SPREAD = 1 / PIXELS  # of the point where an engine acts, in each direction

STILL_MPS, STILL_RADPS, STILL_S = 0.01, math.radians(2.0), 0.5
GROUND, ON_HULL, ON_LEG = 0, 1, 2  # pymunk's collision types; legs are 2 and 3
ITERATIONS = 10  # of Chipmunk's solver
SLOP = 0.005  # what may overlap
NOTHING = [0, 0, 0]  # is touched by hull and legs


class LunarBoxWorld:
    """World that is reused for all episodes: the ground, and the lander at rest above its middle.

    Args:
        gravity: less than 0, along y.

    Attributes:
        heights: of the ground.
        hull: the body; `position` is the origin of its corners.
        x, y, angle_rad: pose of the hull after the last step. Each is read once: a query to pymunk takes as long as
            ten lines of Python.
        vx, vy, turn_radps: velocity of its centre of mass (in flight less the step of gravity that Chipmunk is ahead)
            and its angular velocity.
        contacts: which of the legs touch the ground.
        steps_still: number of steps for which everything has been at rest.
    """

    hull: Any
    x: float
    y: float
    vx: float
    vy: float
    angle_rad: float
    turn_radps: float
    contacts: tuple[bool, bool]

    def __init__(self, gravity: float) -> None:
        self._pymunk = pymunk_module()
        self._gravity = gravity
        self._pull_mps = gravity * STEP_S
        mass, moment, self._centre_y = _hull_alone()
        self.hull, outline = self._body(HULL, mass, moment, HULL_FRICTION, ON_HULL)
        self.hull.center_of_gravity = 0.0, self._centre_y
        legs = [self._body(LEG, LEG_MASS, LEG_MOMENT, LEG_FRICTION, ON_LEG + i) for i in range(2)]
        self.legs: list[Any] = [leg for leg, _ in legs]
        self._parts = [self._part(self.hull, 0.0, (0.0, self._centre_y))]
        self._parts += [
            self._part(leg, -side * LEG_OUT_RAD, _leg_place(side)) for leg, side in zip(self.legs, SIDES, strict=True)
        ]
        self._outlines = [outline, *(outline for _, outline in legs)]
        self._space = self._empty_space()
        self._space.add(self.hull, *self.legs, *self._outlines)

    def _body(self, corners: list[Point], mass: float, moment: float, friction: float, kind: int) -> tuple[Any, Any]:
        body = self._pymunk.Body(mass, moment)
        outline = self._pymunk.Poly(body, corners)
        outline.filter = self._pymunk.ShapeFilter(group=1)  # parts of one lander do not collide
        outline.friction, outline.collision_type = friction, kind
        return body, outline

    @staticmethod
    def _part(body: Any, angle_rad: float, centre: Point) -> tuple[Any, ...]:
        """Return what `_push` needs of a body: its angle and its centre are those in the hull's frame."""
        x, y = centre
        turn = math.cos(angle_rad), math.sin(angle_rad)
        push = body.apply_impulse_at_local_point
        return push, body.mass, body.moment, x, y - CENTRE_Y, *turn, body.center_of_gravity[1]

    def begin(self, heights: Sequence[float]) -> None:
        """Begin an episode, bitwise as it would begin in a new world.

        The lander is moved to a fresh pymunk space, which holds nothing of the last episode. Joints are recreated, as
        each stores its last impulse. To recreate the whole lander would take a third longer.

        Args:
            heights: of the ground at `CHUNKS` equal distances.
        """
        self._space.remove(*self._space.constraints, *self._outlines, self.hull, *self.legs)
        self.heights: list[float] = list(heights)
        corners = [(WIDTH / (CHUNKS - 1) * i, height) for i, height in enumerate(self.heights)]
        self._place(self.hull, START, 0.0)
        for leg, side in zip(self.legs, SIDES, strict=True):
            x, y = _leg_place(side)
            self._place(leg, (START[0] + x, START[1] + y), -side * LEG_OUT_RAD)
        self._space = self._empty_space()
        ground = self._space.static_body
        lines = [self._pymunk.Segment(ground, *ends, 0.0) for ends in pairwise(corners)]
        for line in lines:
            line.friction = 1.0
        self._space.add(*lines, self.hull, *self.legs, *self._outlines)
        self._motors = [self._join_leg(leg, side) for leg, side in zip(self.legs, SIDES, strict=True)]
        self._rates_radps = [0.0, 0.0]
        self.steps_still: int = 0
        self._touching = list(NOTHING)  # how many pieces of the ground hull and legs touch
        self._has_touched = [False, False, False]
        self._read_state()

    def _empty_space(self) -> Any:
        space = self._pymunk.Space()
        space.gravity = 0.0, self._gravity
        space.iterations, space.collision_slop = ITERATIONS, SLOP
        for i, outline in enumerate(self._outlines):
            space.on_collision(outline.collision_type, GROUND, begin=self._touch, separate=self._lift, data=i)
        return space

    def _place(self, body: Any, position: Point, angle_rad: float) -> None:
        body.update_position(body, 0.0)  # Chipmunk moves overlapping bodies apart one step late: that is forgotten
        body.angle, body.position = angle_rad, position
        body.velocity, body.angular_velocity = (0.0, self._pull_mps), 0.0

    def _join_leg(self, leg: Any, side: int) -> Any:
        """Join a leg to the hull; return the motor."""
        pymunk = self._pymunk
        low, high = sorted((-side * LEG_OUT_RAD, -side * LEG_IN_RAD))
        motor = pymunk.SimpleMotor(self.hull, leg, 0.0)
        motor.max_force = LEG_TORQUE
        self._space.add(
            pymunk.PivotJoint(self.hull, leg, (0.0, 0.0), (side * LEG_AWAY, LEG_DOWN)),
            pymunk.RotaryLimitJoint(self.hull, leg, low, high),
            motor,
        )
        return motor

    def _touch(self, arbiter: Any, space: Any, data: Any) -> None:
        self._touching[data] += 1
        self._has_touched[data] = True

    def _lift(self, arbiter: Any, space: Any, data: Any) -> None:
        """Note that a part has left a piece of the ground.

        The original counts a leg as off the ground then, even if it touches another piece; and a hull that has touched
        has crashed.
        """
        self._touching[data] -= 1
        self._has_touched[data] = data == 0

    @property
    def is_crashed(self) -> bool:
        """Whether the hull has touched the ground."""
        return self._has_touched[0]

    @property
    def is_asleep(self) -> bool:
        """Whether everything has been at rest for long enough."""
        return self.steps_still >= STILL_S * STEPS_HZ

    def kick(self, force: Point, torque: float = 0.0, arm: float = WIND_ARM) -> None:
        """Apply a force in the world's frame, and a torque in addition to its own, for one step.

        It acts at a height `arm` above the lander's centre of mass.
        """
        sin, cos = math.sin(self.angle_rad), math.cos(self.angle_rad)
        side, up = cos * force[0] + sin * force[1], cos * force[1] - sin * force[0]
        self._push(side * STEP_S, up * STEP_S, (torque - arm * side) * STEP_S / MOMENT)

    def fire_main(self, power: float, spread: Point) -> None:
        """Fire the main engine for one step, with a power of 0.5 to 1; it pushes along and across, -1 to 1."""
        along, across = MAIN_DOWN + 2.0 * SPREAD * spread[0], SPREAD * spread[1]
        self._fire(MAIN_POWER * power, along, across, 0.0, 0.0)

    def fire_side(self, power: float, side: float, spread: Point) -> None:
        """Fire the orientation engine of a side, -1 the left one and 1 the right one, as `fire_main`."""
        along, across = SPREAD * spread[0], 3.0 * SPREAD * spread[1] + side * SIDE_AWAY
        # That the arm sideways is not as long as the one upwards is so in the original: it turns with the tilt.
        sin, cos = math.sin(self.angle_rad), math.cos(self.angle_rad)
        away, up = sin * cos * (SIDE_UP - SIDE_ARM), sin * sin * SIDE_ARM + cos * cos * SIDE_UP
        self._fire(SIDE_POWER * power, along, across, away, up)

    def _fire(self, power: float, along: float, across: float, at_x: float, at_y: float) -> None:
        """Apply an engine's exhaust along and across, as the opposite force at a point; all in the hull's frame."""
        side, up = across * power, along * power
        self._push(side, up, ((at_x - across) * up - (at_y - along - CENTRE_Y) * side) / MOMENT)

    def _push(self, side: float, up: float, turn_radps: float) -> None:
        """Push hull and legs as one body, as if the legs were out.

        By a push on the hull alone it turned too far by a factor of eight: by itself it has a tenth of the lander's
        moment of inertia, and joints share a push only in the step after it.

        Args:
            side, up: impulse at the centre of mass, in the hull's frame.
            turn_radps: change of its angular velocity.
        """
        add_x, add_y = side / MASS, up / MASS
        for push, mass, moment, x, y, cos, sin, centre_y in self._parts:
            away_x, away_y = mass * (add_x - turn_radps * y), mass * (add_y + turn_radps * x)
            own_x, own_y = cos * away_x + sin * away_y, cos * away_y - sin * away_x
            # An off-centre impulse equals one through the centre plus an angular impulse: one call for both.
            beside = moment * turn_radps / (own_x * own_x + own_y * own_y or 1.0)  # both are 0 without wind
            push((own_x, own_y), (beside * own_y, centre_y - beside * own_x))

    def step(self) -> None:
        """Advance by 0.02 s, and read the hull's pose."""
        if self._touching == NOTHING:
            self._space.step(STEP_S)
            self._read_state()
            self.steps_still = 0
            return
        self._drive_legs()
        self._space.step(STEP_S)
        self._read_state()
        is_still = _is_still(self.vx, self.vy, self.turn_radps) and all(map(_is_body_still, self.legs))
        self.steps_still = self.steps_still + 1 if is_still else 0

    def _read_state(self) -> None:
        hull = self.hull
        _, left, right = self._touching
        self.contacts = self._has_touched[1], self._has_touched[2]
        self.x, self.y = hull.position
        self.vx, self.vy = hull.velocity
        if not (left or right):
            self.vy -= self._pull_mps
        self.angle_rad, self.turn_radps = hull.angle, hull.angular_velocity

    def _drive_legs(self) -> None:
        """Have the motors push legs out that were pushed in, the last bit more and more slowly."""
        for i, side in enumerate(SIDES):
            in_rad = side * (self.angle_rad - self.legs[i].angle) - LEG_OUT_RAD
            rate = -side * max(-LEG_MOTOR_RADPS, min(LEG_MOTOR_RADPS, LEG_SERVO_PER_S * in_rad))
            if rate != self._rates_radps[i]:
                self._motors[i].rate = self._rates_radps[i] = rate


def _leg_place(side: int) -> Point:
    """Return where the middle of a leg is that is out, from the origin of the hull."""
    cos, sin = math.cos(LEG_OUT_RAD), -side * math.sin(LEG_OUT_RAD)
    return sin * LEG_DOWN - cos * side * LEG_AWAY, -sin * side * LEG_AWAY - cos * LEG_DOWN


def _hull_alone() -> tuple[float, float, float]:
    """Return mass, moment of inertia and height of the centre of the hull: of the whole lander, less its legs."""
    legs = [_leg_place(side) for side in SIDES]
    mass = MASS - 2.0 * LEG_MASS
    centre_y = (MASS * CENTRE_Y - LEG_MASS * ordered_sum(y for _, y in legs)) / mass
    moment = MOMENT - mass * (centre_y - CENTRE_Y) ** 2
    moment -= ordered_sum(LEG_MOMENT + LEG_MASS * (x**2 + (y - CENTRE_Y) ** 2) for x, y in legs)
    return mass, moment, centre_y


def _is_still(vx: float, vy: float, turn_radps: float) -> bool:
    return vx * vx + vy * vy < STILL_MPS**2 and abs(turn_radps) < STILL_RADPS


def _is_body_still(body: Any) -> bool:
    vx, vy = body.velocity
    return _is_still(vx, vy, body.angular_velocity)
