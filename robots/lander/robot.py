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

from snr_sim import LoopFactory
from snr_sim.devices import (
    ActuatorLoopFactory,
    EnginePwmLoopFactory,
    EngineServos,
    LoopbackPwm,
    McuPwm,
    PwmBackend,
    PwmOut,
    ReplayedSensor,
    SensorLoopFactory,
    SimActuator,
    SimSensor,
    drive_plant,
)
from snr_sim.devices.emulated import Board, ProcessorInLoopPlant, firmware_elf
from snr_sim.devices.pwm.engine_pwm import CHANNELS
from snr_sim.plants import Plant
from snr_sim.scenario import Factory, RobotContext, library
from snr_sim.signals import EngineCommand, InertialReading, RadarReading

ROLES = ("lander",)
OPTIONS: dict[str, str] = {}

BOARD_HZ = 50.0  # rate of writes to a board's outputs: without one for 0.2 s they disarm themselves
MIN_HZ = 10.0  # and so often there must be a new command, hence a new reading
MCU = "atmega328p"


def sim_sensor(context: RobotContext, name: str) -> SimSensor:
    """Open the simulated radar altimeter, or the inertial unit."""
    errors = getattr(context.robot.parameters, name).errors
    return SimSensor(context.plant, name, errors, context.rng(name))


def sim_engine(context: RobotContext) -> SimActuator[EngineCommand]:
    """Open the simulated engine and attitude jets."""
    return SimActuator(context.plant, "engine", EngineCommand, servos(context).limits)


def replayed_sensor(context: RobotContext, name: str) -> ReplayedSensor:
    """Open a sensor that returns the readings of a recorded run."""
    assert context.recorded is not None
    return ReplayedSensor(name, context.recorded(name), READINGS[name], context.now_s)


def servos(context: RobotContext) -> EngineServos:
    """Return how the engine hangs at servo outputs, where it does."""
    return EngineServos(context.robot.parameters.module.gimbal_rad)


def loopback_servos(context: RobotContext) -> LoopbackPwm:
    """Open outputs with nothing behind them: the module falls."""
    return LoopbackPwm(context.now_s, CHANNELS)


def bench_servos(context: RobotContext) -> PwmBackend:
    """Open real outputs; the simulated module is driven by what they do."""
    from snr_sim.devices import open_pwm  # only a bench needs it, and it takes 60 ms

    assert context.plant is not None
    out = open_pwm(f"{context.io}:{context.address}", context.now_s, CHANNELS)
    return drive_plant(out, context.plant, "engine", servos(context).command)


def emulated_servos(context: RobotContext) -> McuPwm:
    """Open the outputs of the emulated board, over its serial line."""
    assert isinstance(context.plant, ProcessorInLoopPlant)
    return McuPwm(context.plant.mcu, context.now_s, CHANNELS)


def wrap_plant(context: RobotContext) -> Plant:
    """Return the plant; with `--io emulated`, with its engine at the pins of a board that was switched on before."""
    assert context.plant is not None
    if context.io != "emulated":
        return context.plant
    firmware, command = library.find("robots", "urov").path / "firmware", servos(context).command
    return ProcessorInLoopPlant(
        context.plant, lambda: Board(firmware_elf(firmware, MCU), MCU), CHANNELS, "engine", command, up_s=2.0
    )


def engine_loop(context: RobotContext) -> LoopFactory:
    """Return the loop of an engine that takes commands as they are."""
    parameters = context.robot.parameters
    open_device = partial(sim_engine, context)
    return ActuatorLoopFactory("engine", open_device, parameters.engine_hz, parameters.engine_timeout_s)


def servo_loop(context: RobotContext, open_device: Callable[[RobotContext], PwmOut]) -> LoopFactory:
    """Return the loop of an engine behind servo outputs."""
    return EnginePwmLoopFactory("engine", servos(context), partial(open_device, context), BOARD_HZ)


# What each device is, for each way of running the robot, the engine with its loop, and how often sensors are read at
# least. Nothing else decides between simulation and hardware.
READINGS: dict[str, type[msgspec.Struct]] = {"radar": RadarReading, "inertial": InertialReading}
SENSORS: dict[str, Any] = {name: partial(sim_sensor, name=name) for name in READINGS}
DEVICES: dict[str, dict[str, Any]] = {
    "sim": {**SENSORS, "engine": engine_loop, "min_hz": 0.0},
    "loopback": {**SENSORS, "engine": partial(servo_loop, open_device=loopback_servos), "min_hz": MIN_HZ},
    "emulated": {**SENSORS, "engine": partial(servo_loop, open_device=emulated_servos), "min_hz": MIN_HZ},
    **{
        kind: {**SENSORS, "engine": partial(servo_loop, open_device=bench_servos), "min_hz": MIN_HZ}
        for kind in ("mcu", "maestro", "pca9685", "sysfs")
    },
    "replay": {
        **{name: partial(replayed_sensor, name=name) for name in READINGS},
        "engine": partial(servo_loop, open_device=loopback_servos),
        "min_hz": 0.0,
    },
}
IO = tuple(DEVICES)


def roles(context: RobotContext, controller: Sequence[Factory]) -> dict[str, list[Any]]:
    """Return the components of each role: sensors first and the engine last, so a reading acts within its tick."""
    parameters, devices = context.robot.parameters, DEVICES[context.io]
    levels = {name: level for name in SENSORS if (level := getattr(parameters, name)) is not None}
    sensors = [
        SensorLoopFactory(name, partial(devices[name], context), max(level.rate_hz, devices["min_hz"]))
        for name, level in levels.items()
    ]
    engine = devices["engine"](context)
    return {"lander": [*sensors, *controller, engine]}
