"""Devices without hardware and a plant without physics, which return what a test sets. They meet their contracts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, Generic, TypeVar

import msgspec

from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import CommandError, DeviceError, SensorLostError, UnknownNameError, suggest
from snr_sim.prelude.life_cycle import LifeCycle

ReadingT = TypeVar("ReadingT")
CommandT = TypeVar("CommandT")


class FakeSensor(LifeCycle, Generic[ReadingT]):
    """Sensor that returns readings from a list, then repeats the last one. Implements `Sensor`.

    Args:
        readings: in order; `Stale` stands for a moment without a reading, and an exception is raised.
    """

    title = "This fake sensor"

    def __init__(self, readings: Iterable[ReadingT | Stale | Exception]) -> None:
        self._left = list(readings)

    @property
    def is_closed(self) -> bool:
        """Whether it has been closed."""
        return self.state == "closed"

    def read(self) -> ReadingT | Stale:
        """Return the next reading.

        Raises:
            SensorLostError: the list is empty, or the sensor is closed.
        """
        if self.is_closed:
            raise SensorLostError("This sensor has been closed.", fix="call read() before close().")
        if not self._left:
            raise SensorLostError("This fake sensor has no readings.", fix="FakeSensor([reading, ...]).")
        reading = self._left.pop(0) if len(self._left) > 1 else self._left[0]
        if isinstance(reading, Exception):
            raise reading
        return reading


class FakeActuator(LifeCycle, Generic[CommandT]):
    """Actuator that keeps its commands in a list. Implements `Actuator`.

    Args:
        command_type: a frozen msgspec Struct.
        limits: minimum and maximum of each of its fields that is a number, or of each number in a list.
    """

    title = "This fake actuator"

    def __init__(self, command_type: type[CommandT], limits: Mapping[str, tuple[float, float]]) -> None:
        fields: tuple[str, ...] = getattr(command_type, "__struct_fields__", ())
        for name in limits:
            if name not in fields:
                raise CommandError(
                    f"{command_type.__name__} has no field '{name}' to limit.", fix=suggest(name, fields)
                )
        self._command_type = command_type
        self._limits = dict(limits)
        self.written: list[CommandT] = []  # as applied, after clamping
        self.neutral_count = 0
        self.is_neutral = True

    @property
    def is_closed(self) -> bool:
        """Whether it has been closed."""
        return self.state == "closed"

    @property
    def command_type(self) -> type[CommandT]:
        """Type of the commands for `write`."""
        return self._command_type

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value of each field."""
        return dict(self._limits)

    def write(self, command: CommandT) -> CommandT:
        """Clamp a command, keep it, and return it.

        Raises:
            CommandError: a value is NaN or infinite, or the command has another type than this actuator's.
            DeviceError: the actuator is closed.
        """
        if self.is_closed:
            raise DeviceError("This actuator has been closed.", fix="call write() before close().")
        if type(command) is not self._command_type:
            raise CommandError(f"{command!r} is not a {self._command_type.__name__}.")
        applied = self._clamped(command)
        self.written.append(applied)
        self.is_neutral = False
        return applied

    def _clamped(self, command: CommandT) -> CommandT:
        values: dict[str, Any] = msgspec.structs.asdict(command)  # type: ignore[arg-type]
        for name in self._limits:
            value = values[name]
            is_list = isinstance(value, (list, tuple))
            values[name] = [self._inside(name, one) for one in value] if is_list else self._inside(name, value)
        return self._command_type(**values)

    def _inside(self, name: str, value: float) -> float:
        lowest, highest = self._limits[name]
        if not math.isfinite(value):
            raise CommandError(f"Command '{name}' is {value}.", fix=f"a number from {lowest:g} to {highest:g}.")
        return min(max(value, lowest), highest)

    def neutral(self) -> None:
        """Count that it was put at neutral."""
        self.neutral_count += 1
        self.is_neutral = True

    def on_deactivate(self, reason: str) -> None:
        """Go to neutral."""
        self.neutral()

    def on_close(self) -> None:
        """Go to neutral, also if it never was active."""
        self.neutral()


class FakePlant:
    """Plant whose outputs a test sets; only its time advances. Implements `Plant`.

    Args:
        outputs: the value of each output, a frozen msgspec Struct; a field `stamp_s` becomes the time of reading.
        inputs: names that `write` accepts.
    """

    engine = "fake"
    step_s: float | None = None

    def __init__(self, outputs: Mapping[str, Any], inputs: tuple[str, ...] = ()) -> None:
        self.held = dict(outputs)
        self.inputs = inputs
        self.written: list[tuple[str, Any]] = []
        self.time_s = 0.0

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names that `read` accepts."""
        return tuple(self.held)

    def reset(self, seed: int) -> None:
        """Go back to time 0."""
        self.time_s = 0.0
        self.written.clear()

    def step(self, dt_s: float) -> None:
        """Advance the time."""
        self.time_s += dt_s

    def write(self, name: str, command: Any) -> None:
        """Keep a command in `written`."""
        if name not in self.inputs:
            raise UnknownNameError(f"This plant has no input '{name}'.", fix=suggest(name, self.inputs))
        self.written.append((name, command))

    def read(self, name: str) -> Any:
        """Return the value set."""
        if name not in self.held:
            raise UnknownNameError(f"This plant has no output '{name}'.", fix=suggest(name, self.held))
        reading = self.held[name]
        has_stamp = "stamp_s" in reading.__struct_fields__
        return msgspec.structs.replace(reading, stamp_s=self.time_s) if has_stamp else reading

    def snapshot(self) -> Any:
        """Return the time, and the values written."""
        return self.time_s, list(self.written)

    def restore(self, snapshot: Any) -> None:
        """Restore a state that `snapshot` returned."""
        self.time_s, self.written = snapshot[0], list(snapshot[1])

    def scene(self) -> dict[str, Any]:
        """Return an empty result: there is nothing to show."""
        return {"statics": {}, "bodies": {}}

    def truth(self) -> dict[str, Any]:
        """Return an empty result: there is nothing to show."""
        return {"poses": {}, "vectors": {}, "values": {}}
