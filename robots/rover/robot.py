"""The rover: a motor in each of six wheels, an inertial unit, and, if asked for, a satellite receiver and a pilot.

    topside                                  rover
    pilot --> page "controls" ==== link ===> controller --> page "drive" --> motors --> plant
                                             ^ pages motor_LF ... motor_RB, imu, gps, power <----- plant
    display, link monitor  <================ pages "vehicle", "odometry", "power"

    motor_LF  speed_radps and turned_rad of the wheel, current_a, voltage_v and more: see MotorReading in
              snr_sim/prelude/ground_signals.py; LF is left front, then LM, LB, RF, RM, RB
    imu       rate_radps, specific_force_mps2, roll_rad, pitch_rad (positive: the nose goes down), yaw_rad, stamp_s
    gps       latitude_deg, longitude_deg, speed_mps, course_rad, stamp_s; where parameters.gps_hz is not 0
    scan      ranges_m, angles_rad (0 ahead, positive to the left), stamp_s; where parameters.scan_hz is not 0
    power     voltage_v, current_a, stamp_s
    arm       angles_rad, rates_radps, torques_nm of the joints, stamp_s; where the vehicle has an arm
    arm_goals angles_rad: base, shoulder, elbow, wrist_pitch, wrist_roll, grip (snr_sim/plants/ground/manipulator.py)
    drive     mode ("speed", "current", "duty", "brake" or "off") and values, one for each wheel in the order above:
              rad/s, A, -1 to 1, or A
    controls  what the surface asks for, where there is a pilot (controls.py); odometry and vehicle come from the
              controllers that need them (odometry.py, controllers/sticks.py)

With `--io emulated` each motor has an emulated VESC controller, driven and read by the bytes of a serial line; with
`--io pty` that is a serial port of this computer, in real time, and the port's owner is a process that puts the wheels
at neutral when this program ends or hangs. A controller's port is found by its name; when a port
is gone, all wheels go to neutral until all controllers are found and the robot has commanded neutral, as it does while
its pilot has disarmed it. A command older than a fifth of a second, and none at all, is neutral too: no torque, and
after a tenth of a second a brake of 4 A, since a rover that rolled freely would drive down a slope. Its numbers are in
parameters.py and vehicles/, its physics in snr_sim/plants, its ground in the scenario.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from snr_sim.devices import (
    ActuatorLoopFactory,
    ControllerSettings,
    GamepadLoopFactory,
    GuardedMotors,
    GuardedSensor,
    GuardLine,
    MotorLoopFactory,
    MotorPorts,
    PortWatch,
    PygameGamepad,
    SensorErrors,
    SensorLoopFactory,
    SimActuator,
    SimMotors,
    SimSensor,
    VescLine,
    VescMotors,
    VescSensor,
    read_ports,
)
from snr_sim.devices.emulated import PtyPlant, VescPlant
from snr_sim.errors import ParameterError
from snr_sim.plants import Plant
from snr_sim.scenario import RECORDING_KEY, Factory, RobotContext
from snr_sim.signals import ArmCommand
from snr_sim.teleop import DeadmanSwitch, Keyboard, LinkMonitorFactory, ManualInput, pilot_of, surface_link

from .controls import DEADMAN_BUTTON, LAYOUTS, LEGENDS, gamepad_pilot, layout_of, scripted_pilot
from .display import display
from .parameters import MOTOR_ERRORS, RoverParameters

ROLES = ("rover", "topside")
OPTIONS = {
    "pilot": "scripted, or manual (game controller, keyboard)",
    "sticks": "arcade (one stick ahead and to the sides), or tank (a stick for each side)",
    "deadman": "yes: a game controller's sticks count only while its left shoulder is held",
    "host": "where the rover listens, when roles run by themselves: 127.0.0.1",
    "port": "and its port there, the same at both ends: 9130",
    "secret": "file with a text that both ends have, so that others cannot steer (or the variable SNR_SECRET holds it)",
    "unproven": "yes: with --io ports:FILE also motors whose controllers' timeouts were never measured are armed",
    "allow": "addresses of surface computers that the rover takes without a secret, with commas between",
}
TO_TOPSIDE = ("vehicle", "odometry", "power", RECORDING_KEY)


def sim_sensor(context: RobotContext, name: str, errors: SensorErrors) -> SimSensor:
    """Open a simulated sensor."""
    return SimSensor(context.plant, name, errors, context.rng(name))


def sim_motor(context: RobotContext, name: str) -> SimSensor:
    """Open what reads a simulated motor."""
    return sim_sensor(context, name, MOTOR_ERRORS)


def sim_imu(context: RobotContext) -> SimSensor:
    """Open the simulated inertial unit."""
    sensor: SimSensor = context.robot.parameters.imu.simulated(context.plant, "imu", context.rng("imu"))
    return sensor


def sim_gps(context: RobotContext) -> SimSensor:
    """Open the simulated satellite receiver."""
    sensor: SimSensor = context.robot.parameters.gps.simulated(context.plant, "pose", context.rng("gps"))
    return sensor


def sim_scan(context: RobotContext) -> SimSensor:
    """Open the simulated lidar."""
    sensor: SimSensor = context.robot.parameters.lidar.simulated(context.plant, "pose", context.rng("scan"))
    return sensor


def sim_arm(context: RobotContext) -> SimActuator[ArmCommand]:
    """Open the simulated servos of the arm, each of which has limits within these."""
    plant, arm = context.plant, context.robot.parameters.vehicle.arm
    limits = {"angles_rad": (min(arm.lows_rad), max(arm.highs_rad))}
    return SimActuator(plant.plant if isinstance(plant, VescPlant | PtyPlant) else plant, "arm", ArmCommand, limits)


def sim_motors(context: RobotContext) -> SimMotors:
    """Open the simulated motors."""
    parameters = context.robot.parameters
    return SimMotors(context.plant, context.now_s, len(motor_names(parameters)), parameters.motor_limits)


def motor_ports(context: RobotContext) -> MotorPorts:
    """Return the ports of the motors' controllers, as `wrap_plant` added them to the plant."""
    plant = context.plant
    assert isinstance(plant, VescPlant)
    found: MotorPorts = context.get_or_create(
        "motor_ports", lambda: MotorPorts(PortWatch(plant.list_ports), plant.open_port, context.now_s)
    )
    return found


