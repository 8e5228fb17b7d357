"""The promise of everything with a wire. Simulated, real and replayed devices all look like this.

Readings and commands are frozen records whose field names carry units. The loops of `devices/loops.py` turn
readings into pages and pages into commands; nothing downstream can tell which device was behind them.
"""

from __future__ import annotations

from typing import Protocol, TypeVar, runtime_checkable

ReadingT = TypeVar("ReadingT", covariant=True)
CommandT = TypeVar("CommandT")


@runtime_checkable
class Sensor(Protocol[ReadingT]):
    """Measures the world."""

    def read(self) -> ReadingT:
        """Returns the newest reading, never None.

        A reading is a frozen msgspec Struct; its fields are what the page holds.

        Raises:
            SensorLost: there is none.
        """
        ...

    def close(self) -> None:
        """Lets go of the wire. Safe to call twice."""
        ...


@runtime_checkable
class Actuator(Protocol[CommandT]):
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
        """Applies a command and returns it as applied, after clamping.

        Raises:
            CommandError: a value is NaN or infinite. The actuator keeps what it had.
        """
        ...

    def neutral(self) -> None:
        """Stops pushing. Always safe, at any time, also twice and after `close`."""
        ...

    def close(self) -> None:
        """Goes to neutral and lets go of the wire. Safe to call twice."""
        ...
