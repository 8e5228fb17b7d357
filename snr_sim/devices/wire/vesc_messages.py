"""Messages of VESC motor controllers: values in SI and radians of the wheel, and the bytes of a frame's payload.

Ids above 9 are not the same everywhere. A controller speaks one of two dialects, and nothing else is sent to it:

    stock    VESC firmware 3 to 6
    seed     an old library of 2.x with ids of its own; in VESC firmware they mean other things: 10 is a brake

Source: VESC firmware, `datatypes.h` (ids, faults) and `commands.c` (fields) of versions 2.18 and 3 to 6.
"""

from __future__ import annotations

import math
import struct
from typing import Any, Literal, TypeAlias

import msgspec

from snr_sim.prelude.errors import CommandError, DeviceError

Dialect: TypeAlias = Literal["stock", "seed"]

BAUD = 115_200
# By number. Those that are not listed are `fault_<number>`.
FAULTS = (
    "none", "over_voltage", "under_voltage", "drv", "over_current", "fet_hot", "motor_hot",
    "gate_driver_over_voltage", "gate_driver_under_voltage", "mcu_under_voltage", "watchdog_reset", "encoder",
)  # fmt: skip
_CHIP_BYTES = 12
STEPS_PER_TURN = 6  # of the commutation, which the controller counts, in a turn of the field
_DEGREES_PER_RAD = 180.0 / math.pi


class GetFirmware(msgspec.Struct, frozen=True):
    """To the controller: `Firmware` answers."""


class Firmware(msgspec.Struct, frozen=True):
    """From the controller: its identity."""

    major: int
    minor: int
    hardware: str = ""
    chip: bytes = b""  # the number of its processor, which no other has; versions before 2.18 lack it


class GetValues(msgspec.Struct, frozen=True):
    """To the controller: `MotorValues` answers."""


class MotorValues(msgspec.Struct, frozen=True):
    """From the controller: the state of its motor; `MotorReading` has what they mean."""

    current_a: float
    battery_a: float
    duty: float
    speed_radps: float
    voltage_v: float
    turned_rad: float
    temperature_c: float  # of its hottest transistor
    fault: str  # one of `FAULTS`


class SetDuty(msgspec.Struct, frozen=True):
    """To the controller: this part of the battery's voltage, -1 to 1. As all that follow, until its timeout."""

    duty: float


class SetCurrent(msgspec.Struct, frozen=True):
    """To the controller: this current through the motor, positive forward."""

    current_a: float


class SetBrake(msgspec.Struct, frozen=True):
    """To the controller: brake with this current."""

    current_a: float


class SetSpeed(msgspec.Struct, frozen=True):
    """To the controller: this speed of the wheel."""

    speed_radps: float


class SetPosition(msgspec.Struct, frozen=True):
    """To the controller: this angle of its encoder."""

    position_rad: float


class SetHandbrake(msgspec.Struct, frozen=True):
    """To the controller, dialect stock: hold the rotor where it is with this current."""

    current_a: float


class Alive(msgspec.Struct, frozen=True):
    """To the controller, dialect stock: extends the last command, so repeating it defeats the timeout."""


class ForwardCan(msgspec.Struct, frozen=True):
    """To the controller, dialect stock: a payload for another one on its CAN bus."""

    controller: int  # 0 to 255
    payload: bytes


class SetRotorPositionMode(msgspec.Struct, frozen=True):
    """To the controller, dialect seed: how it measures the rotor's position."""

    mode: int


class GetRotorPosition(msgspec.Struct, frozen=True):
    """To the controller, dialect seed: `RotorPosition` answers."""


class RotorPosition(msgspec.Struct, frozen=True):
    """From the controller, dialect seed: angle of the rotor."""

    position_rad: float


class Subscription(msgspec.Struct, frozen=True):
    """Dialect seed. To a device, with any text: ask for its name. From a device: the key of the pages that it takes."""

    name: str


