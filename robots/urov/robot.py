"""The underwater vehicle: two roles, joined by a link through the tether.

    topside                                  urov
    pilot --> page "controls" ==== link ====> failsafe, holds, allocation --> page "pwm" --> speed controllers --> plant
                                              ^ pages depth, imu, leak <-- sensors <--------------------------- plant
    display <-- pages vehicle, depth, <=====  page "vehicle": what it is doing
    link monitor  altitude, power, leak

    controls  what the surface asks for, 20 times a second    (controls.py)
    camera    its images, if it has a camera; that stays on board  (snr_sim/devices/sensors/camera.py)
    position_fix  from an observer above, if there is one (fix_hz in parameters.py)
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

from snr_sim.devices import (
    POSITION_FIX_ERRORS,
    Camera,
    CameraLoopFactory,
    GamepadLoopFactory,
    LoopbackPwm,
    McuBoard,
    McuPower,
    McuPwm,
    PositionFix,
    PwmBackend,
    PwmLoopFactory,
    PwmOut,
    PygameGamepad,
    ReplayedSensor,
    SensorLoopFactory,
    SimPwm,
    SimSensor,
    drive_plant,
)
from snr_sim.devices.emulated import Board, ProcessorInLoopPlant, firmware_elf
from snr_sim.devices.wire import SerialPort
from snr_sim.devices.wire.mcu_messages import BAUD
from snr_sim.errors import UnknownNameError
from snr_sim.plants import Plant
from snr_sim.plants.urov.t200 import MAX_PULSE_US, MIN_PULSE_US
from snr_sim.scenario import RECORDING_KEY, Factory, RobotContext
from snr_sim.signals import DepthReading, EchoReading, ImuReading, LeakReading, PowerReading
from snr_sim.teleop import (
    ButtonPanelFactory,
    DeadmanSwitch,
    Keyboard,
    LinkMonitorFactory,
    ManualInput,
    presses_of,
    surface_link,
)

from .autopilot import AutopilotFactory
from .controls import LEGEND, STICKS, gamepad_pilot, scripted_pilot
from .display import display
from .option_checks import BUTTONS, check_options
from .parameters import UrovParameters, failsafe_lines
from .waypoint_pilot import WaypointPilot

ROLES = ("urov", "topside")
OPTIONS = {
    "pilot": "scripted, or manual (game controller, keyboard)",
    "deadman": "yes: a game controller's sticks count only while its right trigger is held",
    "camera": "ahead or down: gives the vehicle a camera",
    "stop": "when the emergency stop at the surface is pressed, in s: 12, or 12,30.5 (for a controller at the surface)",
    "reset": "when the stop is released and reset, in s, in the same way",
    "host": "where the vehicle listens, when roles run by themselves: 127.0.0.1",
    "port": "and its port there, the same at both ends: 9120",
    "secret": "file with a text that both ends have, so that others cannot steer (or the variable SNR_SECRET holds it)",
    "allow": "addresses of surface computers that the vehicle takes without a secret, with commas between",
    "power": "board: with --io mcu:PORT, measures the battery at the microcontroller's pins A0 and A1",
}

LIMITS_US = MIN_PULSE_US, MAX_PULSE_US
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
    "position_fix": PositionFix,
}
ANSWERED = ("leak", "power", "imu")  # of these each reading sets off work; the others are looked up when needed
TO_TOPSIDE = ("vehicle", "depth", "altitude", "power", "leak", RECORDING_KEY)


def sim_sensor(context: RobotContext, name: str) -> Any:
    """Open a simulated sensor by its name."""
    return getattr(context.robot.parameters.sensors, name).simulated(context.plant, name, context.rng(name))


def camera_of(context: RobotContext) -> Camera | None:
    """Return the camera, if there is one: `--option camera=ahead` or `camera=down`, else that of the parameters."""
    looks = context.robot.options.get("camera")
    given: Camera | None = context.robot.parameters.sensors.camera
    return given if looks is None else Camera(looks)


def sim_camera(context: RobotContext) -> SimSensor:
    """Open the simulated camera."""
    return (camera_of(context) or Camera()).simulated(context.plant, "pose", context.rng("camera"))


def sim_position_fix(context: RobotContext) -> SimSensor:
    """Open the simulated position fix.

    Its random stream keeps the page's former name: another one would change the noise of every run.
    """
    return SimSensor(context.plant, "position_fix", POSITION_FIX_ERRORS, context.rng("place"))


def manual_input(context: RobotContext) -> ManualInput:
    """Open a game controller, or the keyboard."""
    needs_trigger = context.robot.options.get("deadman") == "yes"
    return ManualInput(
        lambda: DeadmanSwitch(PygameGamepad()) if needs_trigger else PygameGamepad(),
        lambda: Keyboard(STICKS),
        context.now_s,
    )


def sim_pwm(context: RobotContext) -> PwmBackend:
    """Open the simulated outputs to the speed controllers."""
    return SimPwm(context.plant, context.now_s, thruster_count(context), limits_us=LIMITS_US)


def loopback_pwm(context: RobotContext) -> PwmBackend:
    """Open outputs with nothing behind them."""
    return LoopbackPwm(context.now_s, thruster_count(context), LIMITS_US)


def mcu_board(context: RobotContext) -> McuBoard:
    """Return the microcontroller's board at the port that was named. Its port is opened when a device needs it."""
    port = PI["pwm"].removeprefix("mcu:") if context.io == "pi" else context.address
    board: McuBoard = context.get_or_create("board", lambda: McuBoard(lambda: SerialPort(port, BAUD), context.now_s))
    return board


