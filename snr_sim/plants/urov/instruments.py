"""Outputs of the underwater vehicle: readings, the true state for the recorder, and its shapes for the viewer.

Readings are true values, before sensor errors. What a sensor makes of them is another record (`prelude/signals.py`): a
depth sensor measures pressure and computes depth from it, as the real part does. World frame: x east, y north, z up;
body frame: x forward, y left, z up.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import msgspec

from snr_sim.plants.outputs import FIELD_UT, ImuOutput, PoseOutput, PowerOutput
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.motion import Motion
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.urov_shapes import pool_shapes, tether_shape, vehicle_shapes
from snr_sim.plants.urov.urov_state import Body, Mover
from snr_sim.plants.urov.vehicle import Vehicle
from snr_sim.plants.urov.water_forces import WaterForces
from snr_sim.prelude.angles import roll_pitch_yaw_rad
from snr_sim.prelude.sums import ordered_sum
from snr_sim.prelude.water import AIR_PA

# What the supply's wires add for each ampere, body frame: our estimate. At 100 A it turns a compass by 6 degrees.
FIELD_UT_PER_A = (0.02, 0.02, 0.05)
NO_GROUND_M = 1000.0  # reading of the echo sounder over a world without a floor
CURRENT_N = 40.0  # length of its arrow for each metre a second, so that it shows among the forces


class DepthOutput(msgspec.Struct, frozen=True):
    """The water at the pressure port."""

    depth_m: float  # of the port under the surface at rest; negative above it
    sink_mps: float  # rate of depth, positive while going down
    pressure_pa: float  # absolute; the air's above the surface
    temperature_c: float  # of the water
    stamp_s: float


class AltitudeOutput(msgspec.Struct, frozen=True):
    """What is under the echo sounder."""

    altitude_m: float  # height of the sounder over the floor, straight down
    tilt_rad: float  # angle between the sounder's axis and straight down, 0 to pi
    stamp_s: float


class LeakOutput(msgspec.Struct, frozen=True):
    """Water where none should be."""

    water_l: float  # litres inside the hull; they weigh as much in kilograms
    stamp_s: float


@dataclass
class Instruments:
    """Reads the state of a vehicle and changes nothing. All sensors sit at the origin but the echo sounder."""

    vehicle: Vehicle
    pool: Pool
    thrusters: Propulsion | None
    body: Body  # finds the ground
    motion: Motion
    water: WaterForces
    mover: Mover
    dive: Dive = field(init=False)  # of this run

    def _depth(self) -> DepthOutput:
        motion = self.motion
        pool, z = self.pool, motion.position[2]
        pressure = AIR_PA + pool.density_kgm3 * self.body.gravity_mps2 * max(0.0, -z)
        return DepthOutput(-z, -motion.velocity[2], pressure, pool.temperature_c, motion.time_s)

    def _imu(self) -> ImuOutput:
        motion = self.motion
        gx, gy, gz = motion.acceleration_world
        east, north, up = FIELD_UT
        bx, by, bz = motion.in_body(east, north, up)
        if self.thrusters is not None:
            current = self.thrusters.current_a
            wx, wy, wz = FIELD_UT_PER_A
            bx, by, bz = bx + current * wx, by + current * wy, bz + current * wz
        force = motion.in_body(gx, gy, gz + self.body.gravity_mps2)
        return ImuOutput(list(motion.rate), list(force), [bx, by, bz], motion.time_s)

    def _altitude(self) -> AltitudeOutput:
        motion = self.motion
        x, y, z = motion.position
        ax, ay, az = motion.in_world(0.0, 0.0, -0.5 * self.vehicle.size_m[2])
        above = max(0.0, -az)  # measured from no lower than the origin, as the bottom may give way into the floor
        height = self.body.height_over_ground_m((x + ax, y + ay, z + az + above)) - above
        if height < -above:
            height = NO_GROUND_M
        tilt = math.acos(min(1.0, max(-1.0, motion.rotation[8])))
        return AltitudeOutput(max(0.0, height), tilt, motion.time_s)

    def _power(self) -> PowerOutput:
        thrusters = self.thrusters
        assert thrusters is not None  # otherwise "power" is not an output
        return PowerOutput(thrusters.voltage_v, thrusters.current_a, thrusters.charge, self.motion.time_s)

    def _leaked(self) -> LeakOutput:
        return LeakOutput(self.water.water_l, self.motion.time_s)

    def _pose(self) -> PoseOutput:
        motion = self.motion
        return PoseOutput(list(motion.position), list(motion.attitude), motion.time_s)

    def readers(self) -> dict[str, Callable[[], Any]]:
        """Return what gives each output."""
        return {
            "depth": self._depth, "imu": self._imu, "altitude": self._altitude,
            "leak": self._leaked, "pose": self._pose, "power": self._power,
        }  # fmt: skip

    def scene(self) -> dict[str, Any]:
        """Return water, floor, walls and gates, and the shape of the vehicle."""
        scene = {"statics": pool_shapes(self.pool), "bodies": {"vehicle": vehicle_shapes(self.vehicle)}}
        tether = self.water.tether
        if tether is not None:
            scene["tethers"] = {"tether": tether_shape(tether.tether)}
        return scene

    def truth(self) -> dict[str, Any]:
        """Return the true state for the recorder."""
        motion, water = self.motion, self.water
        w, x, y, z = motion.attitude
        position = px, py, pz = motion.position
        roll, pitch, yaw = roll_pitch_yaw_rad(motion.attitude)
        u, v, heave, _, _, _ = motion.through_water()
        vectors: dict[str, list[float]] = {}
        if self.thrusters is not None:
            for thruster, force in zip(self.vehicle.thrusters, self.thrusters.forces_n, strict=True):
                (ax, ay, az), (dx, dy, dz) = motion.in_world(*thruster.position_m), motion.in_world(*thruster.direction)
                vectors[thruster.name] = [px + ax, py + ay, pz + az, force * dx, force * dy, force * dz]
        if any(motion.current):
            east, north, up = motion.current
            vectors["current"] = [px, py, pz + 0.5, CURRENT_N * east, CURRENT_N * north, CURRENT_N * up]
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
                "contact_n": math.hypot(*(self.mover.contact_n or ())),
                **({} if self.thrusters is None else {"voltage_v": self.thrusters.voltage_v}),
                **self._event_flags(),
            },
        }

    def _event_flags(self) -> dict[str, float]:
        """Return the disturbances of the dive up to now: numbers of the truth.

        `broken_<thruster>` is 1 from its failure on.
        """
        dive, now_s = self.dive, self.motion.time_s + 1e-9
        names = [thruster.name for thruster in self.vehicle.thrusters]
        flags: dict[str, float] = {}
        if dive.loads:
            flags["load_kg"] = ordered_sum(load.mass_kg for load in dive.loads_at(now_s))
        if dive.leak is not None:
            flags["water_l"] = self.water.water_l
        for fault in dive.faults:
            name = names[fault.number_in(names)]
            if fault.at_s <= now_s:
                flags[f"broken_{name}"] = float(fault.fault != "none")
            else:
                flags.setdefault(f"broken_{name}", 0.0)
        return flags
