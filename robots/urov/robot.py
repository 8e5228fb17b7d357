"""The underwater vehicle: two roles, joined by a link through the tether.

    topside                                  urov
    pilot --> page "controls" ==== link ====> failsafe, holds, allocation --> page "pwm" --> speed controllers --> plant
                                              ^ pages depth, imu, leak <-- sensors <--------------------------- plant
    display <-- pages vehicle, depth, <=====  page "vehicle": what it is doing
    link monitor  altitude, power, leak

    controls  what the surface asks for, 20 times a second    (controls.py)
    camera    its images, if it has a camera; that stays on board  (snr_sim/devices/sensors/camera.py)
    place     position fix from an observer above, if there is one (fix_hz in parameters.py)
    vehicle   what the vehicle is doing, and for whom          (autopilot.py, failsafe_monitor.py)
    pwm       pulses_us of each thruster

Its numbers are in parameters.py and vehicles/, its physics in snr_sim/plants, and what happens in the scenario.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from snr_sim.devices.emulated.board import Board
from snr_sim.devices.emulated.lock_step import PlantOnBoard
from snr_sim.devices.emulated.toolchain import firmware_elf
from snr_sim.devices.loops import SensorLoopFactory
from snr_sim.devices.mcu.mcu import McuPower, McuPwm
from snr_sim.devices.mcu.mcu_board import McuBoard
from snr_sim.devices.pad import PadLoopFactory
from snr_sim.devices.pwm.mirror import MirrorPwm
from snr_sim.devices.pwm.pwm_backend import PwmBackend
from snr_sim.devices.pwm.pwm_loop import PwmLoopFactory
from snr_sim.devices.pwm.sim_pwm import SimPwm, drive_plant
from snr_sim.devices.pygame_pad import PygamePad
from snr_sim.devices.replayed import ReplayedSensor
from snr_sim.devices.sensors.camera import Camera, CameraLoopFactory
from snr_sim.devices.sensors.position_fix import POSITION_FIX_ERRORS, PositionFix
from snr_sim.devices.simulated import SimSensor
from snr_sim.devices.wire.mcu_messages import BAUD
from snr_sim.devices.wire.serial_port import SerialPort
from snr_sim.plants.urov.t200 import LEAST_US, MOST_US
from snr_sim.prelude.component import Factory
from snr_sim.prelude.device import PwmOut
from snr_sim.prelude.errors import UnknownName
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.recorder import RECORDING_KEY
from snr_sim.prelude.scenario import Rig
from snr_sim.prelude.signals import DepthReading, EchoReading, ImuReading, LeakReading, PowerReading
from snr_sim.teleop.button_panel import ButtonPanelFactory, presses_of
from snr_sim.teleop.keyboard import Keyboard
from snr_sim.teleop.link_monitor import LinkMonitorFactory
from snr_sim.teleop.link_options import surface_link
from snr_sim.teleop.manual_input import DeadmanSwitch, ManualInput

from .autopilot import AutopilotFactory
from .choices import BUTTONS, check_choices
from .controls import LEGEND, STICKS, gamepad_pilot, scripted_pilot
from .display import display
from .parameters import UrovParameters, failsafe_lines
from .seeing_pilot import SeeingPilotFactory

ROLES = ("urov", "topside")
OPTIONS = {
    "pilot": "who flies: scripted, or hands (game controller, keyboard)",
    "deadman": "yes: a game controller's sticks count only while its right trigger is held",
    "camera": "ahead or down: gives the vehicle a camera",
    "stop": "when the emergency stop at the surface is pressed, in s: 12, or 12,30.5 (for a controller at the surface)",
    "reset": "when the stop is released and reset, in s, in the same way",
    "host": "where the vehicle listens, when roles run by themselves: 127.0.0.1",
    "port": "and its port there, the same at both ends: 9120",
    "secret": "file with a text that both ends have, so that nobody else steers (or the variable SNR_SECRET holds it)",
    "allow": "addresses of surface computers that the vehicle takes without a secret, with commas between",
    "power": "board: with --io mcu:PORT, measures the battery at the microcontroller's pins A0 and A1",
}

FIRMWARE = Path(__file__).parent / "firmware"
MCU = "atmega328p"

# With --io pi: which device of your vehicle is at which port or address; `snr doctor` lists them. A device that is not
# in this table is absent: an altimeter, a leak probe. "mcu" without a port is the board of the thrusters.
PI: dict[str, str] = {
    "pwm": "mcu:/dev/ttyUSB0",
    "power": "mcu",
    "depth": "ms5837:1:0x76",
    "imu": "icm20948:1:0x69",
}

SENSORS = ("depth", "altitude", "power", "leak", "imu")  # the last one triggers control, so it is after the others
READINGS: dict[str, type[msgspec.Struct]] = {
    "depth": DepthReading,
    "altitude": EchoReading,
    "power": PowerReading,
    "leak": LeakReading,
    "imu": ImuReading,
    "place": PositionFix,
}
ANSWERED = ("leak", "power", "imu")  # of these each reading sets off work; the others are looked up when needed
TO_TOPSIDE = ("vehicle", "depth", "altitude", "power", "leak", RECORDING_KEY)


def sim_sensor(rig: Rig, name: str) -> Any:
    """Open a simulated sensor by its name."""
    return getattr(rig.robot.parameters.sensors, name).simulated(rig.plant, name, rig.rng(name))


def camera_of(rig: Rig) -> Camera | None:
    """Return the camera, if there is one: `--option camera=ahead` or `camera=down`, else that of the parameters."""
    looks = rig.robot.options.get("camera")
    given: Camera | None = rig.robot.parameters.sensors.camera
    return given if looks is None else Camera(looks)


def sim_camera(rig: Rig) -> SimSensor:
    """Open the simulated camera."""
    return (camera_of(rig) or Camera()).simulated(rig.plant, "pose", rig.rng("camera"))


def sim_eyes(rig: Rig) -> SimSensor:
    """Open the eyes of the pilot above the water."""
    return SimSensor(rig.plant, "place", POSITION_FIX_ERRORS, rig.rng("place"))


def hands(rig: Rig) -> ManualInput:
    """Open a game controller, or the keyboard."""
    needs_trigger = rig.robot.options.get("deadman") == "yes"
    return ManualInput(
        lambda: DeadmanSwitch(PygamePad()) if needs_trigger else PygamePad(), lambda: Keyboard(STICKS), rig.now_s
    )


def sim_pwm(rig: Rig) -> PwmBackend:
    """Open the simulated outputs to the speed controllers."""
    return SimPwm(rig.plant, rig.now_s, thruster_count(rig), limits_us=(LEAST_US, MOST_US))


def mirror_pwm(rig: Rig) -> PwmBackend:
    """Open outputs with nothing behind them."""
    return MirrorPwm(rig.now_s, thruster_count(rig), (LEAST_US, MOST_US))


def mcu_board(rig: Rig) -> McuBoard:
    """Return the microcontroller's board at the port that was named. Its port is opened when a device needs it."""
    port = PI["pwm"].removeprefix("mcu:") if rig.io == "pi" else rig.where
    board: McuBoard = rig.share("board", lambda: McuBoard(lambda: SerialPort(port, BAUD), rig.now_s))
    return board