def mcu_pwm(context: RobotContext) -> PwmBackend:
    """Open the microcontroller's outputs; the simulated vehicle is driven by what they do."""
    assert context.plant is not None
    return drive_plant(McuPwm(mcu_board(context), context.now_s, thruster_count(context)), context.plant)


def mcu_power(context: RobotContext) -> Any:
    """Open what measures the battery: that of the simulated vehicle, unless `--option power=board`."""
    is_at_board = context.robot.options.get("power") == "board"
    return McuPower(mcu_board(context)) if is_at_board else sim_sensor(context, "power")


def bench_pwm(context: RobotContext) -> PwmBackend:
    """Open real outputs; the simulated vehicle is driven by what they do."""
    from snr_sim.devices import open_pwm  # only real wires need it, and it takes 60 ms

    assert context.plant is not None
    out = open_pwm(f"{context.io}:{context.address}", context.now_s, thruster_count(context), LIMITS_US)
    return drive_plant(out, context.plant)


def pi_pwm(context: RobotContext) -> PwmOut:
    """Open the outputs that the table of ports names."""
    from snr_sim.devices import check_table, open_pwm

    check_table({name: text for name, text in PI.items() if text != "mcu"})
    if PI["pwm"].startswith("mcu:"):
        return McuPwm(mcu_board(context), context.now_s, thruster_count(context))
    return open_pwm(PI["pwm"], context.now_s, thruster_count(context), LIMITS_US)


def pi_sensor(context: RobotContext, name: str) -> Any:
    """Open a sensor that the table of ports names."""
    from snr_sim.devices import open_sensor

    if PI[name] == "mcu":
        return McuPower(mcu_board(context))
    return open_sensor(PI[name], context.now_s, getattr(context.robot.parameters.sensors, name))


def emulated_mcu(context: RobotContext) -> McuBoard:
    """Return the emulated board at its serial line, as `wrap_plant` added it to the plant."""
    assert isinstance(context.plant, ProcessorInLoopPlant)
    return context.plant.mcu


def wrap_plant(context: RobotContext) -> Plant:
    """Return the plant; with `--io emulated`, with its thrusters at the pins of an emulated board."""
    assert context.plant is not None
    if context.io != "emulated":
        return context.plant
    return ProcessorInLoopPlant(
        context.plant, lambda: Board(firmware_elf(FIRMWARE, MCU), MCU), thruster_count(context), power="power"
    )


def replayed_sensor(context: RobotContext, name: str) -> ReplayedSensor:
    """Open a sensor that returns the readings of a recorded run."""
    assert context.recorded is not None
    return ReplayedSensor(name, context.recorded(name), READINGS[name], context.now_s)


def no_camera(context: RobotContext) -> Any:
    """Raise an UnknownNameError: pictures are not read again."""
    raise UnknownNameError("With --io replay:RUN there is no camera.", fix="leave out --option camera.")


def thruster_count(context: RobotContext) -> int:
    """Return how many thrusters the vehicle has."""
    return len(context.robot.parameters.vehicle.thrusters)


