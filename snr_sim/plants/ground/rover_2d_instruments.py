"""State of the rover in the plane, and its outputs: as those of the rover in MuJoCo, upright to the ground."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from snr_sim.plants.attitude import Quaternion, in_body, rotation_of, turned
from snr_sim.plants.ground.height_map import HeightMap
from snr_sim.plants.ground.rover_arms import SIDES, Place, arms_of
from snr_sim.plants.ground.rover_instruments import truth_values
from snr_sim.plants.ground.rover_loads import RoverLoads
from snr_sim.plants.ground.rover_motors import RoverMotors
from snr_sim.plants.ground.rover_vehicle import RoverVehicle
from snr_sim.plants.ground.terramechanics import Ground
from snr_sim.plants.ground.traction import GRAVITY_MPS2
from snr_sim.plants.ground.wall_contacts import Speeds
from snr_sim.plants.ground.wheel_contacts import quaternion_to
from snr_sim.plants.outputs import FIELD_UT, ImuOutput, PoseOutput
from snr_sim.prelude.device import Stale
from snr_sim.prelude.ground_signals import MotorReading

Row = tuple[float, ...]  # a number for each wheel


class PlanarState(NamedTuple):
    """Where the rover is and how it moves, without motors and battery. Defaults: at rest."""

    position_m: tuple[float, float]  # of the center of mass
    heading_rad: float
    rates: Row  # of the wheels
    turned_rad: Row
    drives_n: Row  # force of the ground on each wheel, ahead
    soils: tuple[Ground, ...] = ()  # under each wheel
    side_n: float = 0.0  # force on all wheels to the left
    speeds: Speeds = (0.0, 0.0, 0.0)  # of the center of mass, world frame, and of turning
    accelerations: Speeds = (0.0, 0.0, 0.0)
    hit_n: float = 0.0
    hits: int = 0
    is_touching: bool = False
    steps: int = 0

    def origin_m(self, center_m: tuple[float, float]) -> tuple[float, float]:
        """Return x and y of the vehicle's origin; `center_m` is where its center of mass is."""
        (x, y), (ahead, left) = self.position_m, center_m
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return x - cos * ahead + sin * left, y - sin * ahead - cos * left


class PlanarInstruments:
    """Reads a state and changes nothing. The inertial unit is at the vehicle's origin."""

    def __init__(
        self, vehicle: RoverVehicle, ground: HeightMap, loads: RoverLoads, motors: RoverMotors, step_s: float
    ) -> None:
        self._vehicle, self._ground, self._loads, self._motors = vehicle, ground, loads, motors
        self._step_s = step_s

    def readers(self) -> dict[str, Callable[[PlanarState], Any]]:
        """Return what gives each output of a state."""
        wheels = self._vehicle.wheels
        motors = {
            f"motor_{wheel.name}": partial(self._motor, i, wheels.index(wheel))
            for i, wheel in enumerate(self._vehicle.motor_wheels)
        }
        return {**motors, "imu": self._imu, "pose": self._pose, "power": self._power}

    def _motor(self, motor: int, wheel: int, state: PlanarState) -> MotorReading | Stale:
        return self._motors.reading(motor, state.rates[wheel], state.turned_rad[wheel], self._time_s(state))

    def _power(self, state: PlanarState) -> Any:
        return self._motors.power(self._time_s(state))

    def _pose(self, state: PlanarState) -> PoseOutput:
        x, y = state.origin_m(self._loads.center_m)
        return PoseOutput([x, y, self._ground.at(x, y)[0]], list(self._attitude(state)), self._time_s(state))

    def _time_s(self, state: PlanarState) -> float:
        return state.steps * self._step_s

    def _attitude(self, state: PlanarState) -> Quaternion:
        """Return the attitude: upright to the ground under the origin."""
        half = 0.5 * state.heading_rad
        upright = quaternion_to(*self._ground.plane_at(*state.origin_m(self._loads.center_m))[3:])
        return turned(upright, (math.cos(half), 0.0, 0.0, math.sin(half)))

    def _imu(self, state: PlanarState) -> ImuOutput:
        """Return rates and specific force of the last step, and the field here."""
        (x, y), (ahead, left) = state.origin_m(self._loads.center_m), self._loads.center_m
        (vx, vy, turn), (ax, ay, faster) = state.speeds, state.accelerations
        rotation, step_s, plane_at = rotation_of(self._attitude(state)), self._step_s, self._ground.plane_at
        # It rolls and pitches as the normal of the ground turns under it.
        nx, ny, nz = plane_at(x, y)[3:]
        ox, oy, oz = plane_at(x - step_s * vx, y - step_s * vy)[3:]
        mx, my, mz = (nx - ox) / step_s, (ny - oy) / step_s, (nz - oz) / step_s
        rate = ny * mz - nz * my + turn * nx, nz * mx - nx * mz + turn * ny, nx * my - ny * mx + turn * nz
        _, slope_x, slope_y = self._ground.at(*state.position_m)
        down = GRAVITY_MPS2 * nz
        ax, ay = ax + down * slope_x, ay + down * slope_y
        cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
        force = [
            cos * ax + sin * ay + faster * left + turn * turn * ahead,
            cos * ay - sin * ax - faster * ahead + turn * turn * left,
            down,
        ]
        return ImuOutput(in_body(rotation, *rate), force, in_body(rotation, *FIELD_UT), self._time_s(state))

    def loads_n(self, state: PlanarState) -> list[float]:
        """Return the pressure of the ground on each wheel."""
        up = self._ground.plane_at(*state.position_m)[5]
        return self._loads.shared(GRAVITY_MPS2 * up, state.drives_n, state.side_n)

    def truth(self, state: PlanarState) -> dict[str, Any]:
        """Return the true state for the recorder; rockers and bogies are as at rest."""
        vehicle, attitude = self._vehicle, self._attitude(state)
        a, b, c, d, e, f, g, h, i = rotation_of(attitude)
        x, y, z = self._pose(state).position_m

        def placed(at_m: Place, turned_rad: float = 0.0) -> list[float]:
            u, v, w = at_m
            half = 0.5 * turned_rad
            qw, *others = turned(attitude, (math.cos(half), 0.0, math.sin(half), 0.0))
            return [x + a * u + b * v + c * w, y + d * u + e * v + f * w, z + g * u + h * v + i * w, *others, qw]

        poses = {"chassis": placed((0.0, 0.0, 0.0))}
        if vehicle.suspension:
            arms = (arm for side in SIDES for arm in arms_of(vehicle, side))
            poses.update((f"{arm.kind}_{arm.side}", placed(arm.pivot_m)) for arm in arms)
        for wheel, turned_rad in zip(vehicle.wheels, state.turned_rad, strict=True):
            poses[f"wheel_{wheel.name}"] = placed(wheel.position_m, turned_rad)
        speed_mps = math.sqrt(state.speeds[0] ** 2 + state.speeds[1] ** 2)
        values = truth_values(vehicle, speed_mps, attitude, self._motors, state.hit_n, self.loads_n(state))
        return {"poses": poses, "vectors": {}, "values": values}