VescMessage: TypeAlias = (
    GetFirmware | Firmware | GetValues | MotorValues | SetDuty | SetCurrent | SetBrake | SetSpeed | SetPosition
    | SetHandbrake | Alive | ForwardCan | SetRotorPositionMode | GetRotorPosition | RotorPosition | Subscription
)  # fmt: skip

# A request without a body and its answer have one id.
_BOTH: dict[type[Any], int] = {
    GetFirmware: 0, Firmware: 0, GetValues: 4, MotorValues: 4,
    SetDuty: 5, SetCurrent: 6, SetBrake: 7, SetSpeed: 8, SetPosition: 9,
}  # fmt: skip
_IDS: dict[Dialect, dict[type[Any], int]] = {
    "stock": _BOTH | {SetHandbrake: 10, Alive: 30, ForwardCan: 34},
    "seed": _BOTH | {SetRotorPositionMode: 10, GetRotorPosition: 21, RotorPosition: 21, Subscription: 36},
}
# Messages of one number: its format in `struct`, and the units of the wire in one of ours. That of SetSpeed depends on
# the motor.
_NUMBERS: dict[type[Any], tuple[str, float]] = {
    SetDuty: (">i", 1e5),
    SetCurrent: (">i", 1e3),
    SetBrake: (">i", 1e3),
    SetPosition: (">i", 1e6 * _DEGREES_PER_RAD),
    SetHandbrake: (">i", 1e3),
    SetRotorPositionMode: (">b", 1.0),
    RotorPosition: (">i", 1e5 * _DEGREES_PER_RAD),
}
# Of MotorValues: how many temperatures of transistors come first, and the format of the whole. Left out: other
# temperatures, currents of the field's axes, charge and energy, the count without signs, and what follows the fault.
_OLD_VALUES = (6, struct.Struct(">6h2x ii hih 16x i4x B"))
_VALUES = (1, struct.Struct(">h2x ii8x hih 16x i4x B"))
_LAYOUTS = {2: _OLD_VALUES, 3: _VALUES, 4: _VALUES, 5: _VALUES, 6: _VALUES}  # by the firmware's major version


