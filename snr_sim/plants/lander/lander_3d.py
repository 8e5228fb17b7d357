"""A lunar module in space, under MuJoCo: six directions of freedom and four sprung legs, where `lander_2d.py` has three
and two. Inputs, outputs and judge are the same (`lander.py`), and so is the flight, to what rounding leaves.

MuJoCo holds positions half a step ahead of velocities; `lander.py` gives the reason.
"""

from __future__ import annotations

import math
from typing import Any

from snr_sim.plants.attitude import integrate_attitude, rotation_of
from snr_sim.plants.lander.hull_3d import HULL, Hull3D
from snr_sim.plants.lander.lander import CEILING_M, EDGE_M, STILL_MPS, STILL_RADPS, Lander, LanderState
from snr_sim.plants.lander.legs import BodyPose, Kick
from snr_sim.plants.lander.module import TIPPED_RAD
from snr_sim.plants.lander.module_shapes import JETS_OUT_M, NOZZLE_BELOW_M, PADS_M, legged_module_shapes
from snr_sim.plants.lander.terrain import Terrain
from snr_sim.plants.lander.terrain_shapes import terrain_shapes

LEFT = frozenset(name for name, (x, _) in PADS_M.items() if x < 0.0)
RIGHT = frozenset(PADS_M) - LEFT
_TIPPED_UP = math.cos(TIPPED_RAD)
NOWHERE = (0.0, 0.0, 0.0)  # where a vector begins that is a direction


