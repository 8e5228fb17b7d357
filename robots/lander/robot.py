"""The lunar module: one role, one sensor or two, one engine.

    plant --> radar    --> page "radar"    --.
         `--> inertial --> page "inertial" --+--> controller --> page "engine" --> engine --> plant
              (in the plane only)                 (controllers/*.py, or yours)

    radar     altitude_m, velocity_mps (up positive), stamp_s
    inertial  position_m [x, z], velocity_mps [vx, vz], attitude_rad, rate_radps, fuel_kg, contact [left, right],
              stamp_s
    engine    throttle 0..1, gimbal_rad, attitude -1..1 (the last two in the plane only)

Its numbers are in parameters.py, its physics in snr_sim/plants, and what it starts with in the scenario.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from snr_sim.devices.loops import ActuatorLoopFactory, SensorLoopFactory
from snr_sim.devices.simulated import SimActuator, SimSensor
from snr_sim.prelude.component import Factory
from snr_sim.prelude.scenario import Rig
from snr_sim.prelude.signals import EngineCommand

ROLES = ("lander",)
IO = ("sim",)
OPTIONS: dict[str, str] = {}


def sim_radar(rig: Rig) -> SimSensor:
    """Opens the simulated radar altimeter."""
    return SimSensor(rig.plant, "radar", rig.robot.parameters.radar.errors, rig.rng("radar"))


def sim_inertial(rig: Rig) -> SimSensor:
    """Opens the simulated inertial unit."""
    return SimSensor(rig.plant, "inertial", rig.robot.parameters.inertial.errors, rig.rng("inertial"))


def sim_engine(rig: Rig) -> SimActuator[EngineCommand]:
    """Opens the simulated engine and attitude jets."""
    turn = rig.robot.parameters.module.gimbal_rad
    limits = {"throttle": (0.0, 1.0), "gimbal_rad": (-turn, turn), "attitude": (-1.0, 1.0)}
    return SimActuator(rig.plant, "engine", EngineCommand, limits)


# What each device is, for each way of running the robot. Nothing else decides between simulation and hardware.
DEVICES: dict[str, dict[str, Callable[[Rig], Any]]] = {
    "sim": {"radar": sim_radar, "inertial": sim_inertial, "engine": sim_engine},
}


def roles(rig: Rig, controller: Sequence[Factory]) -> dict[str, list[Any]]:
    """Returns the components of each role: sensors first and the engine last, so a reading acts within its tick."""
    parameters, devices = rig.robot.parameters, DEVICES[rig.io]
    sensors = [SensorLoopFactory("radar", partial(devices["radar"], rig), parameters.radar.rate_hz)]
    if parameters.inertial is not None:
        sensors.append(SensorLoopFactory("inertial", partial(devices["inertial"], rig), parameters.inertial.rate_hz))
    engine = ActuatorLoopFactory(
        "engine", partial(devices["engine"], rig), parameters.engine_hz, parameters.engine_timeout_s
    )
    return {"lander": [*sensors, *controller, engine]}
