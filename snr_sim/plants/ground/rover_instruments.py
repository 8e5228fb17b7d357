"""Outputs of the rover: readings, and the true state for the recorder."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from snr_sim.plants.attitude import rotation_of
from snr_sim.plants.ground.rover_motors import RoverMotors
from snr_sim.plants.ground.rover_vehicle import RoverVehicle
from snr_sim.plants.ground.wheel_contacts import WheelContacts
from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.plants.outputs import FIELD_UT, ImuOutput, PoseOutput, PowerOutput
from snr_sim.prelude.angles import roll_pitch_yaw_rad
from snr_sim.prelude.ground_signals import MotorReading


class RoverInstruments:
    """Reads the state of a rover and changes nothing. The inertial unit is at the chassis' origin."""

    def __init__(self, vehicle: RoverVehicle, world: MujocoWorld, motors: RoverMotors, contacts: WheelContacts) -> None:
        model, data = world.model, world.data
        self._vehicle, self._motors, self._contacts, self._data = vehicle, motors, contacts, data
        self._find_places: Callable[[], None] = partial(world.mujoco.mj_kinematics, model, data)
        self._chassis = int(model.body("chassis").id)
        self._bodies = [(model.body(i).name, i) for i in range(self._chassis, model.nbody)]
        self._angles = [int(model.joint(f"wheel_{wheel.name}").qposadr[0]) for wheel in vehicle.motor_wheels]
        first = int(model.sensor("rate").adr[0])
        self._rate, self._force = data.sensordata[first : first + 3], data.sensordata[first + 3 : first + 6]

    def readers(self) -> dict[str, Callable[[float], Any]]:
        """Return what gives each output, at a time."""
        motors = {f"motor_{wheel.name}": partial(self._motor, i) for i, wheel in enumerate(self._vehicle.motor_wheels)}
        return {**motors, "imu": self._imu, "pose": self._pose, "power": self._power}

    def _motor(self, i: int, time_s: float) -> MotorReading:
        rate, turned = float(self._data.qvel[self._motors.dofs[i]]), float(self._data.qpos[self._angles[i]])
        return self._motors.reading(i, rate, turned, time_s)

    def _imu(self, time_s: float) -> ImuOutput:
        """Return the field here and now, and rate and specific force as the last step computed them."""
        a, b, c, d, e, f, g, h, i = rotation_of(tuple(self._data.qpos[3:7].tolist()))
        east, north, up = FIELD_UT
        field = [a * east + d * north + g * up, b * east + e * north + h * up, c * east + f * north + i * up]
        return ImuOutput(self._rate.tolist(), self._force.tolist(), field, time_s)

    def _pose(self, time_s: float) -> PoseOutput:
        x, y, z, *attitude = self._data.qpos[:7].tolist()
        return PoseOutput([x, y, z], attitude, time_s)

    def _power(self, time_s: float) -> PowerOutput:
        motors = self._motors
        return PowerOutput(motors.voltage_v, motors.current_a, motors.battery.charge, time_s)

    def truth(self) -> dict[str, Any]:
        """Return the true state for the recorder."""
        self._find_places()
        data, contacts, motors = self._data, self._contacts, self._motors
        places, attitudes = data.xpos.tolist(), data.xquat.tolist()
        poses = {name: [*places[i], *attitudes[i][1:], attitudes[i][0]] for name, i in self._bodies}
        w, x, y, z = attitudes[self._chassis]
        roll, pitch, yaw = roll_pitch_yaw_rad((w, x, y, z))
        vx, vy, vz = data.qvel[:3].tolist()
        loaded = zip(self._vehicle.wheels, contacts.read_loads(), strict=True)
        return {
            "poses": poses,
            "vectors": {},
            "values": {
                "speed_mps": math.sqrt(vx * vx + vy * vy + vz * vz),
                "roll_rad": roll,
                "pitch_rad": pitch,
                "yaw_rad": yaw,
                "voltage_v": motors.voltage_v,
                "current_a": motors.current_a,
                "hit_n": contacts.hit_n,
                **{f"load_{wheel.name}_n": load_n for wheel, load_n in loaded},
            },
        }
