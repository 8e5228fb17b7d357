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
from snr_sim.plants.legs import NO_KICK, REACH_M, Grip, Kick, Legs, Pose
from snr_sim.plants.module import TIPPED_RAD, LunarModule, PlaneStart
from snr_sim.plants.module_shapes import JETS_OUT_M, NOZZLE_BELOW_M, PADS_BELOW_M, module_shapes
from snr_sim.plants.terrain import HALF_WIDTH_M, ROOF_REACH_M, Terrain
from snr_sim.plants.terrain_shapes import terrain_shapes
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownName, nearest
from snr_sim.prelude.signals import EngineCommand, InertialReading, RadarReading

# Halving it moves a touchdown by less than 1 cm/s and, after it, the module by a few millimetres (measured in
# tests/plants/test_lander_2d.py). Four times as long would still be stable: the stiffest motion, a foot gripping
# sideways, has 25 steps in each radian. Shorter steps only cost time.
STEP_S = 0.005
FAR_STEPS_MAX = 20  # the ground is looked for at least this often
STILL_MPS, STILL_RADPS, SETTLE_S = 0.05, 0.01, 0.5  # slower than this for so long, on both feet: it stands
CEILING_M = 20_000.0
EDGE_M = HALF_WIDTH_M - ROOF_REACH_M


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


