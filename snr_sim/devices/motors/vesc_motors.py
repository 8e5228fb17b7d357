"""The motors of a vehicle behind VESC controllers: all driven by one actuator, each read by a sensor.

Without commands a controller brakes by its own timeout. One whose port is gone stops the others, or not, as is chosen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

from snr_sim.devices.motors.controller_line import ControllerLine
from snr_sim.devices.motors.motor_backend import MotorBackend
from snr_sim.devices.motors.vesc_line import ANSWER_S
from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.ground_signals import DriveCommand, MotorReading
from snr_sim.prelude.life_cycle import LifeCycleSensor

FRESH_S = ANSWER_S
RETRY_S = 1.0  # between two attempts to open a lost controller
_MESSAGES: dict[str, Callable[[float], vesc.VescMessage]] = {
    "speed": vesc.SetSpeed,
    "current": vesc.SetCurrent,
    "brake": lambda current_a: vesc.SetBrake(abs(current_a)),
    "duty": vesc.SetDuty,
    "off": lambda _: vesc.SetCurrent(0.0),
}


class VescMotors(MotorBackend):
    """The motors.

    Args:
        lines: their controllers, in the order of a command's values.
        limits: see `MotorBackend`.
        neutral_a: current of the brake.
        on_lost_wheel: what follows when a controller's port is gone. "neutral": all brake, in the state "error", until
            `configure` has found all of them and `activate` was called. "continue": the others are driven; the lost
            one is opened again by a command for neutral.
        poll: returns the names of controllers whose ports must be closed, and why: see `MotorPorts.poll`.
        timeouts_s: measured timeouts by chip number; motors whose controller has none are not armed. None: all are.
    """

    title = "The motors' controllers"

    def __init__(
        self,
        lines: Sequence[ControllerLine[Any]],
        limits: Mapping[str, float],
        neutral_a: float,
        on_lost_wheel: Literal["neutral", "continue"] = "neutral",
        poll: Callable[[], Mapping[str, str]] = dict,
        timeouts_s: Mapping[str, float] | None = None,
    ) -> None:
        super().__init__(lines[0].now_s, len(lines), limits)
        self._lines, self._neutral_a = tuple(lines), neutral_a
        self._stops_all, self._poll = on_lost_wheel == "neutral", poll
        self._timeouts_s = timeouts_s
        self._unsent = 0
        self._opened_s = -math.inf

    def write(self, command: DriveCommand) -> DriveCommand:
        """Do what a command says; see `MotorBackend`. One for neutral opens lost controllers again."""
        done = super().write(command)
        now_s = self._now_s()
        if self.state == "active" and not command.values and now_s >= self._opened_s + RETRY_S:
            self._opened_s = now_s
            self._open_all()
        return done

    def put(self, command: DriveCommand, until_s: float) -> bool:
        """Send each controller its part of a command; the lease is that of the controllers themselves."""
        self._close_lost()
        message_of = _MESSAGES[command.mode]
        return self._send([message_of(value) for value in command.values])

    def brake(self) -> None:
        """Send the brake of neutral; after `close` there is nothing left to send it to."""
        self._close_lost()
        self._send([vesc.SetBrake(self._neutral_a)] * len(self._lines))

    def _send(self, messages: Sequence[vesc.VescMessage]) -> bool:
        """Send each controller its message; return whether it stays at that, or a lost one stops all."""
        fault = ""
        for line, message in zip(self._lines, messages, strict=True):
            try:
                line.send(message)
            except DeviceError as error:  # the line keeps it as its fault
                self._unsent += 1
                fault = fault or error.message
        if not (fault and self._stops_all):
            return True
        if self.state == "active":
            self.fail(fault)
        return False

    def _close_lost(self) -> None:
        lost = self._poll()
        for line in self._lines:
            if line.name in lost:
                line.drop(lost[line.name])

    def counts(self) -> dict[str, int]:
        """Return the counters: 'unsent' messages."""
        return {"unsent": self._unsent}

    def on_configure(self) -> None:
        """Open all controllers, at neutral; raise one error for those that are lost when all others are open."""
        errors = self._open_all()
        self.neutral()
        if errors:
            raise DeviceError(" ".join(error.message for error in errors), fix=errors[0].fix) from errors[0]

    def on_activate(self) -> None:
        """Open those that were lost since; one that is still lost counts as one that is lost now.

        Raises:
            DeviceError: the timeout of a controller has not been measured.
        """
        self._open_all()
        for line in self._lines:
            if self._timeouts_s is not None and line.is_open and line.chip not in self._timeouts_s:
                raise DeviceError(
                    f"{line.title} (chip {line.chip}) was never seen to stop its motor without commands.",
                    fix="snr io --io ports:FILE --check-timeout; or --option unproven=yes, with the wheels in the air.",
                )

    def _open_all(self) -> list[DeviceError]:
        errors: list[DeviceError] = []
        for line in self._lines:
            try:
                line.open(self)
            except DeviceError as error:
                errors.append(error)
        return errors

    def on_close(self) -> None:
        """Release the controllers."""
        for line in self._lines:
            line.release(self)


class VescSensor(LifeCycleSensor):
    """State of one motor, by its controller. Implements `Sensor`; reads `MotorReading`.

    It is stale while the controller is silent, and while it has switched the motor off because of a fault.
    """

    def __init__(self, line: ControllerLine[Any]) -> None:
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