def vesc_line(context: RobotContext, name: str) -> VescLine:
    """Return the line of a motor's controller, which is found by its name."""
    factor, open_port = context.robot.parameters.erpm_per_rpm, partial(motor_ports(context).open_port, name)
    line: VescLine = context.get_or_create(name, lambda: VescLine(name, open_port, context.now_s, factor, "seed"))
    return line


def vesc_motor(context: RobotContext, name: str) -> VescSensor:
    """Open what reads a motor by its controller."""
    return VescSensor(vesc_line(context, name))


def vesc_motors(context: RobotContext) -> VescMotors:
    """Open the controllers of all motors."""
    parameters: RoverParameters = context.robot.parameters
    lines = [vesc_line(context, name) for name in motor_names(parameters)]
    return VescMotors(lines, parameters.motor_limits, parameters.neutral_a, poll=motor_ports(context).poll)


def motor_guard(context: RobotContext) -> GuardLine:
    """Return the guard of the motors' controllers, a process that owns their ports."""
    plant, settings = context.plant, controller_settings(context)
    links = str(plant.folder) if isinstance(plant, PtyPlant) else read_ports(Path(context.address)).links
    guard: GuardLine = context.get_or_create("motor_guard", lambda: GuardLine.of_links(context.now_s, settings, links))
    return guard


def controller_settings(context: RobotContext) -> ControllerSettings:
    """Return what is known of the motors' controllers; with `--io ports:FILE` the file names them."""
    parameters: RoverParameters = context.robot.parameters
    settings = ControllerSettings(
        motor_names(parameters), parameters.erpm_per_rpm, parameters.motor_limits, parameters.neutral_a, "seed"
    )
    if context.io != "ports":
        return settings
    ports, is_unproven = read_ports(Path(context.address)), context.robot.options.get("unproven") == "yes"
    return replace(settings, chips=ports.vesc, timeouts_s=None if is_unproven else ports.timeout_s)


def guarded_motor(context: RobotContext, name: str) -> GuardedSensor:
    """Open what reads a motor by its guard."""
    return GuardedSensor(motor_guard(context), name)


def guarded_motors(context: RobotContext) -> GuardedMotors:
    """Open the motors behind their guard; the simulated ones do the same as real ones."""
    return GuardedMotors(motor_guard(context), context.plant if context.io == "ports" else None)


def wrap_plant(context: RobotContext) -> Plant:
    """Return the plant; with `--io emulated` and `--io pty`, with an emulated controller at each motor."""
    assert context.plant is not None
    if context.io in ("sim", "ports"):
        return context.plant
    parameters: RoverParameters = context.robot.parameters
    names, replugs = motor_names(parameters), parameters.replugs
    controllers = VescPlant if context.io == "emulated" else PtyPlant
    return controllers(context.plant, names, parameters.erpm_per_rpm, replugs=replugs, dialect="seed")