# What each device is, for each way of running the robot. Nothing else decides between simulation and hardware.
SIMULATED: dict[str, Callable[[RobotContext], Any]] = {
    **{name: partial(sim_sensor, name=name) for name in SENSORS},
    "camera": sim_camera,
    "position_fix": sim_position_fix,
    "pwm": sim_pwm,
    "manual_input": manual_input,
}
DEVICES: dict[str, dict[str, Callable[[RobotContext], Any]]] = {
    "sim": SIMULATED,
    "loopback": {**SIMULATED, "pwm": loopback_pwm},
    "emulated": {
        **SIMULATED,
        "pwm": lambda context: McuPwm(emulated_mcu(context), context.now_s, thruster_count(context)),
        "power": lambda context: McuPower(emulated_mcu(context)),
    },
    "mcu": {**SIMULATED, "pwm": mcu_pwm, "power": mcu_power},
    **{kind: {**SIMULATED, "pwm": bench_pwm} for kind in ("maestro", "pca9685", "sysfs")},
    "pi": {
        **{name: partial(pi_sensor, name=name) for name in PI if name != "pwm"},
        "pwm": pi_pwm,
        "manual_input": manual_input,
    },
    "replay": {
        **{name: partial(replayed_sensor, name=name) for name in READINGS},
        "camera": no_camera,
        "pwm": loopback_pwm,
        "manual_input": manual_input,
    },
}
IO = tuple(DEVICES)


def roles(context: RobotContext, controller: Sequence[Factory]) -> dict[str, list[Any]]:
    """Return the components of each role. At the vehicle sensors come first and thrusters last."""
    parameters: UrovParameters = context.robot.parameters
    devices = DEVICES[context.io]
    check_options(context)
    tether = surface_link(context, "urov", "tether", parameters.port, parameters.tether)
    # The surface does not listen, so it does not need the settings that restrict access to the vehicle.
    below = [] if context.standalone_role == "topside" else [tether.server(TO_TOPSIDE, accept=["controls"])]
    sensors = [
        SensorLoopFactory(name, partial(devices[name], context), parameters.sensors.rates_hz[name], name in ANSWERED)
        for name in SENSORS
        if name in devices
    ]
    camera = camera_of(context)
    if camera is not None:
        open_camera = partial(devices["camera"], context)
        sensors.insert(0, CameraLoopFactory("camera", open_camera, 1.0 / camera.period_s, process=False))
    if parameters.fix_hz:
        sensors.insert(0, fix_loop(context, parameters.fix_hz))
    # The failsafe actions of another autopilot than ours are not known here.
    lines = failsafe_lines(parameters) if any(isinstance(one, AutopilotFactory) for one in controller) else []
    pwm = PwmLoopFactory("pwm", partial(devices["pwm"], context), parameters.pwm_hz)
    return {
        "urov": [*below, *sensors, *controller, pwm],
        "topside": [tether.client("controls", accept=TO_TOPSIDE), *_surface(context, parameters, lines)],
    }


def fix_loop(context: RobotContext, rate_hz: float) -> Factory:
    """Return the loop of the position fix."""
    return SensorLoopFactory("position_fix", partial(DEVICES[context.io]["position_fix"], context), rate_hz)


def _surface(context: RobotContext, parameters: UrovParameters, lines: Sequence[str]) -> list[Factory]:
    """Return the pilot's components: with `--option pilot=manual` those of a person.

    Else a pilot who sees the vehicle, if there is a route, or one who follows a script. A controller's own components
    at the surface come between: they make "controls" from the pages of the eyes, the panel and the "sticks".
    """
    extra, rate_hz = context.extra_components.get("topside", ()), parameters.command_hz
    key = "sticks" if extra else "controls"
    if context.robot.options.get("pilot") == "manual":
        # The pilot looks into the water.
        has_fix = not context.standalone_role and "position_fix" in DEVICES[context.io]
        return [
            *([fix_loop(context, 10.0)] if has_fix else []),
            GamepadLoopFactory("gamepad", partial(DEVICES[context.io]["manual_input"], context), rate_hz),
            gamepad_pilot(key),
            display(has_gamepad=True, lines=[*LEGEND, *lines]),
            LinkMonitorFactory("link_tether"),
            *extra,
        ]
    if parameters.route:
        panel = ButtonPanelFactory("panel", presses_of(context.robot.options, BUTTONS), rate_hz)
        pilot: list[Factory] = [panel, *extra] if extra else [WaypointPilot.factory("pilot", route=parameters.route)]
        return [fix_loop(context, 10.0), *pilot]
    shown = display(in_lock_step=False, lines=lines)
    return [scripted_pilot(parameters.script, rate_hz, key), shown, LinkMonitorFactory("link_tether"), *extra]
