"""The motors of a vehicle behind VESC controllers: all driven by one actuator, each read by a sensor.

Without commands a controller brakes by its own timeout. One that fails does not hold up the others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgspec

from snr_sim.devices.commands import check_finite
from snr_sim.devices.motors.vesc_line import ANSWER_S, VescLine
from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import CommandError, DeviceError, suggest
from snr_sim.prelude.ground_signals import DriveCommand, MotorReading
from snr_sim.prelude.life_cycle import LifeCycle, LifeCycleSensor

FRESH_S = ANSWER_S
_MESSAGES: dict[str, Callable[[float], vesc.VescMessage]] = {
    "speed": vesc.SetSpeed,
    "current": vesc.SetCurrent,
    "brake": lambda current_a: vesc.SetBrake(abs(current_a)),
    "duty": vesc.SetDuty,
    "off": lambda _: vesc.SetCurrent(0.0),
}


class VescMotors(LifeCycle):
    """The motors. Implements `Actuator`; neutral is a brake, since a rover that rolls freely drives down a slope.

    A controller whose port is gone is not driven, which its `VescSensor` reports; the others are.

    Args:
        lines: their controllers, in the order of a command's values.
        limits: largest amount of a value, for each mode but "off".
        neutral_a: current of the brake.
    """

    title = "The motors' controllers"
    command_type: type[DriveCommand] = DriveCommand

    def __init__(self, lines: Sequence[VescLine], limits: Mapping[str, float], neutral_a: float) -> None:
        self._lines, self._limits, self._neutral_a = tuple(lines), dict(limits), neutral_a
        self._mode = "speed"
        self._unsent = 0

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value in the mode of the newest command with values; "speed" before the first."""
        largest = self._limits[self._mode]
        return {"values": (-largest, largest)}

    def write(self, command: DriveCommand) -> DriveCommand:
        """Send a command, clamped to the limits, and return it as sent; while it is not active, that is neutral.

        Raises:
            CommandError: it is not a command of these motors, or a value is not a finite number. The last one stays.
            DeviceError: it was closed.
        """
        if self.state == "closed":
            raise DeviceError(f"{self.title} were closed.", fix="open them again.")
        self._check(command)
        if self.state != "active" or not command.values:
            self.neutral()
            return DriveCommand(command.mode)
        if command.mode != "off":
            self._mode = command.mode
            largest = self._limits[command.mode]
            values = [min(largest, max(-largest, value)) for value in command.values]
            command = msgspec.structs.replace(command, values=values)
        message_of = _MESSAGES[command.mode]
        for line, value in zip(self._lines, command.values, strict=True):
            self._send(line, message_of(value))
        return command

    def _check(self, command: Any) -> None:
        if type(command) is not DriveCommand:
            raise CommandError(
                f"Motors take DriveCommand, not {type(command).__name__}.", fix="DriveCommand('speed', [...])."
            )
        if command.mode not in _MESSAGES:
            raise CommandError(f"Motors have no mode '{command.mode}'.", fix=suggest(command.mode, _MESSAGES))
        if command.values and len(command.values) != len(self._lines):
            raise CommandError(
                f"'drive' has {len(command.values)} values, and there are {len(self._lines)} motors.",
                fix="send one for each, in the order of the wheels, or none for neutral.",
            )
        largest = self._limits.get(command.mode, math.inf)
        for i, value in enumerate(command.values):
            check_finite(f"drive.values[{i}]", value, (-largest, largest))

    def _send(self, line: VescLine, message: vesc.VescMessage) -> None:
        try:
            line.send(message)
        except DeviceError:  # the line keeps it as its fault
            self._unsent += 1

    def neutral(self) -> None:
        """Brake, also after `close`, when there is nothing left to send it to."""
        for line in self._lines:
            self._send(line, vesc.SetBrake(self._neutral_a))

    def counts(self) -> dict[str, int]:
        """Return the counters: 'unsent' messages."""
        return {"unsent": self._unsent}

    def on_configure(self) -> None:
        """Open all controllers, and brake."""
        for line in self._lines:
            line.open(self)
        self.neutral()

    def on_deactivate(self, reason: str) -> None:
        """Brake."""
        self.neutral()

    def on_close(self) -> None:
        """Release the controllers."""
        for line in self._lines:
            line.release(self)


class VescSensor(LifeCycleSensor):
    """State of one motor, by its controller. Implements `Sensor`; reads `MotorReading`.

    It is stale while the controller is silent, and while it has switched the motor off because of a fault.
    """

    def __init__(self, line: VescLine) -> None:
        self._line = line
        self.title: str = line.title

    def read(self) -> MotorReading | Stale:
        """Return the newest reading, and ask for the next; raise a SensorLostError if it was closed."""
        line = self._line
        idle = self.idle(line.measured_s)
        if idle is not None:
            return idle
        try:
            line.update()
        except DeviceError as error:
            return Stale(error.message, line.measured_s)
        values, measured_s = line.values, line.measured_s
        if values is None or measured_s is None or line.now_s() - measured_s > FRESH_S:
            sent = f"{line.junk_bytes} bytes that are not its answer" if line.junk_bytes else "nothing"
            return Stale(f"{self.title} sends {sent}. Does it have power, and is its cable in?", measured_s)
        if values.fault != vesc.FAULTS[0]:
            return Stale(f"{self.title} has switched its motor off: {values.fault}.", measured_s)
        return MotorReading(
            speed_radps=values.speed_radps,
            current_a=values.current_a,
            battery_a=values.battery_a,
            duty=values.duty,
            voltage_v=values.voltage_v,
            turned_rad=values.turned_rad,
            stamp_s=measured_s,
        )

    def counts(self) -> dict[str, int]:
        """Return the counters of the line."""
        return self._line.counts()

    def on_configure(self) -> None:
        """Open the controller."""
        self._line.open(self)

    def on_close(self) -> None:
        """Release the controller."""
        self._line.release(self)
