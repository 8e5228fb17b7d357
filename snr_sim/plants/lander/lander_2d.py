"""A lunar module in the x-z plane, under pymunk: it steers, touches down on two sprung legs, and stands or tips over.

pymunk moves the hull and finds out whether it meets the ground (`hull.py`); the feet are ours (`legs.py`).

pymunk moves first and lets weight pull then, so the velocity that it holds has the pull of the next step in it already:
`reset` puts it there, and `read` takes it off again, too (`lander.py` has the rest).
"""

from __future__ import annotations

import math
from typing import Any

from snr_sim.plants.lander.hull import Hull
from snr_sim.plants.lander.lander import CEILING_M, EDGE_M, STILL_MPS, STILL_RADPS, Lander, LanderState
from snr_sim.plants.lander.legs import MAX_CONTACT_RADIUS_M, BodyPose, Kick, Legs
from snr_sim.plants.lander.module import TIPPED_RAD
from snr_sim.plants.lander.module_shapes import JETS_OUT_M, NOZZLE_BELOW_M, module_shapes
from snr_sim.plants.lander.terrain import Terrain
from snr_sim.plants.lander.terrain_shapes import terrain_shapes
from snr_sim.plants.pymunk_engine import pymunk_module
from snr_sim.prelude.errors import PlantError

MAX_FAR_STEPS = 20  # the ground is looked for at least this often


