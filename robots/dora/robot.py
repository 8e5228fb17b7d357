"""Dora, a small explorer on two driven wheels and a caster: one role, three sensors, two motors.

    plant --> range  --> page "range"  --.
         |--> touch  --> page "touch"  --+--> controller --> page "motors" --> motors --> plant
         `--> wheels --> page "wheels" --'    (controllers/*, or yours)

    range     distance_m, confidence (0: no echo), stamp_s
    touch     left, right: whether the bar is pressed; stamp_s
    wheels    angle_rad [left, right], stamp_s
    motors    a (left), d (right): percent of full speed, -100 to 100

With `--option wire=wifi` or `wire=brick` the program is not on the robot: readings and commands share one line, on
which a request takes 30 ms (as in Fabry and Campusano 2014, section 3.2) or 1 ms.

Its numbers are in parameters.py, its physics in snr_sim/plants, and its room in the scenario.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import msgspec

from snr_sim.devices import (
    ActuatorLoopFactory,
    ReplayedSensor,
    RequestLineFactory,
    SensorErrors,
    SensorLoopFactory,
    SimActuator,
    SimSensor,
)
from snr_sim.errors import ParameterError
from snr_sim.scenario import Factory, RobotContext
from snr_sim.signals import EchoReading, MotorCommand, TouchReading, WheelReading

from .parameters import RANGE_ERRORS

ROLES = ("dora",)
WIRES = {"none": 0.0, "wifi": 0.030, "brick": 0.001}  # seconds a request takes
OPTIONS = {"wire": "what is between program and robot: none, wifi or brick (default: none)."}

READINGS: dict[str, type[msgspec.Struct]] = {"range": EchoReading, "touch": TouchReading, "wheels": WheelReading}
ERRORS = {"range": RANGE_ERRORS}
LIMITS = {"a": (-100.0, 100.0), "d": (-100.0, 100.0)}


def sim_sensor(context: RobotContext, name: str) -> SimSensor:
    """Open a simulated sensor."""
    return SimSensor(context.plant, name, ERRORS.get(name, SensorErrors()), context.rng(name))


def sim_motors(context: RobotContext) -> SimActuator[MotorCommand]:
    """Open the simulated motors."""
    return SimActuator(context.plant, "motors", MotorCommand, LIMITS)


def replayed_sensor(context: RobotContext, name: str) -> ReplayedSensor:
    """Open a sensor that returns the readings of a recorded run."""
    assert context.recorded is not None
    return ReplayedSensor(name, context.recorded(name), READINGS[name], context.now_s)


# What each device is, for each way of running the robot. Nothing else decides between simulation and a recorded run.
DEVICES: dict[str, dict[str, Any]] = {
    "sim": {**{name: partial(sim_sensor, name=name) for name in READINGS}, "motors": sim_motors},
    "replay": {**{name: partial(replayed_sensor, name=name) for name in READINGS}, "motors": sim_motors},
}
IO = tuple(DEVICES)


def roles(context: RobotContext, controller: Sequence[Factory]) -> dict[str, list[Any]]:
    """Return the components of the role: sensors first and motors last, so a reading acts within its tick."""
    parameters, devices = context.robot.parameters, DEVICES[context.io]
    wire = context.robot.options.get("wire", "none")
    if wire not in WIRES:
        raise ParameterError(f"--option wire={wire} is not a wire.", fix=f"wire={', wire='.join(WIRES)}.")
    opens = {name: partial(devices[name], context) for name in (*READINGS, "motors")}
    if wire != "none":
        sensors = {name: opens[name] for name in READINGS}
        line = RequestLineFactory(sensors, "motors", opens["motors"], WIRES[wire], parameters.motors_timeout_s)
        return {"dora": [line, *controller]}
    rates = {"range": parameters.range_hz, "touch": parameters.touch_hz, "wheels": parameters.wheels_hz}
    loops = [SensorLoopFactory(name, opens[name], rates[name]) for name in READINGS]
    motors = ActuatorLoopFactory("motors", opens["motors"], parameters.motors_hz, parameters.motors_timeout_s)
    return {"dora": [*loops, *controller, motors]}