def mcu_pwm(rig: Rig) -> PwmBackend:
    """Open the microcontroller's outputs; the simulated vehicle is driven by what they do."""
    assert rig.plant is not None
    return drive_plant(McuPwm(mcu_board(rig), rig.now_s, thruster_count(rig)), rig.plant)


def mcu_power(rig: Rig) -> Any:
    """Open what measures the battery: that of the simulated vehicle, unless `--option power=board`."""
    return McuPower(mcu_board(rig)) if rig.robot.options.get("power") == "board" else sim_sensor(rig, "power")


def bench_pwm(rig: Rig) -> PwmBackend:
    """Open real outputs; the simulated vehicle is driven by what they do."""
    from snr_sim.devices.opening import open_pwm  # only real wires need it, and it takes 60 ms

    assert rig.plant is not None
    out = open_pwm(f"{rig.io}:{rig.where}", rig.now_s, thruster_count(rig), (LEAST_US, MOST_US))
    return drive_plant(out, rig.plant)


def pi_pwm(rig: Rig) -> PwmOut:
    """Open the outputs that the table of ports names."""
    from snr_sim.devices.opening import check_table, open_pwm

    check_table({name: text for name, text in PI.items() if text != "mcu"})
    if PI["pwm"].startswith("mcu:"):
        return McuPwm(mcu_board(rig), rig.now_s, thruster_count(rig))
    return open_pwm(PI["pwm"], rig.now_s, thruster_count(rig), (LEAST_US, MOST_US))


def pi_sensor(rig: Rig, name: str) -> Any:
    """Open a sensor that the table of ports names."""
    from snr_sim.devices.opening import open_sensor

    if PI[name] == "mcu":
        return McuPower(mcu_board(rig))
    return open_sensor(PI[name], rig.now_s, getattr(rig.robot.parameters.sensors, name))


def emulated_pwm(rig: Rig) -> McuPwm:
    """Open the outputs of the emulated board, over its serial line."""
    return McuPwm(plant_on_board(rig).mcu, rig.now_s, thruster_count(rig))


def emulated_power(rig: Rig) -> McuPower:
    """Open the power module at the emulated board."""
    return McuPower(plant_on_board(rig).mcu)


def plant_on_board(rig: Rig) -> PlantOnBoard:
    """Return the plant with its board, as it was wrapped at the start."""
    assert isinstance(rig.plant, PlantOnBoard)
    return rig.plant


def dressed(rig: Rig) -> Plant:
    """Return the plant; with `--io emulated`, with its thrusters at the pins of an emulated board."""
    assert rig.plant is not None
    if rig.io != "emulated":
        return rig.plant
    return PlantOnBoard(rig.plant, lambda: Board(firmware_elf(FIRMWARE, MCU), MCU), thruster_count(rig), power="power")


