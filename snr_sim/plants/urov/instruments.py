"""Outputs of the underwater vehicle: readings, the true state for the recorder, and its shapes for the viewer."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.motion import Motion
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.urov_outputs import AltitudeOutput, DepthOutput, ImuOutput, LeakOutput, PoseOutput, PowerOutput
from snr_sim.plants.urov.urov_shapes import pool_shapes, tether_shape, vehicle_shapes
from snr_sim.plants.urov.urov_state import Body, Mover
from snr_sim.plants.urov.vehicle import Vehicle
from snr_sim.plants.urov.water_forces import WaterForces
from snr_sim.prelude.angles import roll_pitch_yaw_rad
from snr_sim.prelude.errors import PlantError
from snr_sim.prelude.sums import ordered_sum
from snr_sim.prelude.water import AIR_PA

# Earth's field at about 50 degrees north, magnetic north along y: 20 uT level, 44 uT down (rounded).
FIELD_UT = (0.0, 20.0, -44.0)
# What the supply's wires add for each ampere, body frame: our estimate. At 100 A it turns a compass by 6 degrees.
FIELD_UT_PER_A = (0.02, 0.02, 0.05)
NO_GROUND_M = 1000.0  # reading of the echo sounder over a world without a floor
CURRENT_N = 40.0  # length of its arrow for each metre a second, so that it shows among the forces


class Instruments:
    """Reads the state of a vehicle and changes nothing. All sensors sit at the origin but the echo sounder.

    Args:
        vehicle, pool, thrusters: what the plant is made of.
        body: finds the ground.
        motion, water, mover: what is read.

    Attributes:
        dive: of this run.
    """

    dive: Dive

    def __init__(
        self,
        vehicle: Vehicle,
        pool: Pool,
        thrusters: Propulsion | None,
        body: Body,
        motion: Motion,
        water: WaterForces,
        mover: Mover,
    ) -> None:
        self._vehicle, self._pool, self._thrusters, self._body = vehicle, pool, thrusters, body
        self._motion, self._water, self._mover = motion, water, mover
        self._names = tuple(thruster.name for thruster in vehicle.thrusters)

    def _depth(self) -> DepthOutput:
        motion = self._motion
        pool, z = self._pool, motion.position[2]
        pressure = AIR_PA + pool.density_kgm3 * self._body.gravity_mps2 * max(0.0, -z)
        return DepthOutput(-z, -motion.velocity[2], pressure, pool.temperature_c, motion.time_s)

    def _imu(self) -> ImuOutput:
        motion = self._motion
        gx, gy, gz = motion.acceleration_world
        east, north, up = FIELD_UT
        bx, by, bz = motion.in_body(east, north, up)
        if self._thrusters is not None:
            current = self._thrusters.current_a
            wx, wy, wz = FIELD_UT_PER_A
            bx, by, bz = bx + current * wx, by + current * wy, bz + current * wz
        force = motion.in_body(gx, gy, gz + self._body.gravity_mps2)
        return ImuOutput(list(motion.rate), list(force), [bx, by, bz], motion.time_s)

    def _altitude(self) -> AltitudeOutput:
        motion = self._motion
        x, y, z = motion.position
        ax, ay, az = motion.in_world(0.0, 0.0, -0.5 * self._vehicle.size_m[2])
        above = max(0.0, -az)  # measured from no lower than the origin, as the bottom may give way into the floor
        height = self._body.height_over_ground_m((x + ax, y + ay, z + az + above)) - above
        if height < -above:
            height = NO_GROUND_M
        tilt = math.acos(min(1.0, max(-1.0, motion.rotation[8])))
        return AltitudeOutput(max(0.0, height), tilt, motion.time_s)

    def _power(self) -> PowerOutput:
        if self._thrusters is None:
            raise PlantError("This plant has no battery.", fix="give it thrusters.")
        thrusters = self._thrusters
        return PowerOutput(thrusters.voltage_v, thrusters.current_a, thrusters.charge, self._motion.time_s)

    def _leaked(self) -> LeakOutput:
        return LeakOutput(self._water.water_l, self._motion.time_s)

    def _pose(self) -> PoseOutput:
        motion = self._motion
        return PoseOutput(list(motion.position), list(motion.attitude), motion.time_s)

    def readers(self) -> dict[str, Callable[[], Any]]:
        """Return what gives each output."""
        return {
            "depth": self._depth,
            "imu": self._imu,
            "altitude": self._altitude,
            "leak": self._leaked,
            "pose": self._pose,
            "power": self._power,
        }

    def scene(self) -> dict[str, Any]:
        """Return water, floor, walls and gates, and the shape of the vehicle."""
        scene = {"statics": pool_shapes(self._pool), "bodies": {"vehicle": vehicle_shapes(self._vehicle)}}
        tether = self._water.tether
        if tether is not None:
            scene["tethers"] = {"tether": tether_shape(tether.tether)}
        return scene

    def truth(self) -> dict[str, Any]:
        """Return the true state for the recorder."""
        motion, water = self._motion, self._water
        w, x, y, z = motion.attitude
        position = px, py, pz = motion.position
        roll, pitch, yaw = roll_pitch_yaw_rad(motion.attitude)
        u, v, heave, _, _, _ = motion.through_water()
        vectors: dict[str, list[float]] = {}
        if self._thrusters is not None:
            for thruster, force in zip(self._vehicle.thrusters, self._thrusters.forces_n, strict=True):
                (ax, ay, az), (dx, dy, dz) = motion.in_world(*thruster.position_m), motion.in_world(*thruster.direction)
                vectors[thruster.name] = [px + ax, py + ay, pz + az, force * dx, force * dy, force * dz]
        if any(motion.current):
            east, north, up = motion.current
            flow = (CURRENT_N * east, CURRENT_N * north, CURRENT_N * up)
            vectors["current"] = [position[0], position[1], position[2] + 0.5, *flow]
        if water.tether is not None:
            at = motion.in_world(*water.tether.tether.attachment_m)
            vectors["tether"] = [*(a + b for a, b in zip(position, at, strict=True)), *water.tether_n]
        return {
            "poses": {"vehicle": [*position, x, y, z, w]},
            "vectors": vectors,
            "values": {
                "depth_m": -position[2],
                "speed_mps": math.hypot(u, v, heave),
                "surge_mps": u,
                "sway_mps": v,
                "heave_mps": heave,
                "yaw_rad": yaw,
                "roll_rad": roll,
                "pitch_rad": pitch,
                "contact_n": math.hypot(*(self._mover.contact_n or ())),
                **({} if self._thrusters is None else {"voltage_v": self._thrusters.voltage_v}),
                **self._event_flags(),
            },
        }

    def _event_flags(self) -> dict[str, float]:
        """Return the disturbances of the dive up to now: numbers of the truth.

        `broken_<thruster>` is 1 from its failure on.
        """
        dive, now_s = self.dive, self._motion.time_s + 1e-9
        flags: dict[str, float] = {}
        if dive.loads:
            flags["load_kg"] = ordered_sum(load.mass_kg for load in dive.loads_at(now_s))
        if dive.leak is not None:
            flags["water_l"] = self._water.water_l
        for fault in dive.faults:
            name = self._names[fault.number_in(self._names)]
            if fault.at_s <= now_s:
                flags[f"broken_{name}"] = float(fault.fault != "none")
            else:
                flags.setdefault(f"broken_{name}", 0.0)
        return flags
