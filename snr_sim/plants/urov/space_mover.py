"""How the vehicle moves in space: in MuJoCo, with the water that MuJoCo does not have.

How a step goes:

    contacts  MuJoCo, where something is near: what touches, its own mass matrix and forces     (mujoco_body.py)
    forces    ours: thrusters, tether, buoyancy of what is wet                                  (tether.py, surface.py)
    water     ours: the velocity at the step's end if nothing touches, by Fossen's equation     (hydrodynamics.py)
    move      MuJoCo: with the added mass in its mass matrix and the force that leads to that velocity; it adds what
              contacts ask for, and moves on

So contacts meet the mass that a body in water has: pressed on the floor with 40 N it presses with 40 N, and a bump
takes as long as it should. Where nothing touches, MuJoCo has nothing to add: the vehicle is put where the mean velocity
of the step leads, which is right to the second order. Where something does, the water's forces are those of the step's
begin, and the position moves by the new velocity, as MuJoCo's contacts want it. That is of first order, and a contact
that is met too late, or slides too far in one step, throws the vehicle up. So a step in which something touches, or
that would end where something does, is taken in parts of at most `CONTACT_STEP_S`, however long it is itself. Five
parts cost as much as five steps; in open water nothing changes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from snr_sim.plants.attitude import integrate_attitude, rotation_of
from snr_sim.plants.mujoco_body import MujocoBody
from snr_sim.plants.urov.hydrodynamics import AT_REST, format_velocities
from snr_sim.plants.urov.motion import Motion
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.urov_state import Mover
from snr_sim.plants.urov.vehicle import Six, Vector
from snr_sim.plants.urov.water_forces import WaterForces, world_acceleration
from snr_sim.prelude.errors import PlantError
from snr_sim.prelude.sums import ordered_sum
from snr_sim.prelude.wrench import AXES

CONTACT_STEP_S = 0.001  # half of what all slides need: at 5 ms hard ones hop
DIVERGED = 1e9  # m/s2 and rad/s2: infinite as far as a vehicle goes, and still before MuJoCo writes it into a log file
SLIDES = 0.002  # m/s, rad/s: what touches and is slower sticks, as far as contacts go


def parts_of(step_s: float) -> int:
    """Return into how many parts a step is divided in which something touches."""
    return max(1, math.ceil(step_s / CONTACT_STEP_S - 1e-6))


class SpaceMover(Mover):
    """Six degrees of freedom. Writes `motion`; the world of `body` counts in parts of a step.

    The walls of a `pool` are known, so MuJoCo need not check where none is near; None for a world of its own. No part
    of the vehicle that touches is farther than `half_m` from its origin.
    """

    acceleration: Six
    guess: Six
    pressed_n: float

    def __init__(self, body: MujocoBody, motion: Motion, water: WaterForces, pool: Pool | None, half_m: float) -> None:
        self._body, self._motion, self._water, self._pool, self._half_m = body, motion, water, pool, half_m
        self._parts = parts_of(motion.step_s)
        self._part_s = motion.step_s / self._parts
        self._touches: bool | None = None  # at the current pose; None: not yet checked

    def engine_state(self) -> Any:
        """Return all of MuJoCo's state, with the vehicle where it is."""
        motion = self._motion
        self._body.put([*motion.position, *motion.attitude], [*motion.velocity, *motion.rate])
        return self._body.snapshot()

    def invalidate(self) -> None:
        """Check for contacts again before the next step: the vehicle was moved."""
        self._checked_position, self._clearance_m2, self._touches = self._motion.position, 0.0, None

    def advance(self, wrench: Sequence[float]) -> None:
        """Advance by one step, in which nothing begins or breaks."""
        if self._touches is None:
            self._touches = self._detect_contacts()
        if self._touches:
            self._move_in_parts(wrench)
        else:
            self._move_unless_it_touches(wrench)

    def _move_unless_it_touches(self, wrench: Sequence[float]) -> None:
        """Advance by one free step; if something touches at its end, it is taken back, and gone in parts."""
        motion, water, body = self._motion, self._water, self._body
        step_s = motion.step_s
        before = motion.position, motion.attitude, motion.velocity, motion.rate, motion.rotation
        acceleration, guess = self.acceleration, self.guess
        wet, entrained_fraction = water.wet, water.entrained_fraction
        others = body.snapshot() if body.has_others else None
        nu = motion.through_water()
        self._move_freely(nu, water.add_water_forces(wrench, nu, step_s), step_s)
        (x, y, z), (at_x, at_y, at_z) = motion.position, self._checked_position
        dx, dy, dz = x - at_x, y - at_y, z - at_z
        self._touches = dx * dx + dy * dy + dz * dz >= self._clearance_m2 and self._detect_contacts()
        if not self._touches or self._parts == 1:
            return
        motion.position, motion.attitude, motion.velocity, motion.rate, motion.rotation = before
        self.acceleration, self.guess, water.entrained_fraction = acceleration, guess, entrained_fraction
        if wet != water.wet:
            water.set_submerged_fraction(wet)
        if others is not None:
            body.restore(others)
        self._touches = self._detect_contacts()
        self._move_in_parts(wrench)

    def _move_in_parts(self, wrench: Sequence[float]) -> None:
        """Advance by one step in parts, after `detect_contacts`; the contact force is the mean of the parts."""
        motion, water = self._motion, self._water
        part_s, begin = self._part_s, motion.velocity
        contact_forces = []
        for _ in range(self._parts):
            nu = motion.through_water()
            all_forces = water.add_water_forces(wrench, nu, part_s)
            if self._touches:
                contact_forces.append(self._move_touching(nu, all_forces, part_s))
            else:
                self._move_freely(nu, all_forces, part_s)
            self._touches = self._detect_contacts()
        if self._parts > 1:
            (wx, wy, wz), (vx, vy, vz), step_s = motion.velocity, begin, motion.step_s
            motion.acceleration_world = ((wx - vx) / step_s, (wy - vy) / step_s, (wz - vz) / step_s)
        if contact_forces:
            fx, fy, fz = (ordered_sum(along) / self._parts for along in zip(*contact_forces, strict=True))
            self.contact_n = (fx, fy, fz)

    def _detect_contacts(self) -> bool:
        """Have MuJoCo detect contacts, and find how far the vehicle can move before the next check."""
        motion, body = self._motion, self._body
        body.put([*motion.position, *motion.attitude], [*motion.velocity, *motion.rate])
        touches = body.detect_contacts()
        clearance_m = 0.0
        if self._pool is not None and not touches and not body.has_others:
            clearance_m = self._pool.clearance_m(motion.position) - self._half_m
        self._checked_position, self._clearance_m2 = motion.position, max(0.0, clearance_m) ** 2
        return touches

    def _move_freely(self, nu: Six, wrench: Sequence[float], step_s: float) -> None:
        """Advance by the middle of the step, where nothing touches."""
        motion, water, body = self._motion, self._water, self._body
        flotation, hydro = water.flotation, water.hydro
        if water.impact_impulse is not None:
            nu = hydro.subtract_impulse(nu, water.impact_impulse)
        r11, r12, r13, r21, r22, r23, r31, r32, r33 = motion.rotation
        (mu, mv, mw, mp, mq, mr), change = hydro.advance(
            nu, (r31, r32, r33), wrench, flotation.net_n, flotation.static_moment_nm, self.guess, step_s
        )
        motion.attitude = attitude = integrate_attitude(motion.attitude, mp, mq, mr, step_s)
        motion.rotation = rotation = rotation_of(attitude)
        s11, s12, s13, s21, s22, s23, s31, s32, s33 = rotation
        u, v, w, p, q, r = nu
        au, av, aw, ap, aq, ar = change
        bu, bv, bw, bp, bq, br = self.acceleration
        # The next step's, if it changes as much again.
        self.guess = (au + au - bu, av + av - bv, aw + aw - bw, ap + ap - bp, aq + aq - bq, ar + ar - br)
        self.acceleration = change
        u, v, w, p, q, r = (
            u + step_s * au, v + step_s * av, w + step_s * aw, p + step_s * ap, q + step_s * aq, r + step_s * ar,
        )  # fmt: skip
        if water.entrained_fraction > water.wet:
            u, v, w, p, q, r = water.velocity_after_entrainment((u, v, w, p, q, r))
        vx, vy, vz = motion.velocity
        cx, cy, cz = motion.current
        wx = s11 * u + s12 * v + s13 * w + cx
        wy = s21 * u + s22 * v + s23 * w + cy
        wz = s31 * u + s32 * v + s33 * w + cz
        motion.acceleration_world = acceleration_world = ((wx - vx) / step_s, (wy - vy) / step_s, (wz - vz) / step_s)
        self._check_finite(nu, acceleration_world, change)
        if body.has_others:
            body.move(hydro.mass - body.rigid, (*acceleration_world, ap, aq, ar), step_s)
        self.contact_n, self.pressed_n = None, 0.0
        motion.velocity = (wx, wy, wz)
        motion.rate = (p, q, r)
        # By the mean velocity, turned by the mean of both rotations: so the work of the weight is its energy.
        half = 0.5 * step_s
        x, y, z = motion.position
        motion.position = (
            x + step_s * cx + half * ((r11 + s11) * mu + (r12 + s12) * mv + (r13 + s13) * mw),
            y + step_s * cy + half * ((r21 + s21) * mu + (r22 + s22) * mv + (r23 + s23) * mw),
            z + step_s * cz + half * ((r31 + s31) * mu + (r32 + s32) * mv + (r33 + s33) * mw),
        )

    def _move_touching(self, nu: Six, wrench: Sequence[float], step_s: float) -> Vector:
        """Let MuJoCo move on; return what contacts push, world frame.

        The water's forces are those at the step's begin: contacts may stop what would have moved.
        """
        motion, water, body = self._motion, self._water, self._body
        water.entrained_fraction = water.wet
        if water.impact_impulse is not None:
            wrench = [a - b / step_s for a, b in zip(wrench, water.impact_impulse, strict=True)]
        _, change = water.hydro.advance(
            nu, motion.rotation[6:], wrench, water.flotation.net_n, water.flotation.static_moment_nm, AT_REST, 0.0
        )
        self.acceleration = self.guess = change
        acceleration_world = world_acceleration(motion, change)
        self._check_finite(nu, acceleration_world, change)
        if math.hypot(*motion.velocity, *motion.rate) > SLIDES:
            body.limit_grip(self.pressed_n)
        body.move(water.hydro.mass - body.rigid, (*acceleration_world, *change[3:]), step_s)
        fx, fy, fz = body.touch()[:3]
        self.pressed_n = math.hypot(fx, fy, fz)
        x, y, z, qw, qx, qy, qz = body.pose()
        wx, wy, wz, p, q, r = body.velocity()
        vx, vy, vz = motion.velocity
        motion.acceleration_world = ((wx - vx) / step_s, (wy - vy) / step_s, (wz - vz) / step_s)
        motion.position, motion.attitude = (x, y, z), (qw, qx, qy, qz)
        motion.velocity, motion.rate = (wx, wy, wz), (p, q, r)
        motion.rotation = rotation_of(motion.attitude)
        return fx, fy, fz

    def _check_finite(self, nu: Six, acceleration_world: Vector, change: Six) -> None:
        """Raise a PlantError that names what has diverged, before MuJoCo or the next step uses it."""
        x, y, z = acceleration_world
        _, _, _, p, q, r = change
        if x * x + y * y + z * z + p * p + q * q + r * r < DIVERGED * DIVERGED:  # not so if one is NaN
            return
        lost = [axis for axis, value in zip(AXES, change, strict=True) if not abs(value) < DIVERGED]
        raise PlantError(
            f"At {self._motion.time_s:g} s the acceleration in {', '.join(lost) or 'the world'} is no longer finite; "
            f"the velocities through the water were {format_velocities(nu)}.",
            fix="look at the last commands and at what was added to the vehicle; or try a shorter step.",
        )
