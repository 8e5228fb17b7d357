"""Devices without hardware and a plant without physics, which return what a test sets. They meet their contracts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Generic, TypeVar

import msgspec

from snr_sim.devices.commands import SimActuator
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import SensorLostError, UnknownNameError, suggest
from snr_sim.prelude.life_cycle import LifeCycle

ReadingT = TypeVar("ReadingT")
CommandT = TypeVar("CommandT", bound=msgspec.Struct)


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


class FakeActuator(SimActuator[CommandT]):
    """Actuator that keeps its commands in a list. Implements `Actuator`.

    Args:
        command_type: a frozen msgspec Struct.
        limits: minimum and maximum of each of its fields that is a number, or of each number in a list.
    """

    def __init__(self, command_type: type[CommandT], limits: Mapping[str, tuple[float, float]]) -> None:
        super().__init__(FakePlant({}, ("command",)), "command", command_type, dict(limits))
        self.title = "This fake actuator"
        self.written: list[CommandT] = []  # as applied, after clamping
        self.neutral_count: int = 0
        self.is_neutral: bool = True

    @property
    def is_closed(self) -> bool:
        """Whether it has been closed."""
        return self.state == "closed"

    def write(self, command: CommandT) -> CommandT:
        """Clamp a command, keep it, and return it; raises as that of `SimActuator`."""
        applied = super().write(command)
        self.written.append(applied)
        self.is_neutral = False
        return applied

    def neutral(self) -> None:
        """Count that it was put at neutral."""
        self.neutral_count += 1
        self.is_neutral = True


class FakePlant:
    """Plant whose outputs a test sets; only its time advances. Implements `Plant`.

    Args:
        outputs: the value of each output, a frozen msgspec Struct; a field `stamp_s` becomes the time of reading.
        inputs: names that `write` accepts.
    """

    engine = "fake"
    step_s: float | None = None

    def __init__(self, outputs: Mapping[str, Any], inputs: tuple[str, ...] = ()) -> None:
        self.held: dict[str, Any] = dict(outputs)
        self.inputs: tuple[str, ...] = inputs
        self.written: list[tuple[str, Any]] = []
        self.time_s: float = 0.0

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