def replayed_sensor(rig: Rig, name: str) -> ReplayedSensor:
    """Open a sensor that returns the readings of a recorded run."""
    assert rig.recorded is not None
    return ReplayedSensor(name, rig.recorded(name), READINGS[name], rig.now_s)


def no_camera(rig: Rig) -> Any:
    """Refuse.

    Raises:
        UnknownName: pictures are not read again.
    """
    raise UnknownName("With --io replay:RUN there is no camera.", fix="leave out --option camera.")


def thruster_count(rig: Rig) -> int:
    """Return how many thrusters the vehicle has."""
    return len(rig.robot.parameters.vehicle.thrusters)


# What each device is, for each way of running the robot. Nothing else decides between simulation and hardware.
SIMULATED: dict[str, Callable[[Rig], Any]] = {
    **{name: partial(sim_sensor, name=name) for name in SENSORS},
    "camera": sim_camera,
    "place": sim_eyes,
    "pwm": sim_pwm,
    "hands": hands,
}
DEVICES: dict[str, dict[str, Callable[[Rig], Any]]] = {
    "sim": SIMULATED,
    "mirror": {**SIMULATED, "pwm": mirror_pwm},
    "emulated": {**SIMULATED, "pwm": emulated_pwm, "power": emulated_power},
    "mcu": {**SIMULATED, "pwm": mcu_pwm, "power": mcu_power},
    **{kind: {**SIMULATED, "pwm": bench_pwm} for kind in ("maestro", "pca9685", "sysfs")},
    "pi": {
        **{name: partial(pi_sensor, name=name) for name in PI if name != "pwm"},
        "pwm": pi_pwm,
        "hands": hands,
    },
    "replay": {
        **{name: partial(replayed_sensor, name=name) for name in READINGS},
        "camera": no_camera,
        "pwm": mirror_pwm,
        "hands": hands,
    },
}
IO = tuple(DEVICES)


def roles(rig: Rig, controller: Sequence[Factory]) -> dict[str, list[Any]]:
    """Return the components of each role. At the vehicle sensors come first and thrusters last."""
    parameters: UrovParameters = rig.robot.parameters
    devices = DEVICES[rig.io]
    check_choices(rig)
    tether = surface_link(rig, "urov", "tether", parameters.port, parameters.tether)
    # The surface does not listen, so it does not need the settings that restrict access to the vehicle.
    below = [] if rig.role_apart == "topside" else [tether.server(TO_TOPSIDE, accept=["controls"])]
    sensors = [
        SensorLoopFactory(name, partial(devices[name], rig), parameters.sensors.rates_hz[name], name in ANSWERED)
        for name in SENSORS
        if name in devices
    ]
    camera = camera_of(rig)
    if camera is not None:
        open_camera = partial(devices["camera"], rig)
        sensors.insert(0, CameraLoopFactory("camera", open_camera, 1.0 / camera.period_s, process=False))
    if parameters.fix_hz:
        sensors.insert(0, SensorLoopFactory("place", partial(devices["place"], rig), parameters.fix_hz))
    # The failsafe actions of another autopilot than ours are not known here.
    lines = failsafe_lines(parameters) if any(isinstance(one, AutopilotFactory) for one in controller) else []
    pwm = PwmLoopFactory("pwm", partial(devices["pwm"], rig), parameters.pwm_hz)
    return {
        "urov": [*below, *sensors, *controller, pwm],
        "topside": [tether.client("controls", accept=TO_TOPSIDE), *_surface(rig, parameters, lines)],
    }


def _surface(rig: Rig, parameters: UrovParameters, lines: Sequence[str]) -> list[Factory]:
    """Return the pilot's components: with `--option pilot=hands` those of a person.

    Else a pilot who sees the vehicle, if there is a route, or one who follows a script. A controller's own components
    at the surface come between: they make "controls" from the pages of the eyes, the panel and the "sticks".
    """
    crew, rate_hz = rig.crew.get("topside", ()), parameters.command_hz
    key = "sticks" if crew else "controls"
    if rig.robot.options.get("pilot") == "hands":
        hands = PadLoopFactory("pad", partial(DEVICES[rig.io]["hands"], rig), rate_hz)
        sees = not rig.role_apart and "place" in DEVICES[rig.io]  # the pilot looks into the water
        eyes = [SensorLoopFactory("place", partial(DEVICES[rig.io]["place"], rig), 10.0)] if sees else []
        return [
            *eyes,
            hands,
            gamepad_pilot(key),
            display(has_pad=True, lines=[*LEGEND, *lines]),
            LinkMonitorFactory("link_tether"),
            *crew,
        ]
    if parameters.route:
        return [
            SensorLoopFactory("place", partial(DEVICES[rig.io]["place"], rig), 10.0),
            *(
                [ButtonPanelFactory("panel", presses_of(rig.robot.options, BUTTONS), rate_hz), *crew]
                if crew
                else [SeeingPilotFactory(parameters.route)]
            ),
        ]
    shown = display(in_lock_step=False, lines=lines)
    return [scripted_pilot(parameters.script, rate_hz, key), shown, LinkMonitorFactory("link_tether"), *crew]