class VescCodec:
    """Conversion between the messages of one controller and payloads.

    Args:
        dialect: of the controller.
        erpm_per_rpm: turns of the motor's field in a turn of the wheel: pole pairs times gear ratio.

    Attributes:
        unknown: payloads of an id or length that is unknown here, or of values in an unknown layout.
    """

    def __init__(self, dialect: Dialect, erpm_per_rpm: float) -> None:
        self.unknown: int = 0
        self._dialect = dialect
        self._ids = _IDS[dialect]
        self._kinds = {(number, bool(kind.__struct_fields__)): kind for kind, number in self._ids.items()}
        turns_per_rad = erpm_per_rpm / (2.0 * math.pi)
        self._numbers = _NUMBERS | {SetSpeed: (">i", 60.0 * turns_per_rad)}
        # Of MotorValues, in the order of its fields and of the bytes.
        self._scales = (100.0, 100.0, 1000.0, 60.0 * turns_per_rad, 10.0, STEPS_PER_TURN * turns_per_rad)
        self._layout = _OLD_VALUES if dialect == "seed" else None

    def set_firmware(self, firmware: Firmware, name: str) -> None:
        """Choose the layout of `MotorValues`; in the dialect stock they are unknown before.

        Raises:
            DeviceError: the firmware is unknown here. It names the controller by `name`.
        """
        layout = _LAYOUTS.get(firmware.major)
        if layout is None:
            raise DeviceError(
                f"{name} has VESC firmware {firmware.major}.{firmware.minor}, whose values have an unknown layout: "
                f"those of {min(_LAYOUTS)}.x to {max(_LAYOUTS)}.x are known.",
                fix="install a known version, or add this one to devices/wire/vesc_messages.py.",
            )
        self._layout = layout

    def encode(self, message: VescMessage) -> bytes:
        """Return a message as a payload; a number is cut towards zero to a whole one in the units of the wire.

        Raises:
            CommandError: the dialect lacks it, or a value is not a finite number or does not fit.

        >>> VescCodec("stock", erpm_per_rpm=228.0).encode(SetSpeed(1.0)).hex(" ")  # 2177 turns of the field a minute
        '08 00 00 08 81'
        """
        number = self._ids.get(type(message))
        if number is None:
            raise CommandError(
                f"{type(message).__name__} is not a message of a controller with the dialect '{self._dialect}'.",
                fix="its id means something else there; send messages of that dialect.",
            )
        try:
            return bytes([number]) + self._pack(message)
        except (struct.error, AttributeError, TypeError, ValueError, OverflowError) as error:
            raise CommandError(
                f"This message does not fit into its bytes: {message}.", fix="send finite numbers of a motor's range."
            ) from error

    def decode(self, payload: bytes) -> VescMessage | None:
        """Return the message in a payload; None if it is unknown. Never raises.

        >>> VescCodec("seed", erpm_per_rpm=228.0).decode(b"$wheelLF")
        Subscription(name='wheelLF')
        """
        kind = self._kinds.get((payload[0], len(payload) > 1)) if payload else None
        message = self._unpack(kind, payload[1:]) if kind is not None else None
        self.unknown += message is None
        return message

    def _pack(self, message: VescMessage) -> bytes:
        if isinstance(message, MotorValues):
            return self._pack_values(message)
        if isinstance(message, Firmware):
            name = message.hardware.encode("ascii") + b"\0"
            return bytes([message.major, message.minor]) + name + message.chip
        if isinstance(message, ForwardCan):
            return bytes([message.controller]) + message.payload
        if isinstance(message, Subscription):
            return message.name.encode("ascii")
        fields = msgspec.structs.astuple(message)
        if not fields:
            return b""
        code, scale = self._numbers[type(message)]
        return struct.pack(code, cut(fields[0] * scale))

    def _unpack(self, kind: type[Any], body: bytes) -> VescMessage | None:
        if kind is MotorValues:
            return self._unpack_values(body)
        if kind is Firmware:
            name, _, rest = body[2:].partition(b"\0")
            return Firmware(body[0], body[1], _text(name), rest[:_CHIP_BYTES]) if len(body) >= 2 else None
        if kind is ForwardCan:
            return ForwardCan(body[0], body[1:])
        if kind is Subscription:
            return Subscription(_text(body.partition(b"\0")[0]))
        fields: list[Any] = []
        if body:
            code, scale = self._numbers[kind]
            if len(body) != struct.calcsize(code):
                return None
            (packed,) = struct.unpack(code, body)
            fields.append(packed if kind is SetRotorPositionMode else packed / scale)
        message: VescMessage = kind(*fields)
        return message

    def _pack_values(self, values: MotorValues) -> bytes:
        if self._layout is None:
            raise CommandError("The layout of values depends on the firmware.", fix="call set_firmware() first.")
        temperatures, layout = self._layout
        *numbers, temperature_c, fault = msgspec.structs.astuple(values)
        packed = [cut(number * scale) for number, scale in zip(numbers, self._scales, strict=True)]
        return layout.pack(*[cut(temperature_c * 10.0)] * temperatures, *packed, FAULTS.index(fault))

    def _unpack_values(self, body: bytes) -> MotorValues | None:
        if self._layout is None or len(body) < self._layout[1].size:
            return None
        temperatures, layout = self._layout
        packed = layout.unpack_from(body)
        *numbers, fault = packed[temperatures:]
        fields: list[Any] = [number / scale for number, scale in zip(numbers, self._scales, strict=True)]
        fields += [max(packed[:temperatures]) / 10.0, FAULTS[fault] if fault < len(FAULTS) else f"fault_{fault}"]
        return MotorValues(*fields)


def cut(scaled: float) -> int:
    """Return a number in the units of the wire as a whole one, cut towards zero; raise an error if it is not finite."""
    # Rounding first: 0.57 * 1e5 is less than 57000 by an error in the last bit, and would lose one.
    return math.trunc(round(scaled, 6))


def _text(raw: bytes) -> str:
    return raw.decode("ascii", "replace")
