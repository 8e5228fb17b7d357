"""A lunar module in space, under MuJoCo: six directions of freedom and four sprung legs, where `lander_2d.py` has three
and two. Inputs, outputs and judge are the same (`lander.py`), and so is the flight, to what rounding leaves.

How a step goes:

    1. MuJoCo:  velocity += (thrust, jets, legs, where the module is) * dt / mass,  then  position += velocity * dt
    2. engine and jets say how they push at the new place, for the next step

This is the leapfrog scheme if the velocity is that of half a step ago. So `reset` gives MuJoCo the velocity of half a
step before the start, and `read` adds the half step. A flight under constant force is exact (MuJoCo alone ends
g t dt / 2 too low), and a command that jumps acts half a step late, as in the plane.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

from snr_sim.plants.gear import Touchdown
from snr_sim.plants.hull_3d import HULL, Hull3D
from snr_sim.plants.lander import CEILING_M, EDGE_M, STEP_S, STILL_MPS, STILL_RADPS, Lander
from snr_sim.plants.legs import Pose
from snr_sim.plants.module import TIPPED_RAD, LunarModule, PlaneStart
from snr_sim.plants.module_shapes import JETS_OUT_M, NOZZLE_BELOW_M, PADS_M, legged_module_shapes
from snr_sim.plants.terrain import Terrain
from snr_sim.plants.terrain_shapes import terrain_shapes

LEFT = frozenset(name for name, (x, _) in PADS_M.items() if x < 0.0)
RIGHT = frozenset(PADS_M) - LEFT
_TIPPED_UP = math.cos(TIPPED_RAD)

# Change of velocity x, y, z [m/s] in the world's frame, then of rate [rad/s] in the body's.
Kick3D: TypeAlias = tuple[float, ...]
NO_KICK: Kick3D = (0.0,) * 6


class State(NamedTuple):
    """All of the plant: what MuJoCo holds (velocities of half a step ago), and what is ours."""

    body: tuple[float, ...]
    attitude_rad: float
    mass_kg: float
    weighed_kg: float
    fuel_kg: float
    terrain: Terrain
    steps: int
    throttle: float
    gimbal_rad: float
    command: tuple[float, float, float]
    kick: Kick3D
    leg_kick: Kick3D
    still_steps: int
    touchdown: Touchdown | None
    outcome: str | None


class Lander3D(Lander):
    """The lander in space, under MuJoCo.

    Args:
        module: its numbers.
        start_of: gives the start and the ground that belong to a seed: in the x-z plane, as for `Lander2D`.
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
        self._hull = Hull3D(module, self._start(seed)[1], step_s)
        self.engine = self._hull.engine
        self.reset(seed)

    # -- start, and being put back ------------------------------------------------------------------------------------

    def reset(self, seed: int) -> None:
        """Puts the module at the start that belongs to this seed, over its ground."""
        start, self.terrain = self._start(seed)
        half_fall = 0.5 * self.module.gravity_mps2 * self.step_s
        (x, z), (vx, vz), half = start.position_m, start.velocity_mps, 0.5 * start.attitude_rad
        # Positive attitudes turn counter-clockwise seen from -y: about -y.
        turn = (math.cos(half), 0.0, -math.sin(half), 0.0)
        self._build()
        self._hull.put((x, 0.0, z, *turn), (vx, 0.0, vz + half_fall, 0.0, -start.rate_radps, 0.0))
        self._hull.weigh(start.mass_kg)
        self._hull.look()
        self._attitude = start.attitude_rad
        self.mass_kg = self._weighed = start.mass_kg
        self.fuel_kg = start.fuel_kg
        self._steps = self._still_steps = 0
        self.throttle = self.gimbal_rad = self._throttle_goal = self._gimbal_goal = self._jets = 0.0
        self._kick: Kick3D = (0.0, 0.0, -2.0 * half_fall, 0.0, 0.0, 0.0)
        self._leg_kick = NO_KICK
        self.touchdown = self.outcome = None
        self._pose: Pose | None = None

    def _build(self) -> None:
        """Builds the world anew if the ground is another."""
        if self._hull.terrain is not self.terrain:
            self._hull = Hull3D(self.module, self.terrain, self.step_s)

    def snapshot(self) -> State:
        """Returns all of the state; it never changes afterwards."""
        return State(
            body=self._hull.state(),
            attitude_rad=self._attitude,
            mass_kg=self.mass_kg,
            weighed_kg=self._weighed,
            fuel_kg=self.fuel_kg,
            terrain=self.terrain,
            steps=self._steps,
            throttle=self.throttle,
            gimbal_rad=self.gimbal_rad,
            command=(self._throttle_goal, self._gimbal_goal, self._jets),
            kick=self._kick,
            leg_kick=self._leg_kick,
            still_steps=self._still_steps,
            touchdown=self.touchdown,
            outcome=self.outcome,
        )

    def restore(self, snapshot: State) -> None:
        """Puts back what `snapshot` returned."""
        self.terrain = snapshot.terrain
        self._build()
        self._hull.put_state(snapshot.body)
        self._hull.weigh(snapshot.weighed_kg)
        self._hull.look()
        self._attitude = snapshot.attitude_rad
        self.mass_kg, self._weighed, self.fuel_kg = snapshot.mass_kg, snapshot.weighed_kg, snapshot.fuel_kg
        self._steps, self._still_steps = snapshot.steps, snapshot.still_steps
        self.throttle, self.gimbal_rad = snapshot.throttle, snapshot.gimbal_rad
        self._throttle_goal, self._gimbal_goal, self._jets = snapshot.command
        self._kick, self._leg_kick = snapshot.kick, snapshot.leg_kick
        self.touchdown, self.outcome = snapshot.touchdown, snapshot.outcome
        self._pose = None

    # -- moving -------------------------------------------------------------------------------------------------------

    def _advance(self) -> None:
        """Moves the module, then lets engine and jets push where it now is, and looks at the ground."""
        self._pose = None
        hull, before, kick, had_contacts = self._hull, self._hull.motion, self._kick, self._hull.contacts
        hull.move()
        burned = self._burn()
        # The mean mass of the step: so any burn gives what the rocket equation says, to the step squared.
        weighed = self.mass_kg + 0.5 * burned
        if weighed != self._weighed:
            hull.weigh(weighed)
            self._weighed = weighed
        hull.look()
        self._note_turn()
        self._fire(burned * self.module.exhaust_mps / self.step_s)
        if hull.contacts or had_contacts:
            after = hull.motion
            self._leg_kick = tuple(a - b - c for a, b, c in zip(after[:6], before[:6], kick, strict=True))
            self._meet_ground()
        else:
            self._leg_kick = NO_KICK
            x, _, z = hull.place[:3]
            if abs(x) > EDGE_M or z > CEILING_M:
                self._end("lost")

    def _note_turn(self) -> None:
        """Follows the attitude through full turns, as in the plane."""
        axes = self._hull.axes
        turned = math.atan2(-axes[2], axes[8])  # the module's upward axis leans to -x
        self._attitude += math.remainder(turned - self._attitude, 2.0 * math.pi)

    def _fire(self, thrust_n: float) -> None:
        """Lets engine and jets push for one step."""
        axes, step_s = self._hull.axes, self.step_s
        side, up = thrust_n * math.sin(self.gimbal_rad), thrust_n * math.cos(self.gimbal_rad)
        force = side * axes[0] + up * axes[2], side * axes[3] + up * axes[5], side * axes[6] + up * axes[8]
        torque = -self._jets - NOZZLE_BELOW_M * side
        self._hull.push(force, (0.0, torque, 0.0))
        per_kg = step_s / self._weighed
        fall = self.module.gravity_mps2 * step_s
        turned = torque * per_kg / self.module.gyration_m**2
        self._kick = force[0] * per_kg, force[1] * per_kg, force[2] * per_kg - fall, 0.0, turned, 0.0

    def _meet_ground(self) -> None:
        """Ends the flight when it is over."""
        contacts = self._hull.contacts
        if contacts and self.touchdown is None:
            self._judge_contact(self._at_one_moment(NO_KICK))
        if self.outcome is None and (HULL in contacts or (contacts and self._hull.axes[8] < _TIPPED_UP)):
            self._end("crashed")
        vx, vy, vz, *rates = self._hull.motion[:6]
        still = abs(vx) + abs(vy) + abs(vz) < STILL_MPS and max(map(abs, rates)) < STILL_RADPS
        self._settle(still and all(self._contact()))

    def _stand_still(self) -> None:
        """Takes all motion from the module; `read` has none to add either."""
        self._hull.stop()
        self._kick = self._leg_kick = NO_KICK
        self._pose = None

    # -- being measured -----------------------------------------------------------------------------------------------

    def _read_pose(self) -> Pose:
        """Returns position and velocity at the same moment; looked up once a step, however many ask."""
        if self._pose is None:
            self._pose = self._at_one_moment(self._leg_kick)
        return self._pose

    def _at_one_moment(self, leg_kick: Kick3D) -> Pose:
        """Returns what MuJoCo holds, with its velocities ahead by half of the next kick."""
        x, _, z = self._hull.place[:3]
        vx, _, vz, _, about_y, _ = self._hull.motion[:6]
        kick_x, _, kick_z, _, kick_y, _ = (own + legs for own, legs in zip(self._kick, leg_kick, strict=True))
        return Pose(x, z, self._attitude, vx + 0.5 * kick_x, vz + 0.5 * kick_z, -about_y - 0.5 * kick_y)

    def _contact(self) -> list[bool]:
        """Returns whether feet touch: [left, right]."""
        return [bool(side & self._hull.contacts) for side in (LEFT, RIGHT)]

    def _tilt_rad(self) -> float:
        """Returns the angle between the module's upward axis and the vertical."""
        return math.acos(min(1.0, max(-1.0, self._hull.axes[8])))

    def _has_hull_touched(self) -> bool:
        """Returns whether the hull has met the ground."""
        return HULL in self._hull.contacts

    def scene(self) -> dict[str, Any]:
        """Returns the ground of this run and the shapes of the module, each leg by itself."""
        return {"statics": terrain_shapes(self.terrain), "bodies": legged_module_shapes()}

    def truth(self) -> dict[str, Any]:
        """Returns the true state for the recorder."""
        x, y, z, w, *turn = self._hull.place[:7]
        poses = {"module": [x, y, z, *turn, w]}
        for name in PADS_M:
            poses[name] = [*self._in_world(*self._hull.given_m(name)), *turn, w]
        thrust = self.throttle * self.module.thrust_n
        push = thrust * math.sin(self.gimbal_rad), 0.0, thrust * math.cos(self.gimbal_rad)
        arrows = {"thrust": [*self._in_world(0.0, 0.0, -NOZZLE_BELOW_M), *self._turned(*push)]}
        if self._jets:
            # The pair of attitude jets that fires: one side up, the other down.
            force = 0.5 * self._jets / JETS_OUT_M
            arrows["jet_right"] = [*self._in_world(JETS_OUT_M, 0.0, 1.0), *self._turned(0.0, 0.0, force)]
            arrows["jet_left"] = [*self._in_world(-JETS_OUT_M, 0.0, 1.0), *self._turned(0.0, 0.0, -force)]
        return {"poses": poses, "arrows": arrows, "values": self._true_values(self._read_pose())}

    def _turned(self, x: float, y: float, z: float) -> list[float]:
        """Returns a vector of the body's frame in the world's."""
        axes = self._hull.axes
        return [axes[i] * x + axes[i + 1] * y + axes[i + 2] * z for i in (0, 3, 6)]

    def _in_world(self, x: float, y: float, z: float) -> list[float]:
        """Returns a place in the body's frame in the world's."""
        return [a + b for a, b in zip(self._hull.place[:3], self._turned(x, y, z), strict=True)]