class Lander3D(Lander):
    """The lander in space, under MuJoCo; a start is in the x-z plane."""

    terrain: Terrain

    def _build(self, terrain: Terrain) -> None:
        self._hull = Hull3D(self.module, terrain, self.step_s)
        self.engine: str = self._hull.engine

    def reset(self, seed: int) -> None:
        """Put the module at the start that belongs to this seed, over its ground."""
        start, self.terrain = self._start(seed)
        (x, z), (vx, vz), half_s = start.position_m, start.velocity_mps, 0.5 * self.step_s
        attitude = start.attitude_rad + half_s * start.rate_radps
        half = 0.5 * attitude
        # Positive attitudes turn counter-clockwise seen from -y: about -y.
        turn = (math.cos(half), 0.0, -math.sin(half), 0.0)
        if self._hull.terrain is not self.terrain:
            self._build(self.terrain)
        coordinates, motion = (x + half_s * vx, 0.0, z + half_s * vz, *turn), (vx, 0.0, vz, 0.0, -start.rate_radps, 0.0)
        self._hull.put(coordinates, motion)
        self.restore(LanderState(self._hull.state(), start.mass_kg, start.fuel_kg, self.terrain, attitude_rad=attitude))

    def snapshot(self) -> LanderState:
        """Return the full state; the returned object is immutable."""
        return LanderState(body=self._hull.state(), attitude_rad=self._attitude, **self._flight_state())

    def restore(self, snapshot: LanderState) -> None:
        """Put back what `snapshot` returned."""
        self._restore_flight(snapshot)
        if self._hull.terrain is not self.terrain:
            self._build(self.terrain)
        self._hull.put_state(snapshot.body)
        self._hull.set_mass(snapshot.mass_kg)
        self._hull.update()
        self._attitude = snapshot.attitude_rad
        self._pose: BodyPose | None = None

    def _advance(self) -> None:
        """Let engine and jets push, end the flight when it is over, and move the module."""
        self._pose = None
        hull, mass_kg = self._hull, self.mass_kg
        kick = self._fire()
        if hull.contacts:
            self._meet_ground(kick)
        else:
            self.still_steps = 0
        if self.outcome is not None:
            return
        hull.move()
        if self.mass_kg != mass_kg:
            hull.set_mass(self.mass_kg)
        hull.update()
        self._track_attitude()
        x, _, z = hull.coordinates[:3]
        if not hull.contacts and (abs(x) > EDGE_M or z > CEILING_M):
            self._end("out_of_bounds")

    def _track_attitude(self) -> None:
        """Follow the attitude through full turns, as in the plane."""
        axes = self._hull.axes
        angle = math.atan2(-axes[2], axes[8])  # the module's upward axis leans to -x
        self._attitude += math.remainder(angle - self._attitude, 2.0 * math.pi)

    def _fire(self) -> Kick:
        """Let engine and jets push for one step; return the change of velocity x, z and rate, weight and all."""
        axes, step_s, weighed_kg = self._hull.axes, self.step_s, self.mass_kg
        side, up, twist = self._burn()
        x, y, z = side * axes[0] + up * axes[2], side * axes[3] + up * axes[5], side * axes[6] + up * axes[8]
        # MuJoCo still has the mass of before the step; a force that is meant for the mean mass is scaled by as much.
        force = weighed_kg / step_s
        self._hull.push((force * x, force * y, force * z), (0.0, -force * twist, 0.0))
        return x, z - self.module.gravity_mps2 * step_s, twist / self.module.gyration_m**2

    def _meet_ground(self, kick: Kick) -> None:
        """End the flight when it is over; before the legs push in this step."""
        contacts = self._hull.contacts
        vx, vy, vz, *rates = self._hull.motion[:6]
        if self.touchdown is None:
            x, _, z = self._hull.coordinates[:3]
            moves = (v + 0.5 * gained for v, gained in zip((vx, vz, -rates[1]), kick, strict=True))
            self._judge_contact(BodyPose(x, z, self._attitude, *moves))
        if self.outcome is None and (HULL in contacts or self._hull.axes[8] < _TIPPED_UP):
            self._end("crashed")
        still = abs(vx) + abs(vy) + abs(vz) < STILL_MPS and max(map(abs, rates)) < STILL_RADPS
        self._settle(still and all(self._contact()))

    def _stand_still(self) -> None:
        self._hull.stop()
        self._pose = None

    def _read_pose(self) -> BodyPose:
        """Return position and velocity at the same moment; looked up once a step, however many ask."""
        if self._pose is None:
            (x, _, z), half_s = self._hull.coordinates[:3], 0.5 * self.step_s
            vx, _, vz, _, about_y, _ = self._hull.motion[:6]
            self._pose = BodyPose(x - half_s * vx, z - half_s * vz, self._attitude + half_s * about_y, vx, vz, -about_y)
        return self._pose

    def _contact(self) -> list[bool]:
        return [bool(side & self._hull.contacts) for side in (LEFT, RIGHT)]

    def _tilt_rad(self) -> float:
        return math.acos(min(1.0, max(-1.0, self._hull.axes[8])))

    def _has_hull_touched(self) -> bool:
        return HULL in self._hull.contacts

    def scene(self) -> dict[str, Any]:
        """Return the ground of this run and the shapes of the module, each leg by itself."""
        return {"statics": terrain_shapes(self.terrain), "bodies": legged_module_shapes()}

    def truth(self) -> dict[str, Any]:
        """Return the true state for the recorder."""
        hull, (x, z) = self._hull, self._read_pose()[:2]
        y = hull.coordinates[1] - 0.5 * self.step_s * hull.motion[1]
        w, i, j, k = hull.coordinates[3:7]
        p, q, r = hull.motion[3:6]
        attitude = integrate_attitude((w, i, j, k), p, q, r, -0.5 * self.step_s)
        axes = rotation_of(attitude)

        def in_world(a: float, b: float, c: float, *, at: tuple[float, ...] = (x, y, z)) -> list[float]:
            return [at[n] + axes[3 * n] * a + axes[3 * n + 1] * b + axes[3 * n + 2] * c for n in range(3)]

        turn = [*attitude[1:], attitude[0]]
        poses = {"module": [x, y, z, *turn]}
        for name in PADS_M:
            poses[name] = [*in_world(*hull.deflection_m(name)), *turn]
        thrust = self.throttle * self.module.thrust_n
        push = thrust * math.sin(self.gimbal_rad), 0.0, thrust * math.cos(self.gimbal_rad)
        vectors = {"thrust": [*in_world(0.0, 0.0, -NOZZLE_BELOW_M), *in_world(*push, at=NOWHERE)]}
        if self.command[2]:
            # The pair of attitude jets that fires: one side up, the other down.
            force = 0.5 * self.command[2] / JETS_OUT_M
            vectors["jet_right"] = [*in_world(JETS_OUT_M, 0.0, 1.0), *in_world(0.0, 0.0, force, at=NOWHERE)]
            vectors["jet_left"] = [*in_world(-JETS_OUT_M, 0.0, 1.0), *in_world(0.0, 0.0, -force, at=NOWHERE)]
        return {"poses": poses, "vectors": vectors, "values": self._true_values(self._read_pose())}
