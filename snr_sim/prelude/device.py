"""Interfaces of all devices: simulated, emulated, real and replayed ones.

    open (an object)  --configure-->  inactive  --activate-->  active  --deactivate-->  inactive  --close-->  closed
                                         an error at any time: state "error"; configure starts again

Readings and commands are frozen records whose field names carry units. The loops of `devices/` convert readings to
pages and pages to commands; other components do not depend on the kind of device. The names of the life cycle are
those of ros2_control; derive from the class in `prelude/life_cycle.py` to implement it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar, runtime_checkable

import msgspec

from snr_sim.prelude.signals import AppliedPulses

ReadingT = TypeVar("ReadingT", covariant=True)
CommandT = TypeVar("CommandT")

LEASE_S = 0.2  # lifetime of a command at outputs with their own lease (shared with the firmware)


class Health(msgspec.Struct, frozen=True):
    """State of a device.

    Args:
        state: 'unconfigured', 'inactive', 'activating', 'active', 'error' or 'closed'.
        reason: as text, if it is not active.
        counts: counters since it was opened, such as 'crc_errors'.
    """

    state: str
    reason: str = ""
    counts: dict[str, int] = {}


class Stale(msgspec.Struct, frozen=True):
    """Result of a sensor without a fresh reading; it may have one the next time.

    Args:
        reason: as text, with the port or address, and what to check.
        since_s: when the newest good reading was measured; None if there has been none.
    """

    reason: str
    since_s: float | None = None


@runtime_checkable
class Device(Protocol):
    """A simulated or real device."""

    def configure(self) -> None:
        """Open the wire, identify the device, test it. Outputs are off or neutral afterwards. Safe to call twice.

        Raises:
            DeviceError: no device answers, or another one does.
        """

    def activate(self) -> None:
        """Start measuring, or let outputs follow commands. Only after `configure`. Safe to call twice.

        Raises:
            DeviceError: it is not configured.
        """

    def deactivate(self, reason: str) -> None:
        """Go to neutral now. Never raises; safe at any time, also twice and after `close`."""

    def health(self) -> Health:
        """Return its state, without using the wire."""

    def close(self) -> None:
        """Go to neutral and release the wire. Never raises; safe to call twice."""


@runtime_checkable
class Sensor(Device, Protocol[ReadingT]):
    """Measures a quantity."""

    def read(self) -> ReadingT | Stale:
        """Return the newest reading, or `Stale` if there is no fresh one; never None.

        A reading is a frozen msgspec Struct with its time `stamp_s`; its fields become the page's data.

        Raises:
            SensorLostError: there will be no more readings, as after `close`.
        """


@runtime_checkable
class Actuator(Device, Protocol[CommandT]):
    """Acts on the world. Clamps every command to the limits it declares."""

    @property
    def command_type(self) -> type[CommandT]:
        """The frozen msgspec Struct that `write` accepts; a page's data are checked against it."""

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value of each field of a command."""

    def write(self, command: CommandT) -> CommandT:
        """Apply a command and return it as applied, after clamping.

        Raises:
            CommandError: a value is NaN or infinite. The last applied command stays.
        """

    def neutral(self) -> None:
        """Stop the actuator. Always safe, at any time, also twice and after `close`."""


@runtime_checkable
class PwmOut(Device, Protocol):
    """Servo pulses on several channels, for speed controllers and servos.

    `activate` arms: outputs follow commands once it is done, which may take as long as the speed controllers need to
    start ('activating' until then); it raises or waits while the last command was not neutral.
    """

    @property
    def channels(self) -> int:
        """Number of outputs."""

    @property
    def limits_us(self) -> tuple[float, float]:
        """Shortest and longest pulse."""

    @property
    def resolution_us(self) -> float:
        """Step of the pulses; 0 if they are exact."""

    @property
    def has_independent_failsafe(self) -> bool:
        """Whether its outputs go to neutral when this program is killed. If not, only a supervisor may own it."""

    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        """Request pulses; return the applied ones, as far as is known here, and why they differ.

        After `activate`, outputs stay neutral until a neutral command arrives.

        An invalid pulse (NaN, infinity, None, text, wrong count) sets all to neutral and never raises, because the loop
        that writes must continue.

        Args:
            pulses_us: one per channel: 1500 stops, 1900 is full ahead, 1100 full astern.
            stamp_s: when the command was computed, by the node's clock. The lease counts from then.
            lease_s: how long it is valid, `LEASE_S` at most; then outputs go to neutral unless a newer one has arrived.
        """

    def stop(self) -> None:
        """Emergency stop: neutral, and `activate` is refused until `clear_stop`. Never raises."""

    def clear_stop(self) -> None:
        """End an emergency stop; outputs stay neutral until `activate`. Never raises."""
