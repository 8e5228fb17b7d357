"""Outputs of the rover: readings, and the true state for the recorder."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from snr_sim.plants.attitude import in_body, rotation_of
from snr_sim.plants.ground.rover_motors import RoverMotors
from snr_sim.plants.ground.rover_vehicle import RoverVehicle
from snr_sim.plants.ground.wheel_contacts import WheelContacts
from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.plants.outputs import FIELD_UT, ImuOutput, PoseOutput, PowerOutput
from snr_sim.prelude.angles import roll_pitch_yaw_rad
from snr_sim.prelude.device import Stale
from snr_sim.prelude.ground_signals import MotorReading


class RoverInstruments:
    """Reads the state of a rover and changes nothing. The inertial unit is at the chassis' origin."""

    def __init__(self, vehicle: RoverVehicle, world: MujocoWorld, motors: RoverMotors, contacts: WheelContacts) -> None:
        model, data = world.model, world.data
        self._vehicle, self._motors, self._contacts, self._data = vehicle, motors, contacts, data
        self._find_places: Callable[[], None] = partial(world.mujoco.mj_kinematics, model, data)
        self._chassis = int(model.body("chassis").id)
        self._bodies = [(model.body(i).name, i) for i in range(self._chassis, model.nbody)]
        joints = [model.joint(f"wheel_{wheel.name}") for wheel in vehicle.motor_wheels]
        self._rates = [int(joint.dofadr[0]) for joint in joints]
        self._angles = [int(joint.qposadr[0]) for joint in joints]
        first = int(model.sensor("rate").adr[0])
        self._rate, self._force = data.sensordata[first : first + 3], data.sensordata[first + 3 : first + 6]

    def readers(self) -> dict[str, Callable[[float], Any]]:
        """Return what gives each output, at a time."""
        motors = {f"motor_{wheel.name}": partial(self._motor, i) for i, wheel in enumerate(self._vehicle.motor_wheels)}
        return {**motors, "imu": self._imu, "pose": self._pose, "power": self._power}

    def _motor(self, i: int, time_s: float) -> MotorReading | Stale:
        rate, turned = float(self._data.qvel[self._rates[i]]), float(self._data.qpos[self._angles[i]])
        return self._motors.reading(i, rate, turned, time_s)

    def _imu(self, time_s: float) -> ImuOutput:
        """Return the field here and now, and rate and specific force as the last step computed them."""
        field = in_body(rotation_of(tuple(self._data.qpos[3:7].tolist())), *FIELD_UT)
        return ImuOutput(self._rate.tolist(), self._force.tolist(), field, time_s)

    def _pose(self, time_s: float) -> PoseOutput:
        x, y, z, *attitude = self._data.qpos[:7].tolist()
        return PoseOutput([x, y, z], attitude, time_s)

    def _power(self, time_s: float) -> PowerOutput:
        return self._motors.power(time_s)

    def truth(self) -> dict[str, Any]:
        """Return the true state for the recorder."""
        self._find_places()
        data, contacts, motors = self._data, self._contacts, self._motors
        places, attitudes = data.xpos.tolist(), data.xquat.tolist()
        poses = {name: [*places[i], *attitudes[i][1:], attitudes[i][0]] for name, i in self._bodies}
        vx, vy, vz = data.qvel[:3].tolist()
        speed_mps = math.sqrt(vx * vx + vy * vy + vz * vz)
        values = truth_values(
            self._vehicle, speed_mps, attitudes[self._chassis], motors, contacts.hit_n, contacts.read_loads()
        )
        return {"poses": poses, "vectors": {}, "values": values}


def truth_values(
    vehicle: RoverVehicle,
    speed_mps: float,
    attitude: Sequence[float],
    motors: RoverMotors,
    hit_n: float,
    loads_n: Sequence[float],
) -> dict[str, float]:
    """Return the numbers that the recorder notes of any rover."""
    roll, pitch, yaw = roll_pitch_yaw_rad(attitude)
    return {
        "speed_mps": speed_mps,
        "roll_rad": roll,
        "pitch_rad": pitch,
        "yaw_rad": yaw,
        "voltage_v": motors.voltage_v,
        "current_a": motors.current_a,
        "hit_n": hit_n,
        **{f"load_{wheel.name}_n": load_n for wheel, load_n in zip(vehicle.wheels, loads_n, strict=True)},
    }