class Lander2D(Lander):
    """The lander in the plane, under pymunk."""

    def _build(self, terrain: Terrain) -> None:
        module = self.module
        self._fall_mps = module.gravity_mps2 * self.step_s  # what weight gives in a step
        self.engine: str = f"pymunk {pymunk_module().version}"
        self._legs = Legs(module.leg, module.gyration_m, self.step_s)
        self._hull = Hull(module.gyration_m, module.gravity_mps2, terrain)

    def reset(self, seed: int) -> None:
        """Rebuild the world and put the module at the start that belongs to this seed."""
        start, terrain = self._start(seed)
        (x, z), (vx, vz), half_s = start.position_m, start.velocity_mps, 0.5 * self.step_s
        attitude, rate = start.attitude_rad + half_s * start.rate_radps, start.rate_radps
        body = BodyPose(x + half_s * vx, z + half_s * vz, attitude, vx, vz - self._fall_mps, rate)
        self.restore(LanderState(body, start.mass_kg, start.fuel_kg, terrain))

    def snapshot(self) -> LanderState:
        """Return the full state; the returned object is immutable."""
        return LanderState(
            body=self._hull.pose(),
            has_hull_touched=self._hull.has_touched,
            grips_m=self._legs.grips_m,
            far_steps=self._far_steps,
            **self._flight_state(),
        )

    def restore(self, snapshot: LanderState) -> None:
        """Put back what `snapshot` returned."""
        module, hull = self.module, self._hull
        if hull.has_touched or hull.terrain is not snapshot.terrain:
            hull = Hull(module.gyration_m, module.gravity_mps2, snapshot.terrain)
        hull.has_touched = snapshot.has_hull_touched
        hull.put(snapshot.body)
        self._hull, self._move, self._push = hull, hull.move, hull.push
        self._legs.grips_m, self._far_steps = snapshot.grips_m, snapshot.far_steps
        self._restore_flight(snapshot)
        self._pose: BodyPose | None = None

    def _advance(self) -> None:
        self._pose = None
        kick = self._fire()
        self._far_steps -= 1
        if self._far_steps <= 0 or self._hull.has_touched:
            self._meet_ground(kick)
        if self.outcome is None:
            self._move(self.step_s)

    def _fire(self) -> Kick:
        """Let engine and jets push for one step, from the propellant there is; return how, in the module's frame."""
        side, up, twist = kick = self._burn()
        if up > 0.0:
            # An off-centre impulse equals one through the centre of mass plus an angular impulse: one call for both.
            self._push((side, up), (twist / up, 0.0))
        elif twist:
            self._hull.turn(twist / self.module.gyration_m**2)
        return kick

    def _meet_ground(self, kick: Kick) -> None:
        """Apply the feet's forces, end the flight when it is over, and return when to check again."""
        x, z, attitude, vx, vz, rate = body = self._hull.pose()
        if not math.isfinite(x + z + attitude + vx + vz + rate):
            raise PlantError(
                f"At {self.time_s:g} s the state is no longer finite: {body}.",
                fix="look at the last commands and at the module's numbers: a mass or an inertia of 0?",
            )
        clearance = z - MAX_CONTACT_RADIUS_M - self.terrain.roof_m(x)
        if clearance > 0.0 and not self._hull.has_touched:
            nearing_mps = abs(vz) + abs(vx) + 1.0
            self._far_steps = min(MAX_FAR_STEPS, int(clearance / (nearing_mps * self.step_s)))
            if abs(x) > EDGE_M or z > CEILING_M:
                self._end("out_of_bounds")
            return
        touching = self._legs.stand(body, self.mass_kg, self.terrain, self._hull.push_in_world)
        if (touching or self._hull.has_touched) and self.touchdown is None:
            self._judge_contact(self._midway(body, kick))
        if self.outcome is None and (self._hull.has_touched or (touching and abs(attitude) > TIPPED_RAD)):
            self._end("crashed")
        # At the end of the step, but for the legs: accurate enough to decide whether it is at rest.
        still = touching == 2 and abs(vx) + abs(vz) < STILL_MPS and abs(rate) < STILL_RADPS
        self._settle(still)

    def _midway(self, body: BodyPose, kick: Kick) -> BodyPose:
        """Return the motion in the middle of a step, where its position is, from the motion at the end and the kick."""
        side, up, twist = kick
        cos, sin = math.cos(body.attitude_rad), math.sin(body.attitude_rad)
        kick_x, kick_z = cos * side - sin * up, sin * side + cos * up - self._fall_mps
        return body._replace(
            vx_mps=body.vx_mps - 0.5 * kick_x,
            vz_mps=body.vz_mps - 0.5 * kick_z,
            rate_radps=body.rate_radps - 0.5 * twist / self.module.gyration_m**2,
        )

    def _stand_still(self) -> None:
        self._hull.put(self._hull.pose()._replace(vx_mps=0.0, vz_mps=-self._fall_mps, rate_radps=0.0))
        self._pose = None

    def _read_pose(self) -> BodyPose:
        """Return position and velocity at the same moment; looked up once a step, however many ask."""
        if self._pose is None:
            x, z, attitude, vx, vz, rate = self._hull.pose()
            vz, half_s = vz + self._fall_mps, 0.5 * self.step_s
            self._pose = BodyPose(x - half_s * vx, z - half_s * vz, attitude - half_s * rate, vx, vz, rate)
        return self._pose

    def _contact(self) -> list[bool]:
        return [grip is not None for grip in self._legs.grips_m]

    def _tilt_rad(self) -> float:
        return abs(math.remainder(self._hull.pose().attitude_rad, 2.0 * math.pi))

    def _has_hull_touched(self) -> bool:
        return self._hull.has_touched

    def scene(self) -> dict[str, Any]:
        """Return the ground of this run and the shapes of the module."""
        return {"statics": terrain_shapes(self.terrain), "bodies": module_shapes()}

    def truth(self) -> dict[str, Any]:
        """Return the true state for the recorder."""
        pose = self._read_pose()
        x, z, attitude = pose[:3]
        cos, sin = math.cos(attitude), math.sin(attitude)
        turn = [0.0, -math.sin(0.5 * attitude), 0.0, math.cos(0.5 * attitude)]
        left, right = self._legs.deflection_m(0, pose, self.terrain), self._legs.deflection_m(1, pose, self.terrain)
        thrust, fire = self.throttle * self.module.thrust_n, attitude - self.gimbal_rad
        nozzle_x, nozzle_z = x + sin * NOZZLE_BELOW_M, z - cos * NOZZLE_BELOW_M
        vectors = {"thrust": [nozzle_x, 0.0, nozzle_z, -math.sin(fire) * thrust, 0.0, math.cos(fire) * thrust]}
        if self.command[2]:
            vectors |= self._jet_arrows(x, z, cos, sin)
        poses = {
            "module": [x, 0.0, z, *turn],
            "left_legs": [x - sin * left, 0.0, z + cos * left, *turn],
            "right_legs": [x - sin * right, 0.0, z + cos * right, *turn],
        }
        return {"poses": poses, "vectors": vectors, "values": self._true_values(pose)}

    def _jet_arrows(self, x: float, z: float, cos: float, sin: float) -> dict[str, list[float]]:
        """Return the pair of attitude jets that fires: one side up, the other down."""
        force = 0.5 * self.command[2] / JETS_OUT_M
        up_x, up_z = -sin * force, cos * force
        out_x, out_z = cos * JETS_OUT_M, sin * JETS_OUT_M
        return {
            "jet_right": [x + out_x - sin, 0.0, z + out_z + cos, up_x, 0.0, up_z],
            "jet_left": [x - out_x - sin, 0.0, z - out_z + cos, -up_x, 0.0, -up_z],
        }
