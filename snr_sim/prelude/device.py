"""The promise of everything with a wire. Simulated, emulated, real and replayed devices all look like this.

    open (an object)  --configure-->  inactive  --activate-->  active  --deactivate-->  inactive  --close-->  closed
                                         an error at any time: state "error"; configure begins anew

Readings and commands are frozen records whose field names carry units. The loops of `devices/` turn readings into
pages and pages into commands; nothing downstream can tell which device was behind them. The names of the life cycle
are those of ros2_control; `prelude/life_cycle.py` is a class to derive from that keeps it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeAlias, TypeVar, runtime_checkable

import msgspec

from snr_sim.prelude.signals import (
    AppliedPulses,
    DepthReading,
    EchoReading,
    ImuReading,
    PowerReading,
)

ReadingT = TypeVar("ReadingT", covariant=True)
CommandT = TypeVar("CommandT")

LEASE_S = 0.2  # how long a command counts at outputs that watch for themselves (shared with the firmware)


class Health(msgspec.Struct, frozen=True):
    """How a device is.

    Args:
        state: 'unconfigured', 'inactive', 'activating', 'active', 'error' or 'closed'.
        why: in words, if it is not as it should be.
        counts: what has been counted since it was opened, such as 'crc_errors'.
    """

    state: str
    why: str = ""
    counts: dict[str, int] = {}


class Stale(msgspec.Struct, frozen=True):
    """What a sensor answers that has no fresh reading; it may have one the next time.

    Args:
        why: in words, with the port or address, and what to look at.
        since_s: when the newest good reading was measured; None if there has been none.
    """

    why: str
    since_s: float | None = None


@runtime_checkable
class Device(Protocol):
    """Anything with a wire."""

    def configure(self) -> None:
        """Open the wire, asks who is there, tests. Outputs are off or neutral afterwards. Safe to call twice.

        Raises:
            DeviceError: nobody is there, or somebody else.
        """
        ...

    def activate(self) -> None:
        """Start measuring, or let outputs follow commands. Only after `configure`. Safe to call twice.

        Raises:
            DeviceError: it is not configured.
        """
        ...

    def deactivate(self, reason: str) -> None:
        """Go to neutral now. Never raises; safe at any time, also twice and after `close`."""
        ...

    def health(self) -> Health:
        """Return how it is, without asking the wire."""
        ...

    def close(self) -> None:
        """Go to neutral and let go of the wire. Never raises; safe to call twice."""
        ...


@runtime_checkable
class Sensor(Device, Protocol[ReadingT]):
    """Measures the world."""

    def read(self) -> ReadingT | Stale:
        """Return the newest reading, or `Stale` if there is no fresh one; never None.

        A reading is a frozen msgspec Struct with its time `stamp_s`; its fields are what the page holds.

        Raises:
            SensorLost: there will be none any more, as after `close`.
        """
        ...


@runtime_checkable
class Actuator(Device, Protocol[CommandT]):
    """Acts on the world. Clamps every command to limits it declares."""

    @property
    def command_type(self) -> type[CommandT]:
        """The frozen msgspec Struct that `write` takes; a page's data is checked against it."""
        ...

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value of each field of a command."""
        ...

    def write(self, command: CommandT) -> CommandT:
        """Apply a command and return it as applied, after clamping.

        Raises:
            CommandError: a value is NaN or infinite. The actuator keeps what it had.
        """
        ...

    def neutral(self) -> None:
        """Stop pushing. Always safe, at any time, also twice and after `close`."""
        ...


@runtime_checkable
class PwmOut(Device, Protocol):
    """Servo pulses on several channels, for speed controllers and servos.

    `activate` arms: outputs follow commands once it is done, which may take as long as the speed controllers take to
    start ('activating' until then); it is refused or waits while the last command was not neutral.
    """

    @property
    def channels(self) -> int:
        """How many outputs it has."""
        ...

    @property
    def limits_us(self) -> tuple[float, float]:
        """Shortest and longest pulse that it makes."""
        ...

    @property
    def resolution_us(self) -> float:
        """Pulses are whole multiples of this; 0 if they are exact."""
        ...

    @property
    def fails_safe_alone(self) -> bool:
        """Whether its outputs go to neutral when this program is killed. If not, only a supervisor may hold it."""
        ...

    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        """Ask for pulses; return those that are made, as far as is known here, and why they differ.

        After `activate` none are followed until a command for neutral has come.

        What is no pulse (NaN, infinity, None, text, too few or too many) makes all neutral; it never raises, for the
        loop that writes must go on.

        Args:
            pulses_us: one per channel: 1500 stops, 1900 is full ahead, 1100 full astern.
            stamp_s: when the command was computed, by the node's clock. The lease counts from then.
            lease_s: how long it counts, `LEASE_S` at most; after that outputs are neutral unless a newer one has come.
        """
        ...

    def stop(self) -> None:
        """Emergency stop: neutral, and `activate` is refused until `clear_stop`. Never raises."""
        ...

    def clear_stop(self) -> None:
        """End an emergency stop; outputs stay neutral until `activate`. Never raises."""
        ...


Imu: TypeAlias = Sensor[ImuReading]
DepthSensor: TypeAlias = Sensor[DepthReading]
RangeSensor: TypeAlias = Sensor[EchoReading]
PowerMonitor: TypeAlias = Sensor[PowerReading]
