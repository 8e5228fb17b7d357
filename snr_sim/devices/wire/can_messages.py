"""Frames of a CAN bus, and those of VESC motor controllers on it: values of the wheel in SI and radians, and bytes.

    computer   --> command << 8 | controller, an extended id, and one number --> controller
               <-- 9, 16, 27 << 8 | controller: what its motor does         <--

A controller sends the three kinds of status by itself, without being asked. They do not say whether it has a fault.

Source: VESC firmware 5, `comm_can.c`: ids of `CAN_PACKET_ID`, fields of `send_status1`, `4` and `5`.
"""

from __future__ import annotations

import math
import struct
from typing import Any

import msgspec

from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.prelude.errors import CommandError, ParameterError

MAX_BYTES = 8  # of a frame
MAX_CONTROLLER = 254  # 255 is for all controllers
_STANDARD_BITS, _EXTENDED_BITS = 11, 29  # of an id
_COMMANDS = (vesc.SetDuty, vesc.SetCurrent, vesc.SetBrake, vesc.SetSpeed)  # by number
_FIRST_ID = 5  # of the same commands on a serial line, where the bytes after the id are the same
# By number: the format, and which fields of MotorValues. Left out: the motor's temperature, and what follows.
_STATUS = {
    9: (struct.Struct(">ihh"), ("speed_radps", "current_a", "duty")),
    16: (struct.Struct(">h2xh"), ("temperature_c", "battery_a")),
    27: (struct.Struct(">ih"), ("turned_rad", "voltage_v")),
}
_SCALES = {"current_a": 10.0, "duty": 1000.0, "temperature_c": 10.0, "battery_a": 10.0, "voltage_v": 10.0}


class CanFrame(msgspec.Struct, frozen=True):
    """A frame with data; a CommandError is raised for an id or a length that no frame has."""

    id: int
    data: bytes = b""
    is_extended: bool = True  # an id of 29 bits, not 11

    def __post_init__(self) -> None:
        bits = _EXTENDED_BITS if self.is_extended else _STANDARD_BITS
        if not 0 <= self.id < 1 << bits or len(self.data) > MAX_BYTES:
            raise CommandError(
                f"A CAN frame has no id {self.id:#x} with {len(self.data)} bytes.",
                fix=f"an id of {bits} bits, and {MAX_BYTES} bytes at most.",
            )

    @property
    def priority(self) -> tuple[int, bool]:
        """What decides who sends first: the lower one, by the bits as they are on the bus."""
        shift = 0 if self.is_extended else _EXTENDED_BITS - _STANDARD_BITS
        return self.id << shift, self.is_extended

    @property
    def slot(self) -> tuple[int, bool]:
        """What a newer frame replaces: one of its id; all commands to one controller have one slot.

        A brake has a lower id than a speed, so a speed that still waited would be sent after it, and drive again.
        """
        if self.is_extended and self.id >> 8 < len(_COMMANDS):
            return self.id & 0xFF, True
        return self.id, self.is_extended


class CanStatus(msgspec.Struct, frozen=True):
    """From a controller: fields of `MotorValues`, by name."""

    values: dict[str, float]


def status_controller(frame: CanFrame) -> int | None:
    """Return the number of the controller whose status a frame is; None if it is another frame."""
    return frame.id & 0xFF if frame.is_extended and frame.id >> 8 in _STATUS else None


class CanVescCodec:
    """Conversion between the messages of one controller and frames.

    Args:
        controller: its number, 0 to 254.
        erpm_per_rpm: see `VescCodec`.

    Attributes:
        unknown: frames of another id, or whose bytes are not a value of it.

    Raises:
        ParameterError: no controller has this number.
    """

    def __init__(self, controller: int, erpm_per_rpm: float) -> None:
        if not 0 <= controller <= MAX_CONTROLLER:
            raise ParameterError(
                f"No controller has the number {controller} on a CAN bus.",
                fix=f"0 to {MAX_CONTROLLER}, as VESC Tool shows it: App Settings, General, VESC ID.",
            )
        self.unknown: int = 0
        self._controller = controller
        self._codec = vesc.VescCodec("stock", erpm_per_rpm)
        turns_per_rad = erpm_per_rpm / (2.0 * math.pi)
        self._scales = _SCALES | {
            "speed_radps": 60.0 * turns_per_rad,
            "turned_rad": vesc.STEPS_PER_TURN * turns_per_rad,
        }

    def encode(self, message: vesc.VescMessage) -> CanFrame:
        """Return a command as a frame.

        Raises:
            CommandError: it is not a command to a motor, or its value is not a finite number or is out of range.

        >>> frame = CanVescCodec(7, erpm_per_rpm=228.0).encode(vesc.SetSpeed(1.0))
        >>> hex(frame.id), frame.data.hex(" ")
        ('0x307', '00 00 08 81')
        """
        if not isinstance(message, _COMMANDS) or not _is_possible(message):
            raise CommandError(
                f"This cannot be sent to a controller on a CAN bus: {message}.",
                fix="a duty of -1 to 1, a current, a brake's current or a speed, which is a finite number.",
            )
        number = _COMMANDS.index(type(message))
        return CanFrame(number << 8 | self._controller, self._codec.encode(message)[1:])

    def encode_status(self, values: vesc.MotorValues) -> list[CanFrame]:
        """Return a motor's state as the frames that a controller sends; raise a CommandError if it does not fit."""
        frames = []
        for number, (layout, names) in _STATUS.items():
            try:
                data = layout.pack(*(vesc.cut(getattr(values, name) * self._scales[name]) for name in names))
            except (struct.error, ValueError, OverflowError) as error:
                raise CommandError(
                    f"This does not fit into the bytes of a status: {values}.", fix="finite numbers of a motor's range."
                ) from error
            frames.append(CanFrame(number << 8 | self._controller, data.ljust(MAX_BYTES, b"\0")))
        return frames

    def decode(self, frame: CanFrame) -> vesc.VescMessage | CanStatus | None:
        """Return the command or status in a frame; None if it is neither, or of another controller. Never raises."""
        message = self._decode(frame)
        self.unknown += message is None
        return message

    def _decode(self, frame: CanFrame) -> vesc.VescMessage | CanStatus | None:
        if not frame.is_extended or frame.id & 0xFF != self._controller:
            return None
        number = frame.id >> 8
        if number < len(_COMMANDS):
            message = self._codec.decode(bytes([_FIRST_ID + number]) + frame.data) if frame.data else None
            return message if message is not None and _is_possible(message) else None
        layout, names = _STATUS.get(number, (None, ()))
        if layout is None or len(frame.data) < layout.size:
            return None
        packed: tuple[Any, ...] = layout.unpack_from(frame.data)
        return CanStatus({name: value / self._scales[name] for name, value in zip(names, packed, strict=True)})


def _is_possible(message: vesc.VescMessage) -> bool:
    return not isinstance(message, vesc.SetDuty) or abs(message.duty) <= 1.0  # not if it is NaN
