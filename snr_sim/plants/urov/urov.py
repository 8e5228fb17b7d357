"""An underwater vehicle with six degrees of freedom, in MuJoCo, with the water that MuJoCo does not have.

How a step goes:

    look      MuJoCo, where something is near: what touches, its own mass matrix and forces     (mujoco_body.py)
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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np

from snr_sim.plants.attitude import rotation_of, turned
from snr_sim.plants.mujoco_body import MujocoBody
from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.flotation import Flotation
from snr_sim.plants.urov.given_world import check_mass, check_world
from snr_sim.plants.urov.hydrodynamics import AT_REST, Hydrodynamics, in_words, product_with
from snr_sim.plants.urov.plausible import shown
from snr_sim.plants.urov.pool import BODY, Pool
from snr_sim.plants.urov.propulsion import ODD_PULSES_US
from snr_sim.plants.urov.surface import Surface
from snr_sim.plants.urov.tether import TetherPull
from snr_sim.plants.urov.urov_forces import STOP_US, UrovForces
from snr_sim.plants.urov.urov_start import check_parts, check_room, check_start
from snr_sim.plants.urov.urov_state import Body, State, Thrusters, WrenchCommand
from snr_sim.plants.urov.vehicle import Six, Vector, Vehicle
from snr_sim.prelude.angles import quaternion_of
from snr_sim.prelude.errors import CommandError, ParameterError, PlantError, UnknownName, nearest
from snr_sim.prelude.signals import PwmCommand
from snr_sim.prelude.sums import ordered_sum
from snr_sim.prelude.wrench import AXES

STEP_S = 0.005  # the table in robots/urov/PHYSICS.md says what 2 and 10 ms would change
CONTACT_STEP_S = 0.001  # half of what all slides need: at 5 ms hard ones hop
EXPLODED = 1e9  # m/s2 and rad/s2: infinite as far as a vehicle goes, and still before MuJoCo writes it into a log file
SLIDES = 0.002  # m/s, rad/s: what touches and is slower sticks, as far as contacts go


class Urov(UrovForces):
    """The underwater vehicle. Keeps the promise of Plant.

    Args:
        vehicle: its numbers; it is trimmed in the pool's water.
        pool: where it swims.
        start_of: gives the dive that belongs to a seed.
        thrusters: turn pulses into forces; without any, the input is a wrench.
        seed: of the first run.
        step_s: of integration; see `STEP_S`.
        mjcf: another world than the pool's, with a body 'vehicle' on a free joint, whose mass and inertia then count as
            they are, without trim; `given_world.py` says what it must leave to the plant.

    Raises:
        ParameterError: vehicle, thrusters, dive and world do not go together.

    Attributes:
        vehicle: as trimmed.
        dive: of this run.
    """

    # For `scaled`, of the vehicle.
    SCALABLE = ("added_mass", "linear_damping", "quadratic_damping", "net_buoyancy_n")
    _touches: bool | None  # where it is now; None: nobody has looked

    def __init__(
        self,
        vehicle: Vehicle,
        pool: Pool,
        start_of: Callable[[int], Dive],
        thrusters: Thrusters | None = None,
        seed: int = 0,
        step_s: float = STEP_S,
        mjcf: str | None = None,
    ) -> None:
        check_parts(vehicle, pool, start_of, thrusters, step_s)
        self.vehicle = vehicle = vehicle.trimmed(pool.density_kgm3, pool.gravity_mps2)
        self.pool, self.start_of, self.thrusters = pool, start_of, thrusters
        self._knows_room = mjcf is None
        self.step_s: float = step_s
        self.inputs: tuple[str, ...] = ("wrench",) if thrusters is None else ("pwm",)
        power = () if thrusters is None else ("power",)
        self.outputs: tuple[str, ...] = ("depth", "imu", "altitude", "leak", "pose", *power)
        self._parts = max(1, math.ceil(step_s / CONTACT_STEP_S - 1e-6))  # of a step in which something touches
        self._part_s = step_s / self._parts
        self._body = self._build(mjcf)
        self.engine = self._body.engine
        self._readers = self._own_readers()
        self._matrix = vehicle.thruster_matrix()
        self._added_momentum = product_with(vehicle.added_mass)
        self._half_m = 0.5 * math.hypot(*vehicle.size_m)  # no part that touches is farther from the origin
        self._names = tuple(thruster.name for thruster in vehicle.thrusters)
        self._surface = Surface(vehicle)
        self._hydro = Hydrodynamics(vehicle, self._body.rigid)
        self._flotation = Flotation(vehicle, self._body.rigid, pool.density_kgm3, self._body.gravity_mps2)
        self.reset(seed)

    def _build(self, mjcf: str | None) -> Body:
        """Builds the world; what `Urov2D` does in another way."""
        if mjcf is None:
            self._mujoco = MujocoBody(
                MujocoWorld(self.pool.mjcf(self.vehicle), self._part_s, (BODY,), "the pool"), BODY
            )
            return self._mujoco
        world = MujocoWorld(mjcf, self._part_s, (BODY,))
        check_world(world, mjcf, BODY, self.pool, self.step_s)
        self._mujoco = MujocoBody(world, BODY)
        check_mass(self.vehicle, float(self._mujoco.rigid[0, 0]))
        return self._mujoco

    def scaled(self, factors: Mapping[str, float]) -> Self:
        """Returns a vehicle of which some numbers, those in `SCALABLE`, are multiplied, in the same pool.

        Raises:
            ParameterError: it is in a world of its own, or a number that is scaled cannot be.
        """
        if not self._knows_room:
            raise ParameterError("A vehicle in an MJCF world cannot be scaled.", fix="scale it in the file.")
        numbers = {name: getattr(self.vehicle, name) for name in factors}
        scaled = {name: (np.asarray(number) * factors[name]).tolist() for name, number in numbers.items()}
        return type(self)(replace(self.vehicle, **scaled), self.pool, self.start_of, self.thrusters, seed=0)

    # -- start, and being put back ------------------------------------------------------------------------------------

    def reset(self, seed: int) -> None:
        """Puts the vehicle at the start that belongs to this seed, with its thrusters off."""
        dive = self.start_of(seed)
        check_start(dive, seed, self.vehicle, self.pool, self.thrusters is not None, self.step_s)
        self._body.clear()
        attitude = quaternion_of(*dive.attitude_rad)
        self._body.put([*dive.position_m, *attitude], [*dive.velocity_mps, *dive.rate_radps])
        if self.thrusters is not None:
            self.thrusters.reset()
        start = State(
            dive,
            dive.position_m,
            attitude,
            dive.velocity_mps,
            dive.rate_radps,
            self._body.snapshot(),
            self.thrusters.snapshot() if self.thrusters is not None else None,
            pulses=(None,) * len(self.vehicle.thrusters),
        )
        self.restore(start)
        check_room(dive, *self._body.deepest(), self.vehicle, self.pool)
        self._happen()
        if self._place[2] > -self._surface.reach_m:
            self._float(self._place[2], self._rotation[6:])
            self._taken = self._wet
        # Sensors may ask before the first step: the acceleration that it begins with.
        nu = self.through_water
        _, change = self._hydro.advance(
            nu,
            self._rotation[6:],
            self._around(AT_REST, nu, 0.0),
            self._flotation.net_n,
            self._flotation.arm,
            AT_REST,
            0.0,
        )
        self._acceleration = self._guess = change
        self._gained = self._seen_from_world(change)

    def snapshot(self) -> State:
        """Returns all of the state; it never changes afterwards."""
        return State(
            dive=self.dive,
            place=self._place,
            attitude=self._attitude,
            velocity=self._velocity,
            rate=self._rate,
            mujoco=self._engine_state(),
            thrusters=self.thrusters.snapshot() if self.thrusters is not None else None,
            steps=self._steps,
            happened=self._happened,
            acceleration=self._acceleration,
            guess=self._guess,
            gained=self._gained,
            wet=self._wet,
            taken=self._taken,
            water_l=self._water_l,
            wrench=self._wrench,
            pulses=tuple(self._pulses),
            pulses_until_s=self._pulses_until_s,
            contact_n=self._contact_n,
            pressed_n=self._pressed_n,
            tether_n=self._tether_n,
        )

    def _engine_state(self) -> Any:
        """Returns all of MuJoCo's state, with the vehicle where it is."""
        self._mujoco.put([*self._place, *self._attitude], [*self._velocity, *self._rate])
        return self._mujoco.snapshot()

    def restore(self, snapshot: State) -> None:
        """Puts back what `snapshot` returned."""
        dive = self.dive = snapshot.dive
        self._body.restore(snapshot.mujoco)
        if self.thrusters is not None:
            self.thrusters.restore(snapshot.thrusters)
        self._place, self._attitude = snapshot.place, snapshot.attitude
        self._looked_at, self._room_m2, self._touches = snapshot.place, 0.0, None
        self._velocity, self._rate = snapshot.velocity, snapshot.rate
        self._rotation = rotation_of(snapshot.attitude)
        self._acceleration, self._guess, self._gained = snapshot.acceleration, snapshot.guess, snapshot.gained
        self._steps, self._happened = snapshot.steps, snapshot.happened
        self._wrench, self._pulses = snapshot.wrench, list(snapshot.pulses)
        self._pulses_until_s = snapshot.pulses_until_s
        self._water_l = snapshot.water_l
        self._moments_s = dive.times_s()
        self._slam = None
        self._tether = (
            None
            if dive.tether is None
            else TetherPull(dive.tether, self.pool.density_kgm3, self.vehicle.mass_kg + self.vehicle.added_mass[0, 0])
        )
        self._contact_n, self._pressed_n, self._tether_n = snapshot.contact_n, snapshot.pressed_n, snapshot.tether_n
        self._wet, self._taken = snapshot.wet, snapshot.taken
        self._take_up(self._moments_s[snapshot.happened - 1] if snapshot.happened else -math.inf)

    # -- moving -------------------------------------------------------------------------------------------------------

    def write(self, name: str, command: Any) -> None:
        """Sets pulses or wrench, which hold until they are set again."""
        if name not in self.inputs:
            raise UnknownName(f"This plant has no input '{name}'.", fix=nearest(name, self.inputs))
        try:
            if name == "pwm":
                pulses, until_s = self._checked_pulses(command), command.until_s
                if math.isnan(until_s):
                    raise CommandError(
                        f"At {self.time_s:g} s the vehicle was sent pulses until nan s.",
                        fix="until_s is a time of the plant's; leave it out, and they hold until there are others.",
                    )
                self._pulses, self._pulses_until_s = pulses, until_s
            else:
                self._wrench = self._checked_wrench(command)
        except (AttributeError, TypeError) as error:  # of another kind, or made of something else than numbers
            kind = "PwmCommand" if name == "pwm" else "WrenchCommand"
            raise CommandError(
                f"At {self.time_s:g} s the vehicle was told {shown(command)}.", fix=f"send a {kind} of numbers."
            ) from error

    def _checked_wrench(self, command: WrenchCommand) -> Six:
        values = [*command.force_n, *command.moment_nm]
        if len(command.force_n) != 3 or len(command.moment_nm) != 3 or not math.isfinite(ordered_sum(values)):
            raise CommandError(
                f"At {self.time_s:g} s the vehicle was told {command}.",
                fix="send six finite numbers: x, y and z of force_n, and x, y and z of moment_nm.",
            )
        x, y, z, k, m, n = values
        return x, y, z, k, m, n

    def _checked_pulses(self, command: PwmCommand) -> list[float | None]:
        count = len(self.vehicle.thrusters)
        if not command.is_on:
            return [None] * count
        pulses = command.pulses_us or [STOP_US] * count
        if len(pulses) != count or not math.isfinite(ordered_sum(pulses)):
            raise CommandError(
                f"At {self.time_s:g} s {count} thrusters were sent the pulses {command.pulses_us}.",
                fix=f"send {count} finite numbers, 1500 to stop; or is_on=False for no pulses.",
            )
        least, most = ODD_PULSES_US
        for thruster, pulse in zip(self.vehicle.thrusters, pulses, strict=True):
            if not least <= pulse <= most:
                raise CommandError(
                    f"At {self.time_s:g} s thruster '{thruster.name}' was sent a pulse of {pulse!r} us.",
                    fix="1100 to 1900 us, 1500 to stop; or is_on=False for no pulses.",
                )
        return list(pulses)

    def step(self, dt_s: float) -> None:
        """Moves on by one step."""
        step_s = self.step_s
        if dt_s != step_s and not abs(dt_s - step_s) <= 1e-9:  # also NaN
            raise ParameterError(f"This plant moves in steps of {step_s} s, not {dt_s} s.", fix="use plant.step_s.")
        if self._steps * step_s >= self._next_s:
            self._happen()
        if self.dive.leak is not None:
            self._leak(self.dive.leak)
        self._advance()

    def _advance(self) -> None:
        """Moves on by one step, in which nothing begins or breaks."""
        push = self._thrust()
        if self._touches is None:
            self._touches = self._look()
        if self._touches:
            self._move_in_parts(push)
        else:
            self._move_unless_it_touches(push)
        self._steps += 1

    def _move_unless_it_touches(self, push: Sequence[float]) -> None:
        """Moves on by one free step; if something touches at its end, it is taken back, and gone in parts."""
        before = self._place, self._attitude, self._velocity, self._rate, self._rotation
        acceleration, guess, wet, taken = self._acceleration, self._guess, self._wet, self._taken
        others = self._mujoco.snapshot() if self._mujoco.has_others else None
        nu = self.through_water
        self._move_freely(nu, self._around(push, nu, self.step_s), self.step_s)
        (x, y, z), (at_x, at_y, at_z) = self._place, self._looked_at
        dx, dy, dz = x - at_x, y - at_y, z - at_z
        self._touches = dx * dx + dy * dy + dz * dz >= self._room_m2 and self._look()
        if not self._touches or self._parts == 1:
            return
        self._place, self._attitude, self._velocity, self._rate, self._rotation = before
        self._acceleration, self._guess, self._taken = acceleration, guess, taken
        if wet != self._wet:
            self._wet = wet
            self._set_wet(wet)
        if others is not None:
            self._mujoco.restore(others)
        self._touches = self._look()
        self._move_in_parts(push)

    def _move_in_parts(self, push: Sequence[float]) -> None:
        """Moves on by one step in parts, after a look; what contacts push is their mean."""
        part_s, begin = self._part_s, self._velocity
        pushes = []
        for _ in range(self._parts):
            nu = self.through_water
            around = self._around(push, nu, part_s)
            if self._touches:
                pushes.append(self._move_touching(nu, around, part_s))
            else:
                self._move_freely(nu, around, part_s)
            self._touches = self._look()
        if self._parts > 1:
            (wx, wy, wz), (vx, vy, vz), step_s = self._velocity, begin, self.step_s
            self._gained = ((wx - vx) / step_s, (wy - vy) / step_s, (wz - vz) / step_s)
        if pushes:
            fx, fy, fz = (ordered_sum(along) / self._parts for along in zip(*pushes, strict=True))
            self._contact_n = (fx, fy, fz)

    def _look(self) -> bool:
        """Has MuJoCo look for what touches, and finds how far the vehicle can go before it need look again."""
        body = self._mujoco
        body.put([*self._place, *self._attitude], [*self._velocity, *self._rate])
        touches = body.look()
        room_m = (
            0.0 if touches or body.has_others or not self._knows_room else self.pool.room_m(self._place) - self._half_m
        )
        self._looked_at, self._room_m2 = self._place, max(0.0, room_m) ** 2
        return touches

    def _move_freely(self, nu: Six, push: Sequence[float], step_s: float) -> None:
        """Moves on by the middle of the step, where nothing touches."""
        flotation = self._flotation
        if self._slam is not None:
            nu = self._hydro.less(nu, self._slam)
        r11, r12, r13, r21, r22, r23, r31, r32, r33 = self._rotation
        (mu, mv, mw, mp, mq, mr), change = self._hydro.advance(
            nu, (r31, r32, r33), push, flotation.net_n, flotation.arm, self._guess, step_s
        )
        self._attitude = attitude = turned(self._attitude, mp, mq, mr, step_s)
        self._rotation = rotation = rotation_of(attitude)
        s11, s12, s13, s21, s22, s23, s31, s32, s33 = rotation
        u, v, w, p, q, r = nu
        au, av, aw, ap, aq, ar = change
        bu, bv, bw, bp, bq, br = self._acceleration
        # The next step's, if it changes as much again.
        self._guess = (au + au - bu, av + av - bv, aw + aw - bw, ap + ap - bp, aq + aq - bq, ar + ar - br)
        self._acceleration = change
        u, v, w, p, q, r = (
            u + step_s * au, v + step_s * av, w + step_s * aw, p + step_s * ap, q + step_s * aq, r + step_s * ar,
        )  # fmt: skip
        if self._taken > self._wet:
            u, v, w, p, q, r = self._slowed((u, v, w, p, q, r))
        vx, vy, vz = self._velocity
        cx, cy, cz = self._current
        wx = s11 * u + s12 * v + s13 * w + cx
        wy = s21 * u + s22 * v + s23 * w + cy
        wz = s31 * u + s32 * v + s33 * w + cz
        self._gained = gained = ((wx - vx) / step_s, (wy - vy) / step_s, (wz - vz) / step_s)
        self._check_finite(nu, gained, change)
        if self._mujoco.has_others:
            self._mujoco.move(self._more, (*gained, ap, aq, ar), step_s)
        self._contact_n, self._pressed_n = None, 0.0
        self._velocity = (wx, wy, wz)
        self._rate = (p, q, r)
        # By the mean velocity, turned by the mean of both rotations: so the work of the weight is its energy.
        half = 0.5 * step_s
        x, y, z = self._place
        self._place = (
            x + step_s * cx + half * ((r11 + s11) * mu + (r12 + s12) * mv + (r13 + s13) * mw),
            y + step_s * cy + half * ((r21 + s21) * mu + (r22 + s22) * mv + (r23 + s23) * mw),
            z + step_s * cz + half * ((r31 + s31) * mu + (r32 + s32) * mv + (r33 + s33) * mw),
        )

    def _move_touching(self, nu: Six, push: Sequence[float], step_s: float) -> Vector:
        """Lets MuJoCo move on, with the water's forces at the step's begin: contacts may stop what would have moved.

        Returns:
            what contacts push, world frame.
        """
        self._taken = self._wet
        if self._slam is not None:
            push = [a - b / step_s for a, b in zip(push, self._slam, strict=True)]
        _, change = self._hydro.advance(
            nu, self._rotation[6:], push, self._flotation.net_n, self._flotation.arm, AT_REST, 0.0
        )
        self._acceleration = self._guess = change
        gained = self._seen_from_world(change)
        self._check_finite(nu, gained, change)
        body = self._mujoco
        if math.hypot(*self._velocity, *self._rate) > SLIDES:
            body.limit_grip(self._pressed_n)
        body.move(self._more, (*gained, *change[3:]), step_s)
        fx, fy, fz = body.touch()[:3]
        self._pressed_n = math.hypot(fx, fy, fz)
        x, y, z, qw, qx, qy, qz = body.pose()
        wx, wy, wz, p, q, r = body.velocity()
        vx, vy, vz = self._velocity
        self._gained = ((wx - vx) / step_s, (wy - vy) / step_s, (wz - vz) / step_s)
        self._place, self._attitude = (x, y, z), (qw, qx, qy, qz)
        self._velocity, self._rate = (wx, wy, wz), (p, q, r)
        self._rotation = rotation_of(self._attitude)
        return fx, fy, fz

    def _seen_from_world(self, change: Six) -> Vector:
        """Returns the linear acceleration in the world, from how the velocity's numbers in the body's frame change."""
        u, v, w = self._through_water()
        p, q, r = self._rate
        du, dv, dw = change[:3]
        return self._in_world(du + q * w - r * v, dv + r * u - p * w, dw + p * v - q * u)

    def _check_finite(self, nu: Six, gained: Vector, change: Six) -> None:
        """Raises a PlantError that says what has exploded, before MuJoCo or the next step sees it."""
        x, y, z = gained
        _, _, _, p, q, r = change
        if x * x + y * y + z * z + p * p + q * q + r * r < EXPLODED * EXPLODED:  # not so if one is NaN
            return
        lost = [axis for axis, value in zip(AXES, change, strict=True) if not abs(value) < EXPLODED]
        raise PlantError(
            f"At {self.time_s:g} s the acceleration in {', '.join(lost) or 'the world'} is no longer finite; the "
            f"velocities through the water were {in_words(nu)}.",
            fix="look at the last commands and at what was added to the vehicle; or try a shorter step.",
        )
