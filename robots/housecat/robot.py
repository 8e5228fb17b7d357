"""Housecat, a small bulldozer: one role, markers that give its pose, cameras or a lidar, two tracks and a blade.

    plant --> pose   --> page "pose"   --.
         |--> mono   --> page "mono"   --+--> controller --> page "dozer" --> tracks and blade --> plant
         `--> stereo --> page "stereo" --'    (controllers/*, or yours)

    pose      position_m [x, y], heading_rad (0 to the east, positive to the left), stamp_s
    mono      rgb (36 x 48 pixels), field_of_view_rad, stamp_s
    stereo    left, right (32 x 96 pixels each), baseline_m, field_of_view_rad, stamp_s
    lidar     ranges_m, angles_rad (positive to the left), stamp_s: with --option ranging=lidar, in the place of stereo
    dozer     left_mps, right_mps (up to 0.3), blade (0 up, 1 down)

Its numbers are in parameters.py, its physics in snr_sim/plants, and its yard in yard.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from snr_sim.devices import ActuatorLoopFactory, CameraLoopFactory, SensorLoopFactory, SimActuator, SimSensor
from snr_sim.errors import ParameterError
from snr_sim.scenario import Factory, RobotContext
from snr_sim.signals import DozerCommand

from .parameters import DOZER, LIDAR, MONO, POSE_ERRORS, STEREO

ROLES = ("housecat",)
RANGING = {"stereo": STEREO, "lidar": LIDAR}
OPTIONS = {"ranging": "what measures distances: stereo or lidar (default: stereo)."}
IO = ("sim",)
FULL = DOZER.full_speed_mps
LIMITS = {"left_mps": (-FULL, FULL), "right_mps": (-FULL, FULL), "blade": (0.0, 1.0)}


def ranging_of(options: dict[str, str]) -> str:
    """Return the name of what measures distances; raise a ParameterError if there is no such thing."""
    ranging = options.get("ranging", "stereo")
    if ranging not in RANGING:
        raise ParameterError(f"--option ranging={ranging} is not valid.", fix=f"ranging={', ranging='.join(RANGING)}.")
    return ranging


def sim_pose(context: RobotContext) -> SimSensor:
    """Open the simulated markers."""
    return SimSensor(context.plant, "pose", POSE_ERRORS, context.rng("pose"))


def sim_vision(context: RobotContext, part: Any, name: str) -> SimSensor:
    """Open a simulated camera or lidar."""
    sensor: SimSensor = part.simulated(context.plant, "view", context.rng(name))
    return sensor


def sim_dozer(context: RobotContext) -> SimActuator[DozerCommand]:
    """Open the simulated tracks and blade."""
    return SimActuator(context.plant, "dozer", DozerCommand, LIMITS)


def roles(context: RobotContext, controller: Sequence[Factory]) -> dict[str, list[Any]]:
    """Return the components of the role: sensors first and tracks last, so a reading acts within its tick."""
    parameters = context.robot.parameters
    ranging = ranging_of(context.robot.options)
    loop_of = CameraLoopFactory if ranging == "stereo" else SensorLoopFactory
    part = RANGING[ranging]
    period_s = LIDAR.period_s if ranging == "lidar" else STEREO.camera.period_s
    sensors = [
        SensorLoopFactory("pose", partial(sim_pose, context), parameters.pose_hz),
        CameraLoopFactory("mono", partial(sim_vision, context, MONO, "mono"), 1.0 / MONO.period_s),
        loop_of(ranging, partial(sim_vision, context, part, ranging), 1.0 / period_s),
    ]
    tracks = ActuatorLoopFactory("dozer", partial(sim_dozer, context), parameters.dozer_hz, parameters.dozer_timeout_s)
    return {"housecat": [*sensors, *controller, tracks]}