class Lander2D:
    """The lander in the plane. Keeps the promise of Plant.

    Args:
        module: its numbers.
        start_of: gives the start and the ground that belong to a seed.
        seed: of the first run.
        step_s: of integration; see `STEP_S`.

    Attributes:
        touchdown: the first contact, once there was one.
        outcome: 'landed', 'crashed', 'out_of_fuel' (crashed with a dry tank) or 'lost' (left the region), once
            over. From then on it stands still.
    """

    inputs = ("engine",)
    outputs = ("radar", "inertial")

    def __init__(
        self,
        module: LunarModule,
        start_of: Callable[[int], tuple[PlaneStart, Terrain]],
        seed: int = 0,
        step_s: float = STEP_S,
    ) -> None:
        self.engine = f"pymunk {pymunk_module().version}"
        self.module = module
        self.start_of = start_of
        self.step_s: float = step_s
        self._lag_gain = -math.expm1(-step_s / module.throttle_lag_s) if module.throttle_lag_s > 0.0 else 1.0
        self._gimbal_step = module.gimbal_rate_radps * step_s
        self._flow_step = module.thrust_n / module.exhaust_mps * step_s  # propellant of one step at full throttle
        self._legs = Legs(module.leg, module.gyration_m, step_s)
        self._hull = Hull(module.gyration_m, module.gravity_mps2, start_of(seed)[1])
        self.reset(seed)

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset: a count, so that nothing adds up."""
        return self._steps * self.step_s

    # -- start, and being put back ------------------------------------------------------------------------------------

    def reset(self, seed: int) -> None:
        """Builds the world anew and puts the module at the start that belongs to this seed."""
        start, terrain = self.start_of(seed)
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

    def write(self, name: str, command: EngineCommand) -> None:
        """Sets throttle, gimbal and jets, clamped to what the module can do."""
        if name != "engine":
            raise UnknownName(f"This plant has no input '{name}'.", fix=nearest(name, self.inputs))
        throttle, gimbal, jets = command.throttle, command.gimbal_rad, command.attitude
        if not math.isfinite(throttle + gimbal + jets):
            raise PlantError(f"At {self.time_s:g} s the engine was told {command}.", fix="send finite numbers.")
        self._throttle_goal = self.module.throttle.snap(min(1.0, max(0.0, throttle)))
        limit = self.module.gimbal_rad
        self._gimbal_goal = min(limit, max(-limit, gimbal))
        self._jets = min(1.0, max(-1.0, jets)) * self.module.jets_nm

    def step(self, dt_s: float) -> None:
        """Moves on by one step."""
        if dt_s != self.step_s and abs(dt_s - self.step_s) > 1e-9:
            raise ParameterError(
                f"This plant moves in steps of {self.step_s} s, not {dt_s} s.", fix="use plant.step_s."
            )
        self._steps += 1
        if self.outcome is not None:
            return
        self._pose = None
        self._move(self.step_s)
        self._fire()
        self._far_steps -= 1
        if self._far_steps <= 0:
            self._meet_ground()

    def _fire(self) -> None:
        """Lets engine and jets push for one step, from the propellant there is."""
        throttle = self.throttle
        if throttle != self._throttle_goal:
            throttle += (self._throttle_goal - throttle) * self._lag_gain
            if abs(throttle - self._throttle_goal) < 1e-3:
                throttle = self._throttle_goal
            self.throttle = throttle
        if self.gimbal_rad != self._gimbal_goal:
            most = self._gimbal_step
            self.gimbal_rad += min(most, max(-most, self._gimbal_goal - self.gimbal_rad))
        burned = throttle * self._flow_step
        if burned >= self.fuel_kg:
            burned = self.fuel_kg
            self.throttle = 0.0
            self._throttle_goal = 0.0
        self.fuel_kg -= burned
        self.mass_kg -= burned
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
            self._judge_contact(body)
        if self.outcome is None and (self._hull.has_touched or (touching and abs(attitude) > TIPPED_RAD)):
            self._end("crashed")
        # Half a step ahead is near enough to tell whether it stands.
        still = touching == 2 and abs(vx) + abs(vz) < STILL_MPS and abs(rate) < STILL_RADPS
        self._still_steps = self._still_steps + 1 if still else 0
        if self.outcome is None and self._still_steps * self.step_s >= SETTLE_S:
            self._end("landed")

    def _judge_contact(self, body: Pose) -> None:
        """Writes down the first contact, as it was before legs pushed, and ends the flight if they cannot take it."""
        pose = self._at_one_moment(body, NO_KICK)
        self.touchdown = Touchdown(
            vertical_mps=-pose.vz_mps,
            lateral_mps=pose.vx_mps,
            attitude_deg=math.degrees(pose.attitude_rad),
            rate_degps=math.degrees(pose.rate_radps),
        )
        if not self.module.gear.holds(self.touchdown):
            self._end("crashed" if self.fuel_kg > 0.0 else "out_of_fuel")

    def _end(self, outcome: str) -> None:
        """Stops everything where it is."""
        self.outcome = outcome
        # Half a step ahead of standing still: `read` takes the half step off.
        half_fall = 0.5 * self.module.gravity_mps2 * self.step_s
        self._hull.put(self._hull.pose()._replace(vx_mps=0.0, vz_mps=-half_fall, rate_radps=0.0))
        self._pose = None
        self._kick = self._leg_kick = NO_KICK
        self.throttle = self._throttle_goal = self._jets = 0.0

    @property
    def why(self) -> str:
        """What ended it badly, in words; empty if nothing did."""
        if self.outcome == "lost":
            return "it left the region that is simulated"
        passed = self.module.gear.passed(self.touchdown) if self.touchdown is not None else []
        if self.outcome == "crashed" and not passed:  # the gear took the first contact, but not what followed
            passed = ["the hull met the ground" if self._hull.has_touched else "it tipped over on its legs"]
        return "; ".join(passed)

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

    def read(self, name: str) -> RadarReading | InertialReading:
        """Returns what a sensor without faults would say."""
        pose = self._read_pose()
        x, z, attitude, vx, vz, rate = pose
        if name == "inertial":
            contact = [grip is not None for grip in self._legs.grips_m]
            return InertialReading([x, z], [vx, vz], attitude, rate, self.fuel_kg, contact, self.time_s)
        if name == "radar":
            return RadarReading(z - PADS_BELOW_M - self.terrain.ground(x)[0], vz, self.time_s)
        raise UnknownName(f"This plant has no output '{name}'.", fix=nearest(name, self.outputs))

    def scene(self) -> dict[str, Any]:
        """Returns the ground of this run and the shapes of the module."""
        return {"statics": terrain_shapes(self.terrain), "bodies": module_shapes()}

    def truth(self) -> dict[str, Any]:
        """Returns the true state for the recorder."""
        pose = self._read_pose()
        x, z, attitude, vx, vz, _ = pose
        cos, sin = math.cos(attitude), math.sin(attitude)
        height = self.terrain.ground(x)[0]
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
        return {
            "poses": poses,
            "arrows": arrows,
            "values": {
                "altitude_m": z - PADS_BELOW_M - height,
                "vertical_mps": vz,
                "lateral_mps": vx,
                "throttle": self.throttle,
                "fuel_kg": self.fuel_kg,
                "attitude_deg": math.degrees(attitude),
            },
        }

    def _jet_arrows(self, x: float, z: float, cos: float, sin: float) -> dict[str, list[float]]:
        """Returns the pair of attitude jets that fires: one side up, the other down."""
        force = 0.5 * self._jets / JETS_OUT_M
        up_x, up_z = -sin * force, cos * force
        out_x, out_z = cos * JETS_OUT_M, sin * JETS_OUT_M
        return {
            "jet_right": [x + out_x - sin, 0.0, z + out_z + cos, up_x, 0.0, up_z],
            "jet_left": [x - out_x - sin, 0.0, z - out_z + cos, -up_x, 0.0, -up_z],
        }
