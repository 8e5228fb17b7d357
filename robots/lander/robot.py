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

import msgspec

from snr_sim.core.loop import LoopFactory
from snr_sim.devices.emulated.board import Board
from snr_sim.devices.emulated.lock_step import PlantOnBoard
from snr_sim.devices.emulated.toolchain import firmware_elf
from snr_sim.devices.loops import ActuatorLoopFactory, SensorLoopFactory
from snr_sim.devices.mcu.mcu import McuPwm
from snr_sim.devices.pwm.engine_pwm import CHANNELS, EnginePwmLoopFactory, EngineServos
from snr_sim.devices.pwm.mirror import MirrorPwm
from snr_sim.devices.pwm.pwm_backend import PwmBackend
from snr_sim.devices.pwm.sim_pwm import drive_plant
from snr_sim.devices.replayed import ReplayedSensor
from snr_sim.devices.simulated import SimActuator, SimSensor
from snr_sim.prelude.component import Factory
from snr_sim.prelude.device import PwmOut
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.scenario import Rig
from snr_sim.prelude.signals import EngineCommand, InertialReading, RadarReading
from snr_sim.scenario import library

ROLES = ("lander",)
OPTIONS: dict[str, str] = {}

BOARD_HZ = 50.0  # rate of writes to a board's outputs: without one for 0.2 s they disarm themselves
LEAST_HZ = 10.0  # and so often there must be a new command, hence a new reading
MCU = "atmega328p"


def sim_radar(rig: Rig) -> SimSensor:
    """Open the simulated radar altimeter."""
    return SimSensor(rig.plant, "radar", rig.robot.parameters.radar.errors, rig.rng("radar"))


def sim_inertial(rig: Rig) -> SimSensor:
    """Open the simulated inertial unit."""
    return SimSensor(rig.plant, "inertial", rig.robot.parameters.inertial.errors, rig.rng("inertial"))


def sim_engine(rig: Rig) -> SimActuator[EngineCommand]:
    """Open the simulated engine and attitude jets."""
    return SimActuator(rig.plant, "engine", EngineCommand, servos(rig).limits)


def replayed_sensor(rig: Rig, name: str) -> ReplayedSensor:
    """Open a sensor that returns the readings of a recorded run."""
    assert rig.recorded is not None
    return ReplayedSensor(name, rig.recorded(name), READINGS[name], rig.now_s)


def servos(rig: Rig) -> EngineServos:
    """Return how the engine hangs at servo outputs, where it does."""
    return EngineServos(rig.robot.parameters.module.gimbal_rad)


def mirror_servos(rig: Rig) -> MirrorPwm:
    """Open outputs with nothing behind them: the module falls."""
    return MirrorPwm(rig.now_s, CHANNELS)


def bench_servos(rig: Rig) -> PwmBackend:
    """Open real outputs; the simulated module is driven by what they do."""
    from snr_sim.devices.opening import open_pwm  # only a bench needs it, and it takes 60 ms

    assert rig.plant is not None
    out = open_pwm(f"{rig.io}:{rig.where}", rig.now_s, CHANNELS)
    return drive_plant(out, rig.plant, "engine", servos(rig).command)


def emulated_servos(rig: Rig) -> McuPwm:
    """Open the outputs of the emulated board, over its serial line."""
    assert isinstance(rig.plant, PlantOnBoard)
    return McuPwm(rig.plant.mcu, rig.now_s, CHANNELS)


def dressed(rig: Rig) -> Plant:
    """Return the plant; with `--io emulated`, with its engine at the pins of a board that was switched on before."""
    assert rig.plant is not None
    if rig.io != "emulated":
        return rig.plant
    firmware = library.find("robots", "urov").path / "firmware"
    return PlantOnBoard(
        rig.plant, lambda: Board(firmware_elf(firmware, MCU), MCU), CHANNELS, "engine", servos(rig).command, up_s=2.0
    )


def engine_loop(rig: Rig) -> LoopFactory:
    """Return the loop of an engine that takes commands as they are."""
    parameters = rig.robot.parameters
    return ActuatorLoopFactory("engine", partial(sim_engine, rig), parameters.engine_hz, parameters.engine_timeout_s)


def servo_loop(rig: Rig, open_device: Callable[[Rig], PwmOut]) -> LoopFactory:
    """Return the loop of an engine behind servo outputs."""
    return EnginePwmLoopFactory("engine", servos(rig), partial(open_device, rig), BOARD_HZ)


# What each device is, for each way of running the robot, the engine with its loop, and how often sensors are read at
# least. Nothing else decides between simulation and hardware.
READINGS: dict[str, type[msgspec.Struct]] = {"radar": RadarReading, "inertial": InertialReading}
SENSORS: dict[str, Any] = {"radar": sim_radar, "inertial": sim_inertial}
DEVICES: dict[str, dict[str, Any]] = {
    "sim": {**SENSORS, "engine": engine_loop, "least_hz": 0.0},
    "mirror": {**SENSORS, "engine": partial(servo_loop, open_device=mirror_servos), "least_hz": LEAST_HZ},
    "emulated": {**SENSORS, "engine": partial(servo_loop, open_device=emulated_servos), "least_hz": LEAST_HZ},
    **{
        kind: {**SENSORS, "engine": partial(servo_loop, open_device=bench_servos), "least_hz": LEAST_HZ}
        for kind in ("mcu", "maestro", "pca9685", "sysfs")
    },
    "replay": {
        **{name: partial(replayed_sensor, name=name) for name in READINGS},
        "engine": partial(servo_loop, open_device=mirror_servos),
        "least_hz": 0.0,
    },
}
IO = tuple(DEVICES)


def roles(rig: Rig, controller: Sequence[Factory]) -> dict[str, list[Any]]:
    """Return the components of each role: sensors first and the engine last, so a reading acts within its tick."""
    parameters, devices = rig.robot.parameters, DEVICES[rig.io]
    levels = {name: level for name in SENSORS if (level := getattr(parameters, name)) is not None}
    sensors = [
        SensorLoopFactory(name, partial(devices[name], rig), max(level.rate_hz, devices["least_hz"]))
        for name, level in levels.items()
    ]
    engine = devices["engine"](rig)
    return {"lander": [*sensors, *controller, engine]}
