"""Messages between a computer and the microcontroller that drives the speed controllers.

Their encoding is in `mcu_frames.py`; states, rules and timings are in docs/formats.md, section 8.
The other end is `robots/urov/firmware/`.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag

import msgspec

PROTOCOL = 1
BAUD = 115_200
NO_COMMAND_MS = 0xFFFF  # the age of the last command when there was none


class McuState(IntEnum):
    """State of the microcontroller."""

    STARTING = 0  # sends neutral until the speed controllers have started
    DISARMED = 1  # neutral, whatever is commanded
    ARMED = 2  # applies commands
    STOPPED = 3  # emergency stop: neutral until it is cleared


class McuFault(IntFlag):
    """Why an output differs from the command. Those marked * stay until the next `Hello`."""

    LEASE_EXPIRED = 1  # commands stopped while it was armed; until it is armed again
    STOPPED = 2  # emergency stop
    STALE = 4  # the last command was older than its lease on arrival
    REPEATED = 8  # the last command was not newer than the one before, so it extended no lease
    CLAMPED = 16  # the last command had a width outside the limits
    LIMITED = 32  # an output is still changing: slew limit, or waiting in the dead band
    BAD_LENGTH = 64  # * a frame's length did not fit its type; such a command disarms
    OTHER_SESSION = 128  # * another program uses the line
    OVERRUN = 256  # * bytes were lost before they could be read
    UNKNOWN_TYPE = 512  # * a frame of a type that this firmware does not know


class ResetCause(IntFlag):
    """Why the microcontroller started, from its register MCUSR. 0: a boot loader has cleared it."""

    POWER_ON = 1
    EXTERNAL = 2  # the reset pin: also any program that opens the port of an Arduino
    BROWN_OUT = 4
    WATCHDOG = 8  # the firmware hung


class AckResult(IntEnum):
    """Result of a request."""

    DONE = 0
    STARTING = 1  # the speed controllers have not had neutral for long enough
    NO_COMMAND = 2  # there is no command, or its lease has expired: arming needs one
    NOT_NEUTRAL = 3  # the last command is not neutral on every channel
    STOPPED = 4  # an emergency stop must be cleared first
    OTHER_SESSION = 5  # send a hello first
    OTHER_PROTOCOL = 6


class Hello(msgspec.Struct, frozen=True, tag="hello"):
    """To the microcontroller: a program starts a session. Disarms if the session is new. `Ident` answers."""

    session: int  # 1 to 65535, another one each time a program opens the port
    protocol: int = PROTOCOL


class SetWidths(msgspec.Struct, frozen=True, tag="set_widths"):
    """To the microcontroller: a command. `Telemetry` answers."""

    session: int
    seq: int  # 0 to 65535, then from 0 again
    stamp_ms: int  # when the command was computed, by the computer's clock; it may wrap at 2^32
    age_ms: int  # how long ago that was when the frame was sent
    lease_ms: int  # how long it is valid after it was computed; the firmware has an upper limit
    widths_us: tuple[float, ...]  # of each channel, in steps of 0.5


class Arm(msgspec.Struct, frozen=True, tag="arm"):
    """To the microcontroller: apply commands from now on. `CommandAck` answers this and all that follow."""

    session: int


class Disarm(msgspec.Struct, frozen=True, tag="disarm"):
    """To the microcontroller: neutral at once, and until armed again."""

    session: int


class EmergencyStop(msgspec.Struct, frozen=True, tag="emergency_stop"):
    """To the microcontroller, from any session: neutral at once, and until cleared."""

    session: int = 0


class ClearStop(msgspec.Struct, frozen=True, tag="clear_stop"):
    """To the microcontroller: clear the emergency stop. It stays disarmed."""

    session: int


class Ident(msgspec.Struct, frozen=True, tag="ident"):
    """From the microcontroller: its identity, and the limits that it applies to every command."""

    frame_count: int
    session: int
    protocol: int
    firmware: tuple[int, int]
    channels: int
    lowest_us: float
    neutral_us: float
    highest_us: float
    dead_band_us: float
    resolution_ns: int
    period_us: int
    max_lease_ms: int
    esc_start_ms: int
    slew_us_per_100ms: int
    dwell_ms: int
    mcu: str
    name: str


class Telemetry(msgspec.Struct, frozen=True, tag="telemetry"):
    """From the microcontroller: after each command, and 20 times a second without commands."""

    frame_count: int  # number of its frames, 0 to 255 and from 0 again
    session: int  # whose commands it takes; 0 if it has not received a hello since it started
    seq: int  # of the last command taken
    uptime_ms: int
    state: McuState
    faults: McuFault
    reset_cause: ResetCause
    command_age_ms: int  # since that command was computed; `NO_COMMAND_MS` if there is none
    crc_errors: int  # frames that were damaged, since it started
    battery_pin_mv: int  # at pins A0 and A1; their scale depends on the installed module
    current_pin_mv: int
    widths_us: tuple[float, ...]  # at the outputs


class CommandAck(msgspec.Struct, frozen=True, tag="answer"):
    """From the microcontroller: the result of a request."""

    frame_count: int
    session: int
    to: int  # type byte of the request, as in `TYPE_OF`
    result: AckResult


ToMcu = Hello | SetWidths | Arm | Disarm | EmergencyStop | ClearStop
FromMcu = Ident | Telemetry | CommandAck

TYPE_OF: dict[type, int] = {
    Hello: 0x01,
    SetWidths: 0x02,
    Arm: 0x03,
    Disarm: 0x04,
    EmergencyStop: 0x05,
    ClearStop: 0x06,
    Ident: 0x81,
    Telemetry: 0x82,
    CommandAck: 0x83,
}
