"""A lunar module in the x-z plane, under pymunk: it steers, touches down on two sprung legs, and stands or tips over.

pymunk moves the hull and finds out whether it meets the ground (`hull.py`); the feet are ours (`legs.py`).

How a step goes, and why in this order:

    1. pymunk:  position += velocity * dt,  then  velocity += g * dt
    2. kick:    velocity += (thrust, jets, legs, where the module now is) * dt / mass

This is the leapfrog scheme if the velocity is that of half a step earlier or later. So `reset` gives pymunk the
velocity half a step ahead, and `read` takes the half step off again. It costs nothing, a flight under constant force is
exact (pymunk alone ends g t dt / 2 too high), errors of smooth flight shrink with dt squared, and a bouncing leg gains
no energy: with forces from the position before the step it does. A command that jumps acts half a step late.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from snr_sim.plants.gear import Touchdown
from snr_sim.plants.hull import Hull, pymunk_module
from snr_sim.plants.lander import CEILING_M, EDGE_M, STEP_S, STILL_MPS, STILL_RADPS, Lander
from snr_sim.plants.legs import NO_KICK, REACH_M, Grip, Kick, Legs, Pose
from snr_sim.plants.module import TIPPED_RAD, LunarModule, PlaneStart
from snr_sim.plants.module_shapes import JETS_OUT_M, NOZZLE_BELOW_M, module_shapes
from snr_sim.plants.terrain import Terrain
from snr_sim.plants.terrain_shapes import terrain_shapes
from snr_sim.prelude.errors import PlantError

FAR_STEPS_MAX = 20  # the ground is looked for at least this often


class State(NamedTuple):
    """All of the plant: what pymunk holds (velocities half a step ahead), and what is ours. Defaults: a start."""

    body: Pose
    mass_kg: float
    fuel_kg: float
    terrain: Terrain
    steps: int = 0
    throttle: float = 0.0
    gimbal_rad: float = 0.0
    command: tuple[float, float, float] = (0.0, 0.0, 0.0)
    kick: Kick = NO_KICK
    leg_kick: Kick = NO_KICK
    grips_m: tuple[Grip, Grip] = (None, None)
    far_steps: int = 0
    still_steps: int = 0
    touchdown: Touchdown | None = None
    outcome: str | None = None


class Lander2D(Lander):
    """The lander in the plane, under pymunk.

    Args:
        module: its numbers.
        start_of: gives the start and the ground that belong to a seed.
        seed: of the first run.
        step_s: of integration; see `STEP_S`.
    """

    def __init__(
        self,
        module: LunarModule,
        start_of: Callable[[int], tuple[PlaneStart, Terrain]],
        seed: int = 0,
        step_s: float = STEP_S,
    ) -> None:
        super().__init__(module, start_of, step_s)
        self.engine = f"pymunk {pymunk_module().version}"
        self._legs = Legs(module.leg, module.gyration_m, step_s)
        self._hull = Hull(module.gyration_m, module.gravity_mps2, self._start(seed)[1])
        self.reset(seed)

    # -- start, and being put back ------------------------------------------------------------------------------------

    def reset(self, seed: int) -> None:
        """Builds the world anew and puts the module at the start that belongs to this seed."""
        start, terrain = self._start(seed)
        half_fall = 0.5 * self.module.gravity_mps2 * self.step_s
        (x, z), (vx, vz) = start.position_m, start.velocity_mps
        body = Pose(x, z, start.attitude_rad, vx, vz - half_fall, start.rate_radps)
        self.restore(State(body, start.mass_kg, start.fuel_kg, terrain))

    def snapshot(self) -> State:
        """Returns all of the state; it never changes afterwards."""
        return State(
            body=self._hull.pose(),
            steps=self._steps,
            mass_kg=self.mass_kg,
            fuel_kg=self.fuel_kg,
            throttle=self.throttle,
            gimbal_rad=self.gimbal_rad,
            command=(self._throttle_goal, self._gimbal_goal, self._jets),
            kick=self._kick,
            leg_kick=self._leg_kick,
            grips_m=self._legs.grips_m,
            far_steps=self._far_steps,
            still_steps=self._still_steps,
            terrain=self.terrain,
            touchdown=self.touchdown,
            outcome=self.outcome,
        )

    def restore(self, snapshot: State) -> None:
        """Puts back what `snapshot` returned."""
        module, hull = self.module, self._hull
        if hull.has_touched or hull.terrain is not snapshot.terrain:
            hull = Hull(module.gyration_m, module.gravity_mps2, snapshot.terrain)
        hull.put(snapshot.body)
        self._hull, self._move, self._push = hull, hull.move, hull.push
        self.terrain = snapshot.terrain
        self._steps = snapshot.steps
        self.mass_kg, self.fuel_kg = snapshot.mass_kg, snapshot.fuel_kg
        self.throttle, self.gimbal_rad = snapshot.throttle, snapshot.gimbal_rad
        self._throttle_goal, self._gimbal_goal, self._jets = snapshot.command
        self._kick, self._leg_kick = snapshot.kick, snapshot.leg_kick
        self._legs.grips_m = snapshot.grips_m
        self._far_steps, self._still_steps = snapshot.far_steps, snapshot.still_steps
        self.touchdown, self.outcome = snapshot.touchdown, snapshot.outcome
        self._pose: Pose | None = None

    # -- moving -------------------------------------------------------------------------------------------------------

    def _advance(self) -> None:
        """Moves the body, then lets engine, jets and legs push."""
        self._pose = None
        self._move(self.step_s)
        self._fire()
        self._far_steps -= 1
        if self._far_steps <= 0:
            self._meet_ground()

    def _fire(self) -> None:
        """Lets engine and jets push for one step, from the propellant there is."""
        burned = self._burn()
        # By the mean mass of the step: so any burn gives what the rocket equation says, to the step squared.
        push = burned * self.module.exhaust_mps / (self.mass_kg + 0.5 * burned)
        twist = self._jets * self.step_s / self.mass_kg
        if push > 0.0:
            turned = self.gimbal_rad
            side, up = push * math.sin(turned), push * math.cos(turned)
            twist += NOZZLE_BELOW_M * side
            # A push beside the centre of mass is the same push through it, and a twist: one call for both.
            self._push((side, up), (twist / up, 0.0))
            self._kick = (side, up, twist)
        else:
            if twist:
                self._hull.turn(twist / self.module.gyration_m**2)
            self._kick = (0.0, 0.0, twist)

    def _meet_ground(self) -> None:
        """Lets the feet push against the ground, ends the flight when it is over, and says when to look again."""
        x, z, attitude, vx, vz, rate = body = self._hull.pose()
        if not math.isfinite(x + z + attitude + vx + vz + rate):
            raise PlantError(
                f"At {self.time_s:g} s the state is no longer finite: {body}.",
                fix="look at the last commands and at the module's numbers: a mass or an inertia of 0?",
            )
        clearance = z - REACH_M - self.terrain.roof_m(x)
        if clearance > 0.0 and not self._hull.has_touched:
            self._leg_kick = NO_KICK
            nearing_mps = abs(vz) + abs(vx) + 1.0
            self._far_steps = min(FAR_STEPS_MAX, int(clearance / (nearing_mps * self.step_s)))
            if abs(x) > EDGE_M or z > CEILING_M:
                self._end("lost")
            return
        touching, self._leg_kick = self._legs.stand(body, self.mass_kg, self.terrain, self._hull.push_in_world)
        if (touching or self._hull.has_touched) and self.touchdown is None:
            self._judge_contact(self._at_one_moment(body, NO_KICK))
        if self.outcome is None and (self._hull.has_touched or (touching and abs(attitude) > TIPPED_RAD)):
            self._end("crashed")
        # Half a step ahead is near enough to tell whether it stands.
        still = touching == 2 and abs(vx) + abs(vz) < STILL_MPS and abs(rate) < STILL_RADPS
        self._settle(still)

    def _stand_still(self) -> None:
        """Takes all motion from the body."""
        # Half a step ahead of standing still: `read` takes the half step off.
        half_fall = 0.5 * self.module.gravity_mps2 * self.step_s
        self._hull.put(self._hull.pose()._replace(vx_mps=0.0, vz_mps=-half_fall, rate_radps=0.0))
        self._pose = None
        self._kick = self._leg_kick = NO_KICK

    # -- being measured -----------------------------------------------------------------------------------------------

    def _read_pose(self) -> Pose:
        """Returns position and velocity at the same moment; looked up once a step, however many ask."""
        if self._pose is None:
            self._pose = self._at_one_moment(self._hull.pose(), self._leg_kick)
        return self._pose

    def _at_one_moment(self, body: Pose, leg_kick: Kick) -> Pose:
        """Returns what pymunk holds, with its velocities back by half of the last kick."""
        x, z, attitude, vx, vz, rate = body
        side, up, twist = self._kick
        leg_x, leg_z, leg_twist = leg_kick
        cos, sin = math.cos(attitude), math.sin(attitude)
        kick_x = cos * side - sin * up + leg_x
        kick_z = sin * side + cos * up + leg_z - self.module.gravity_mps2 * self.step_s
        kick_rate = (twist + leg_twist) / self.module.gyration_m**2
        return Pose(x, z, attitude, vx - 0.5 * kick_x, vz - 0.5 * kick_z, rate - 0.5 * kick_rate)

    def _contact(self) -> list[bool]:
        """Returns whether feet touch: [left, right]."""
        return [grip is not None for grip in self._legs.grips_m]

    def _tilt_rad(self) -> float:
        """Returns the angle between the module's upward axis and the vertical."""
        return abs(math.remainder(self._hull.pose().attitude_rad, 2.0 * math.pi))

    def _has_hull_touched(self) -> bool:
        """Returns whether the hull has met the ground."""
        return self._hull.has_touched

    def scene(self) -> dict[str, Any]:
        """Returns the ground of this run and the shapes of the module."""
        return {"statics": terrain_shapes(self.terrain), "bodies": module_shapes()}

    def truth(self) -> dict[str, Any]:
        """Returns the true state for the recorder."""
        pose = self._read_pose()
        x, z, attitude = pose[:3]
        cos, sin = math.cos(attitude), math.sin(attitude)
        turn = [0.0, -math.sin(0.5 * attitude), 0.0, math.cos(0.5 * attitude)]
        left, right = self._legs.given_m(0, pose, self.terrain), self._legs.given_m(1, pose, self.terrain)
        thrust, fire = self.throttle * self.module.thrust_n, attitude - self.gimbal_rad
        nozzle_x, nozzle_z = x + sin * NOZZLE_BELOW_M, z - cos * NOZZLE_BELOW_M
        arrows = {"thrust": [nozzle_x, 0.0, nozzle_z, -math.sin(fire) * thrust, 0.0, math.cos(fire) * thrust]}
        if self._jets:
            arrows |= self._jet_arrows(x, z, cos, sin)
        poses = {
            "module": [x, 0.0, z, *turn],
            "left_legs": [x - sin * left, 0.0, z + cos * left, *turn],
            "right_legs": [x - sin * right, 0.0, z + cos * right, *turn],
        }
        return {"poses": poses, "arrows": arrows, "values": self._true_values(pose)}

    def _jet_arrows(self, x: float, z: float, cos: float, sin: float) -> dict[str, list[float]]:
        """Returns the pair of attitude jets that fires: one side up, the other down."""
        force = 0.5 * self._jets / JETS_OUT_M
        up_x, up_z = -sin * force, cos * force
        out_x, out_z = cos * JETS_OUT_M, sin * JETS_OUT_M
        return {
            "jet_right": [x + out_x - sin, 0.0, z + out_z + cos, up_x, 0.0, up_z],
            "jet_left": [x - out_x - sin, 0.0, z - out_z + cos, -up_x, 0.0, -up_z],
        }
