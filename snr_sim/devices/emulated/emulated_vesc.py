"""An emulated motor controller with VESC firmware: bytes in, bytes out, at times that the caller states.

    driver --> serial line --> EmulatedVesc --> motor of a plant, or of a bench
           <-- answers --------'            <-- its reading

Owns no port and no clock, so it can run in lock step with a plant as well as behind a pseudo terminal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from hashlib import sha256
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

import msgspec

from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.devices.wire.vesc_frames import VescFrames, encode
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.ground_signals import NEUTRAL_BRAKE_A, DriveMode, MotorReading

FaultKind: TypeAlias = Literal["mute", "garbage", "slow", "wrong_name", "brown_out", "motor"]

_TEMPERATURE_C = 25.0  # nothing here warms up
_CHIP_BYTES = 12
_FIRMWARE: dict[vesc.Dialect, str] = {"seed": "2.18", "stock": "5.3"}
_MODES: dict[type[Any], DriveMode] = {
    vesc.SetDuty: "duty",
    vesc.SetCurrent: "current",
    vesc.SetBrake: "brake",
    vesc.SetHandbrake: "brake",
    vesc.SetSpeed: "speed",
}


class DrivenMotor(Protocol):
    """A motor that a controller drives."""

    def drive(self, mode: DriveMode, value: float) -> None:
        """Do this from now on; `DriveCommand` has the modes and their units."""
        ...

    def read(self) -> MotorReading | Stale:
        """Return its state; stale if its controller is broken, so that it does not answer."""
        ...


class ScriptedFault(NamedTuple):
    """A fault of the controller, from one time until another.

    mute: it sends nothing. garbage: all its bytes are inverted. slow: it answers `delay_s` later. wrong_name: its name
    is `text`. brown_out: it has no power, so it receives and sends nothing, and starts again without a command. motor:
    it lets the motor turn freely, and reports the fault `text`.
    """

    kind: FaultKind
    from_s: float
    until_s: float
    delay_s: float = 0.0
    text: str = ""


class EmulatedVesc:
    """The controller.

    Args:
        motor: what it drives.
        name: its answer to a `Subscription`, and what its chip number is made from.
        erpm_per_rpm: see `VescCodec`.
        dialect: see `vesc_messages.py`.
        firmware: its version; with one whose values have an unknown layout it reports none.
        timeout_s: how long it follows a command; then it brakes.
        faults: what goes wrong.

    Attributes:
        ignored: intact payloads that it does not act on.
    """

    def __init__(
        self,
        motor: DrivenMotor,
        name: str,
        erpm_per_rpm: float,
        dialect: vesc.Dialect = "stock",
        firmware: str = "5.3",
        timeout_s: float = 0.25,
        faults: Sequence[ScriptedFault] = (),
    ) -> None:
        self.ignored: int = 0
        self._motor, self._name, self._timeout_s, self._faults = motor, name, timeout_s, tuple(faults)
        self._frames = VescFrames()
        self._codec = vesc.VescCodec(dialect, erpm_per_rpm)
        major, minor = map(int, firmware.split("."))
        self._version = vesc.Firmware(major, minor)
        try:
            self._codec.set_firmware(self._version, name)
            self._has_values = True
        except DeviceError:
            self._has_values = False
        self._command: tuple[DriveMode, float] = ("brake", NEUTRAL_BRAKE_A)
        self._commanded_s = -math.inf
        self._applied: tuple[DriveMode, float] | None = None
        self._waiting: list[tuple[float, bytes]] = []  # answers, and when they leave

    def feed(self, data: bytes, now_s: float) -> bytes:
        """Receive bytes, which may be none; return the bytes that it sends by now."""
        if self.fault("brown_out", now_s) is None:
            slow = self.fault("slow", now_s)
            for payload in self._frames.feed(data, now_s):
                message = self._codec.decode(payload)
                answer = self.follow(message, now_s)
                if answer is not None:
                    self._waiting.append((now_s + (slow.delay_s if slow else 0.0), encode(self._codec.encode(answer))))
        return self.tick(now_s)

    def tick(self, now_s: float) -> bytes:
        """Let time pass: brake after the timeout. Return the bytes that it sends by now."""
        if self.fault("brown_out", now_s) is not None:
            self._frames, self._commanded_s, self._waiting = VescFrames(), -math.inf, []
        state = self._state(now_s)
        if state != self._applied:
            self._applied = state
            self._motor.drive(*state)
        sent = b"".join(answer for due_s, answer in self._waiting if due_s <= now_s)
        self._waiting = [(due_s, answer) for due_s, answer in self._waiting if due_s > now_s]
        if self.fault("mute", now_s) is not None:
            return b""
        return bytes(~byte & 0xFF for byte in sent) if self.fault("garbage", now_s) is not None else sent

    def fault(self, kind: FaultKind, now_s: float) -> ScriptedFault | None:
        """Return the fault of a kind that it has now; None if it has none."""
        if not self._faults:  # it is asked for five times in each step of a plant
            return None
        return next((one for one in self._faults if one.kind == kind and one.from_s <= now_s < one.until_s), None)

    def _state(self, now_s: float) -> tuple[DriveMode, float]:
        """Return what the motor does now."""
        if self.fault("brown_out", now_s) is not None or self.fault("motor", now_s) is not None:
            return "off", 0.0
        return ("brake", NEUTRAL_BRAKE_A) if now_s - self._commanded_s > self._timeout_s else self._command

    def follow(self, message: vesc.VescMessage | None, now_s: float) -> vesc.VescMessage | None:
        """Act on a message, whichever wire brought it; return the answer. A motor does it after the next `tick`."""
        wrong = self.fault("wrong_name", now_s)
        name = wrong.text if wrong else self._name
        mode = _MODES.get(type(message))
        if mode is not None and message is not None:
            self._command, self._commanded_s = (mode, msgspec.structs.astuple(message)[0]), now_s
        elif isinstance(message, vesc.Alive):
            self._commanded_s = now_s
        elif isinstance(message, vesc.GetFirmware):
            chip = sha256(name.encode()).digest()[:_CHIP_BYTES]
            return vesc.Firmware(self._version.major, self._version.minor, "emulated", chip)
        elif isinstance(message, vesc.Subscription):
            return vesc.Subscription(name)
        elif isinstance(message, vesc.GetRotorPosition):
            reading = self._motor.read()
            return None if isinstance(reading, Stale) else vesc.RotorPosition(_angle(reading.turned_rad))
        elif isinstance(message, vesc.GetValues) and self._has_values:
            reading = self._motor.read()
            return None if isinstance(reading, Stale) else self._values(reading, now_s)
        else:
            self.ignored += 1
        return None

    def _values(self, reading: MotorReading, now_s: float) -> vesc.MotorValues:
        fault = self.fault("motor", now_s)
        return vesc.MotorValues(
            current_a=reading.current_a,
            battery_a=reading.battery_a,
            duty=reading.duty,
            speed_radps=reading.speed_radps,
            voltage_v=reading.voltage_v,
            turned_rad=reading.turned_rad,
            temperature_c=_TEMPERATURE_C,
            fault=fault.text if fault else "none",
        )


def make_controller(
    motor: DrivenMotor,
    name: str,
    erpm_per_rpm: float,
    dialect: vesc.Dialect = "stock",
    faults: Sequence[ScriptedFault] = (),
) -> EmulatedVesc:
    """Return a controller with the usual firmware of its dialect."""
    return EmulatedVesc(motor, name, erpm_per_rpm, dialect, _FIRMWARE[dialect], faults=faults)


def _angle(turned_rad: float) -> float:
    return math.remainder(turned_rad, 2.0 * math.pi)