def motor_names(parameters: RoverParameters) -> list[str]:
    """Return the names of the motors, in the order of a command's values."""
    return [f"motor_{wheel.name}" for wheel in parameters.vehicle.motor_wheels]


def manual_input(context: RobotContext) -> ManualInput:
    """Open a game controller, or the keyboard."""
    options = context.robot.options
    return ManualInput(
        lambda: DeadmanSwitch(PygameGamepad(), DEADMAN_BUTTON) if options.get("deadman") == "yes" else PygameGamepad(),
        lambda: Keyboard(LAYOUTS[layout_of(options)]),
        context.now_s,
    )


# What drives and reads the motors, for each way of running the robot. All else is simulated.
DEVICES: dict[str, dict[str, Callable[..., Any]]] = {
    "sim": {"motor": sim_motor, "drive": sim_motors},
    "emulated": {"motor": vesc_motor, "drive": vesc_motors},
    "pty": {"motor": guarded_motor, "drive": guarded_motors},
    "ports": {"motor": guarded_motor, "drive": guarded_motors},
}
IO = tuple(DEVICES)


def roles(context: RobotContext, controller: Sequence[Factory]) -> dict[str, list[Any]]:
    """Return the components of each role. Sensors are first and motors last, so a reading acts within its tick."""
    parameters: RoverParameters = context.robot.parameters
    devices = DEVICES[context.io]
    if "unproven" in context.robot.options and context.io != "ports":
        raise ParameterError("--option unproven=... is for real controllers.", fix="leave it out, or --io ports:FILE.")
    sensors = [
        SensorLoopFactory(name, partial(devices["motor"], context, name), parameters.motors_hz)
        for name in motor_names(parameters)
    ]
    sensors.append(SensorLoopFactory("imu", partial(sim_imu, context), parameters.imu_hz))
    power = partial(sim_sensor, context, "power", SensorErrors())
    sensors.append(SensorLoopFactory("power", power, parameters.power_hz))
    if parameters.gps_hz:
        sensors.append(SensorLoopFactory("gps", partial(sim_gps, context), parameters.gps_hz))
    if parameters.scan_hz:
        sensors.append(SensorLoopFactory("scan", partial(sim_scan, context), parameters.scan_hz))
    arm: list[Factory] = []
    if parameters.vehicle.arm:
        joints = partial(sim_sensor, context, "arm", SensorErrors())
        sensors.append(SensorLoopFactory("arm", joints, parameters.arm_hz))
        arm = [ActuatorLoopFactory("arm_goals", partial(sim_arm, context), parameters.drive_hz)]
    motors = MotorLoopFactory("drive", partial(devices["drive"], context), parameters.drive_hz)
    rover, extra = [*sensors, *controller, *arm, motors], list(context.extra_components.get("topside", ()))
    if not parameters.script:
        _check_no_options(context)
        return {"rover": rover, "topside": extra}
    radio = surface_link(context, "rover", "radio", parameters.port, parameters.radio)
    # The surface does not listen, so it does not need the settings that restrict access to the rover.
    below = [] if context.standalone_role == "topside" else [radio.server(TO_TOPSIDE, accept=["controls"])]
    above = [radio.client("controls", accept=TO_TOPSIDE), *_surface(context, parameters), *extra]
    return {"rover": [*below, *rover], "topside": above}


def _surface(context: RobotContext, parameters: RoverParameters) -> list[Factory]:
    """Return the pilot's components: with `--option pilot=manual` those of a person, else one who follows a script."""
    options = context.robot.options
    layout, monitor = layout_of(options), LinkMonitorFactory("link_radio")
    if pilot_of(options) == "scripted":
        return [scripted_pilot(parameters.script, parameters.command_hz), display(in_lock_step=False), monitor]
    gamepad = GamepadLoopFactory("gamepad", partial(manual_input, context), parameters.command_hz)
    return [gamepad, gamepad_pilot(layout), display(has_gamepad=True, lines=LEGENDS[layout]), monitor]


def _check_no_options(context: RobotContext) -> None:
    for name in sorted((context.robot.options.keys() & OPTIONS.keys()) - {"unproven"}):
        raise ParameterError(
            f"--option {name}=... has no effect: there is no pilot in {context.robot.scenario}.",
            fix="leave it out, or run rover_teleop.",
        )
