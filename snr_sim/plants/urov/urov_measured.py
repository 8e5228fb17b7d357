"""What the underwater vehicle tells: its outputs, the true state for the recorder, and its shapes for the viewer.

Moving is another matter (`urov.py`); here its state is only looked at.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from snr_sim.plants.attitude import Quaternion, Rotation
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.hydrodynamics import Hydrodynamics
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.tether import TetherPull
from snr_sim.plants.urov.urov_outputs import Altitude, Depth, Imu, Leak, Pose, Power
from snr_sim.plants.urov.urov_shapes import pool_shapes, tether_shape, vehicle_shapes
from snr_sim.plants.urov.urov_state import Body, Thrusters
from snr_sim.plants.urov.vehicle import Matrix, Six, Vector, Vehicle
from snr_sim.prelude.angles import roll_pitch_yaw_rad
from snr_sim.prelude.errors import PlantError, UnknownName, nearest
from snr_sim.prelude.sums import ordered_sum
from snr_sim.prelude.water import AIR_PA

# Earth's field at about 50 degrees north, magnetic north along y: 20 uT level, 44 uT down (rounded).
FIELD_UT = (0.0, 20.0, -44.0)
# What the supply's wires add for each ampere, body frame: our estimate. At 100 A it turns a compass by 6 degrees.
FIELD_UT_PER_A = (0.02, 0.02, 0.05)
NO_GROUND_M = 1000.0  # what the echo sounder says over a world without a floor
CURRENT_N = 40.0  # length of its arrow for each metre a second, so that it shows among the forces


class UrovMeasured:
    """The state of an underwater vehicle, as it can be looked at.

    Attributes:
        vehicle: its numbers, as trimmed.
        pool: where it is.
        dive: what happens to it in this run.
        thrusters: what turns pulses into forces, if there are any.
        outputs: names that `read` takes.
        step_s: of integration.
    """

    vehicle: Vehicle
    pool: Pool
    dive: Dive
    thrusters: Thrusters | None
    outputs: tuple[str, ...]
    step_s: float
    _steps: int
    _names: tuple[str, ...]  # of the thrusters
    _body: Body
    _hydro: Hydrodynamics
    _place: Vector
    _attitude: Quaternion
    _rotation: Rotation
    _wet: float  # share of the volume in the water, in the middle of the last step
    _taken: float  # the share whose water has been brought to the vehicle's speed
    _velocity: Vector
    _rate: Vector
    _gained: Vector
    _current: Vector
    _contact_n: Vector | None
    _tether: TetherPull | None
    _tether_n: Vector
    _water_l: float
    _readers: dict[str, Callable[[], Any]]

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset: a count, so that nothing adds up."""
        return self._steps * self.step_s

    @property
    def through_water(self) -> Six:
        """Velocity relative to the water, body frame: along x, y, z [m/s], about x, y, z [rad/s]."""
        return *self._through_water(), *self._rate

    @property
    def position_m(self) -> Vector:
        """Of the vehicle's origin, world frame."""
        return self._place

    @property
    def attitude(self) -> Quaternion:
        """Unit quaternion (w, x, y, z) from the body's frame to the world's."""
        return self._attitude

    @property
    def velocity_mps(self) -> Vector:
        """Of the vehicle's origin, world frame."""
        return self._velocity

    @property
    def rate_radps(self) -> Vector:
        """Angular velocity, body frame."""
        return self._rate

    @property
    def mass_matrix(self) -> Matrix:
        """6 x 6: vehicle, what hangs at it, and the water that moves with it, body frame."""
        return self._hydro.mass + (self._taken - self._wet) * self.vehicle.added_mass

    @property
    def kinetic_energy_j(self) -> float:
        """Of vehicle and water, seen from water that moves with the current."""
        nu = np.array(self.through_water)
        return float(0.5 * nu @ self.mass_matrix @ nu)  # decides no run: for tests

    @property
    def contact_n(self) -> Vector | None:
        """What floor, walls and gates pushed in the last step, world frame; None if nothing was in reach."""
        return self._contact_n

    def read(self, name: str) -> Any:
        """Returns what a sensor without faults would say; all of them sit at the origin but the echo sounder."""
        if name not in self.outputs:
            raise UnknownName(f"This plant has no output '{name}'.", fix=nearest(name, self.outputs))
        return self._readers[name]()

    def _depth(self) -> Depth:
        pool, z = self.pool, self._place[2]
        pressure = AIR_PA + pool.density_kgm3 * self._body.gravity_mps2 * max(0.0, -z)
        return Depth(-z, -self._velocity[2], pressure, pool.temperature_c, self.time_s)

    def _imu(self) -> Imu:
        gx, gy, gz = self._gained
        east, north, up = FIELD_UT
        bx, by, bz = self._in_body(east, north, up)
        if self.thrusters is not None:
            current = self.thrusters.current_a
            wx, wy, wz = FIELD_UT_PER_A
            bx, by, bz = bx + current * wx, by + current * wy, bz + current * wz
        force = self._in_body(gx, gy, gz + self._body.gravity_mps2)
        return Imu(list(self._rate), list(force), [bx, by, bz], self.time_s)

    def _altitude(self) -> Altitude:
        x, y, z = self._place
        ax, ay, az = self._in_world(0.0, 0.0, -0.5 * self.vehicle.size_m[2])
        above = max(0.0, -az)  # looks from no lower than the origin, as the bottom may give way into the floor
        height = self._body.height_over_ground_m((x + ax, y + ay, z + az + above)) - above
        if height < -above:
            height = NO_GROUND_M
        tilt = math.acos(min(1.0, max(-1.0, self._rotation[8])))
        return Altitude(max(0.0, height), tilt, self.time_s)

    def _power(self) -> Power:
        if self.thrusters is None:
            raise PlantError("This plant has no battery.", fix="give it thrusters.")
        thrusters = self.thrusters
        return Power(thrusters.voltage_v, thrusters.current_a, thrusters.charge, self.time_s)

    def _leaked(self) -> Leak:
        return Leak(self._water_l, self.time_s)

    def _pose(self) -> Pose:
        return Pose(list(self._place), list(self._attitude), self.time_s)

    def _own_readers(self) -> dict[str, Callable[[], Any]]:
        """Returns what gives each output."""
        return {
            "depth": self._depth,
            "imu": self._imu,
            "altitude": self._altitude,
            "leak": self._leaked,
            "pose": self._pose,
            "power": self._power,
        }

    def scene(self) -> dict[str, Any]:
        """Returns water, floor, walls and gates, and the shape of the vehicle."""
        scene = {"statics": pool_shapes(self.pool), "bodies": {"vehicle": vehicle_shapes(self.vehicle)}}
        if self._tether is not None:
            scene["tethers"] = {"tether": tether_shape(self._tether.tether)}
        return scene

    def truth(self) -> dict[str, Any]:
        """Returns the true state for the recorder."""
        w, x, y, z = self._attitude
        place = px, py, pz = self._place
        roll, pitch, yaw = roll_pitch_yaw_rad(self._attitude)
        u, v, heave = self._through_water()
        arrows: dict[str, list[float]] = {}
        if self.thrusters is not None:
            for thruster, force in zip(self.vehicle.thrusters, self.thrusters.forces_n, strict=True):
                (ax, ay, az), (dx, dy, dz) = self._in_world(*thruster.position_m), self._in_world(*thruster.direction)
                arrows[thruster.name] = [px + ax, py + ay, pz + az, force * dx, force * dy, force * dz]
        if any(self._current):
            east, north, up = self._current
            flow = (CURRENT_N * east, CURRENT_N * north, CURRENT_N * up)
            arrows["current"] = [place[0], place[1], place[2] + 0.5, *flow]
        if self._tether is not None:
            at = self._in_world(*self._tether.tether.place_m)
            arrows["tether"] = [*(a + b for a, b in zip(place, at, strict=True)), *self._tether_n]
        return {
            "poses": {"vehicle": [*place, x, y, z, w]},
            "arrows": arrows,
            "values": {
                "depth_m": -place[2],
                "speed_mps": math.hypot(u, v, heave),
                "surge_mps": u,
                "sway_mps": v,
                "heave_mps": heave,
                "yaw_rad": yaw,
                "roll_rad": roll,
                "pitch_rad": pitch,
                "contact_n": math.hypot(*(self._contact_n or ())),
                **({} if self.thrusters is None else {"voltage_v": self.thrusters.voltage_v}),
                **self._mishaps(),
            },
        }

    def _mishaps(self) -> dict[str, float]:
        """Returns what the dive has in store for the vehicle, as far as it has come: numbers of the truth.

        `broken_<thruster>` is 1 from its failure on.
        """
        dive, now_s = self.dive, self.time_s + 1e-9
        told: dict[str, float] = {}
        if dive.loads:
            told["load_kg"] = ordered_sum(load.mass_kg for load in dive.loads_at(now_s))
        if dive.leak is not None:
            told["water_l"] = self._water_l
        for fault in dive.faults:
            name = self._names[fault.number_in(self._names)]
            if fault.at_s <= now_s:
                told[f"broken_{name}"] = float(fault.fault != "none")
            else:
                told.setdefault(f"broken_{name}", 0.0)
        return told

    def _in_world(self, x: float, y: float, z: float) -> Vector:
        """Returns a vector of the body's frame in the world's."""
        r11, r12, r13, r21, r22, r23, r31, r32, r33 = self._rotation
        return r11 * x + r12 * y + r13 * z, r21 * x + r22 * y + r23 * z, r31 * x + r32 * y + r33 * z

    def _in_body(self, x: float, y: float, z: float) -> Vector:
        """Returns a vector of the world's frame in the body's."""
        r11, r12, r13, r21, r22, r23, r31, r32, r33 = self._rotation
        return r11 * x + r21 * y + r31 * z, r12 * x + r22 * y + r32 * z, r13 * x + r23 * y + r33 * z

    def _through_water(self) -> Vector:
        """Returns the velocity relative to the water, body frame."""
        (vx, vy, vz), (cx, cy, cz) = self._velocity, self._current
        return self._in_body(vx - cx, vy - cy, vz - cz)
