"""Guard of motors: a small process that owns the ports of their controllers.

    robot's program --leases over a pipe--> guard --setpoints at 50 Hz--> controllers
    (GuardedMotors) <--status, readings---- (this) <--values-------------

It repeats the newest setpoint only while its lease is valid, then the motors go to neutral, and likewise at once when
the pipe closes, which happens however the robot's program ends. If the guard is killed or hangs, the controllers brake
by their own timeouts.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from snr_sim.devices.motors.can_line import CanLine, SharedCan
from snr_sim.devices.motors.controller_line import ControllerLine
from snr_sim.devices.motors.motor_backend import RELEASE_S, MotorBackend
from snr_sim.devices.motors.motor_ports import MotorPorts
from snr_sim.devices.motors.port_watch import PortWatch
from snr_sim.devices.motors.vesc_line import ANSWER_S, VescLine
from snr_sim.devices.motors.vesc_motors import VescMotors, VescSensor
from snr_sim.devices.output_supervisor import OutputSupervisor, serve
from snr_sim.devices.wire import lease_messages as wire
from snr_sim.devices.wire.can_bus import PREFIX, CanBus
from snr_sim.devices.wire.serial_port import SerialPort, list_links
from snr_sim.devices.wire.vesc_messages import Dialect
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.ground_signals import DriveCommand
from snr_sim.prelude.task import ensure_type_info

TARGET = "snr_sim.devices.motors.motor_guard:run"
PERIOD_S = 0.02
READ_PERIOD_S = 0.05


class GuardedPorts(NamedTuple):
    """What a guard owns: motors, and the controllers by which they are read."""

    motors: MotorBackend
    lines: Sequence[ControllerLine[Any]]


class ControllerSettings(msgspec.Struct, frozen=True):
    """What is known of a robot's motor controllers.

    Args:
        names: of the motors, in the order of a command's values.
        erpm_per_rpm: see `VescCodec`.
        limits: see `MotorBackend`.
        neutral_a: current of the brake.
        dialect: of the controllers.
        chips: see `Handshake`.
        timeouts_s: see `VescMotors`.
    """

    names: list[str]
    erpm_per_rpm: float
    limits: dict[str, float]
    neutral_a: float
    dialect: Dialect
    chips: dict[str, str] = {}
    timeouts_s: dict[str, float] | None = None


class MotorGuard(OutputSupervisor[MotorBackend]):
    """Repeats setpoints, and puts motors at neutral when a lease ends; they stay armed."""

    def __init__(self, now_s: Callable[[], float]) -> None:
        super().__init__(now_s)
        self._sensors: list[tuple[ControllerLine[Any], VescSensor]] = []
        self._command = DriveCommand()
        self._readings: list[wire.SupervisedReading] = []
        self._next_s = self._read_s = -math.inf

    def adopt(self, opened: GuardedPorts) -> MotorBackend:
        """Take the motors, and what reads them."""
        self._sensors = [(line, VescSensor(line)) for line in opened.lines]
        return opened.motors

    def on_open(self, out: MotorBackend) -> None:
        """Ask for the first readings, and wait for each."""
        for line, sensor in self._sensors:
            if _state_of(line, sensor).reading is None and line.is_open and line.values is None:
                line.wait(ANSWER_S)
        self._read_s = -math.inf

    def follow(self, out: MotorBackend, lease: wire.Lease) -> tuple[list[Any], list[str]]:
        """Send the setpoints."""
        mode, values = lease.command
        self._command = DriveCommand(mode, values, self.end_of(lease))
        self._next_s = min(self.now_s() + PERIOD_S, self._command.until_s)
        done = out.write(self._command)
        return [done.mode, done.values], []

    def step(self, out: MotorBackend) -> float:
        """Send the newest setpoint again, or neutral after its end; ask for readings."""
        now_s = self.now_s()
        if now_s >= self._read_s:
            self._read_s = now_s + READ_PERIOD_S
            self._readings = [_state_of(*one) for one in self._sensors]
        if now_s >= self._next_s:
            self._next_s = now_s + PERIOD_S
            if out.state == "active" and self._command.until_s > now_s:
                self._next_s = min(self._next_s, self._command.until_s)
                out.write(self._command)
            else:
                out.neutral()
        return max(0.0, min(self._next_s, self._read_s) - now_s)

    def on_end(self, out: MotorBackend, hold: Callable[[float], None]) -> None:
        """Hold neutral until the motors brake."""
        for _ in range(round(RELEASE_S / PERIOD_S) + 1):
            hold(PERIOD_S)
            out.neutral()
        for _, sensor in self._sensors:
            sensor.close()

    def readings(self) -> list[wire.SupervisedReading]:
        """Return the newest readings."""
        return self._readings


def _state_of(line: ControllerLine[Any], sensor: VescSensor) -> wire.SupervisedReading:
    if sensor.state != "active":
        if not line.is_open:
            return wire.SupervisedReading(None, line.fault)
        sensor.configure()
        sensor.activate()
    reading = sensor.read()
    if isinstance(reading, Stale):
        return wire.SupervisedReading(None, reading.reason, reading.since_s)
    return wire.SupervisedReading(reading)


def open_links(links: str, settings: dict[str, Any]) -> GuardedPorts:
    """Open the controllers on a CAN bus, or at the ports to which a folder has links, in the guard's process."""
    known = msgspec.convert(settings, ensure_type_info(ControllerSettings))
    if links.startswith(PREFIX):
        return guard_lines(known, can_lines(known, links))
    watch = PortWatch(partial(list_links, Path(links)))
    return open_ports(known, MotorPorts(watch, SerialPort, time.monotonic, known.chips))


def open_ports(
    known: ControllerSettings, ports: MotorPorts, now_s: Callable[[], float] = time.monotonic
) -> GuardedPorts:
    """Return the motors and what reads them, not configured."""
    lines = [
        VescLine(name, partial(ports.open_port, name), now_s, known.erpm_per_rpm, known.dialect) for name in known.names
    ]
    return guard_lines(known, lines, ports.poll)


def guard_lines(
    known: ControllerSettings, lines: Sequence[ControllerLine[Any]], poll: Callable[[], Mapping[str, str]] = dict
) -> GuardedPorts:
    """Return the motors of these controllers, and what reads them; see `VescMotors`."""
    motors = VescMotors(lines, known.limits, known.neutral_a, poll=poll, timeouts_s=known.timeouts_s)
    return GuardedPorts(motors, lines)


def can_lines(known: ControllerSettings, bus: str, now_s: Callable[[], float] = time.monotonic) -> list[CanLine]:
    """Return the lines of all motors on a CAN bus, in their order, by the numbers that `known.chips` has.

    Raises:
        ParameterError: a motor has no number there, or two.
    """
    shared = SharedCan(partial(CanBus, bus))
    lines = []
    for name in known.names:
        numbers = [chip for chip, motor in known.chips.items() if motor == name]
        if len(numbers) != 1 or not numbers[0].isdecimal():
            raise ParameterError(
                f"[vesc] in the file of ports has {', '.join(numbers) or 'nothing'} for {name} on {bus}.",
                fix=f'the number of its controller on the bus, as VESC Tool shows it: "7" = "{name}".',
            )
        lines.append(CanLine(name, shared, int(numbers[0]), now_s, known.erpm_per_rpm))
    return lines


def run(line: Connection) -> int:
    """Run the process."""
    return serve(line, MotorGuard(time.monotonic))
