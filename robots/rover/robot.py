"""The rover: one role, a motor in each of six wheels, an inertial unit.

    plant --> motor_LF ... motor_RB --> pages of the same names --.
         |--> imu                   --> page "imu"              --+--> controller --> page "drive" --> motors --> plant
         `--> power                 --> page "power"            --'    (controllers/*, or yours)

    motor_LF  speed_radps and turned_rad of the wheel, current_a, voltage_v and more: see MotorReading in
              snr_sim/prelude/ground_signals.py; LF is left front, then LM, LB, RF, RM, RB
    imu       rate_radps, specific_force_mps2, roll_rad, pitch_rad (positive: the nose goes down), yaw_rad, stamp_s
    power     voltage_v, current_a, stamp_s
    drive     mode ("speed", "current", "duty", "brake" or "off") and values, one for each wheel in the order above:
              rad/s, A, -1 to 1, or A

A command older than a quarter of a second, and none at all, is a brake of 4 A: a rover that rolled freely would drive
down a slope. Its numbers are in parameters.py and vehicles/, its physics in snr_sim/plants, its ground in the scenario.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from snr_sim.devices import ActuatorLoopFactory, SensorErrors, SensorLoopFactory, SimActuator, SimSensor
from snr_sim.scenario import Factory, RobotContext
from snr_sim.signals import DriveCommand

from .parameters import MOTOR_ERRORS

ROLES = ("rover",)
IO = ("sim",)
OPTIONS: dict[str, str] = {}
MAX_VALUE = 100.0  # the motors' own limits are narrower, and depend on the mode


def sim_sensor(context: RobotContext, name: str, errors: SensorErrors) -> SimSensor:
    """Open a simulated sensor."""
    return SimSensor(context.plant, name, errors, context.rng(name))


def sim_imu(context: RobotContext) -> SimSensor:
    """Open the simulated inertial unit."""
    sensor: SimSensor = context.robot.parameters.imu.simulated(context.plant, "imu", context.rng("imu"))
    return sensor


def sim_motors(context: RobotContext) -> SimActuator[DriveCommand]:
    """Open the simulated motors."""
    return SimActuator(context.plant, "drive", DriveCommand, {"values": (-MAX_VALUE, MAX_VALUE)})


def roles(context: RobotContext, controller: Sequence[Factory]) -> dict[str, list[Any]]:
    """Return the components of the role: sensors first and motors last, so a reading acts within its tick."""
    parameters = context.robot.parameters
    names = [f"motor_{wheel.name}" for wheel in parameters.vehicle.motor_wheels]
    sensors = [
        SensorLoopFactory(name, partial(sim_sensor, context, name, MOTOR_ERRORS), parameters.motors_hz)
        for name in names
    ]
    sensors.append(SensorLoopFactory("imu", partial(sim_imu, context), parameters.imu_hz))
    power = partial(sim_sensor, context, "power", SensorErrors())
    sensors.append(SensorLoopFactory("power", power, parameters.power_hz))
    motors = ActuatorLoopFactory("drive", partial(sim_motors, context), parameters.drive_hz, parameters.drive_timeout_s)
    return {"rover": [*sensors, *controller, motors]}
