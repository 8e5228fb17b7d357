"""Simulated devices: any output of a plant as a Sensor, any input as an Actuator.

A plant returns true values and applies commands at once. These classes add the errors of real devices: the sensor
has delay, noise and steps; the actuator has limits. Both use a plant through its interface only.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import msgspec

from snr_sim.devices.sensors.sensor_errors import SensorErrorModel, SensorErrors
from snr_sim.prelude.errors import CommandError, DeviceError, ParameterError, SensorLostError, suggest
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.plant import Plant

if TYPE_CHECKING:
    import numpy as np

CommandT = TypeVar("CommandT", bound=msgspec.Struct)

SAME_TIME_S = 1e-9  # times closer than this are equal, to allow for rounding


def fields_of(kind: type[msgspec.Struct]) -> Callable[[Any], Any]:
    """Return a function that makes a struct from an object's fields of the same names, for `SimSensor`'s `measure`."""
    values_of = attrgetter(*kind.__struct_fields__)
    return lambda thing: kind(*values_of(thing))


class SimSensor(LifeCycle):
    """Reads one output of a plant, with delay and errors. Implements `Sensor`.

    Args:
        plant: the measured plant.
        output: name of the output.
        errors: of the reading.
        rng: random generator of the errors.
        measure: converts the plant's output to the measured quantity, to which the errors apply. None: as it is.
        convert: converts the measured quantity to the part's reading. None: as it is.

    Raises:
        ParameterError: the errors name a field that does not exist.

    A delayed sensor keeps its readings and returns the newest one that is old enough. So the age is `delay_s`, rounded
    up to whole periods of reading; the reading's `stamp_s` shows it. Until one is old enough, it returns the first.
    """

    def __init__(
        self,
        plant: Plant,
        output: str,
        errors: SensorErrors,
        rng: np.random.Generator,
        measure: Callable[[Any], Any] | None = None,
        convert: Callable[[Any], Any] | None = None,
    ) -> None:
        self._plant, self._output = plant, output
        self._measure, self._convert = measure, convert
        truth = plant.read(output)
        error_model = SensorErrorModel(truth if measure is None else measure(truth), errors, rng, output)
        self._error_model = error_model if errors.fields else None
        self._delay_s, self._period_s = errors.delay_s, errors.period_s
        self._past: deque[Any] = deque()
        self._newest: Any = None
        self._due_s = plant.time_s
        self.title: str = f"The simulated sensor '{output}'"

    def read(self) -> Any:
        """Return the newest reading.

        Raises:
            SensorLostError: the sensor was closed.
        """
        if self.state == "closed":
            raise SensorLostError(f"The simulated sensor '{self._output}' was closed.")
        if self._period_s == 0.0:
            return self._new_reading()
        time_s = self._plant.time_s + SAME_TIME_S
        if time_s >= self._due_s:
            self._due_s += self._period_s * (1 + (time_s - self._due_s) // self._period_s)
            self._newest = self._new_reading()
        return self._newest

    def _new_reading(self) -> Any:
        reading = self._plant.read(self._output)
        if self._delay_s > 0.0:
            reading = self._apply_delay(reading)
        if self._measure is not None:
            reading = self._measure(reading)
        if self._error_model is not None:
            reading = self._error_model.apply(reading)
        return reading if self._convert is None else self._convert(reading)

    def _apply_delay(self, reading: Any) -> Any:
        past = self._past
        past.append(reading)
        newest_s = self._plant.time_s - self._delay_s + SAME_TIME_S
        while len(past) > 1 and past[1].stamp_s <= newest_s:
            past.popleft()
        return past[0]


class SimActuator(LifeCycle, Generic[CommandT]):
    """Writes one input of a plant. Implements `Actuator`.

    Args:
        plant: the driven plant.
        input_name: name of the input.
        command_type: the struct of its commands; made without arguments it must be neutral.
        limits: lowest and highest value of each field; each number of a list is limited.
    """

    def __init__(
        self, plant: Plant, input_name: str, command_type: type[CommandT], limits: dict[str, tuple[float, float]]
    ) -> None:
        for name in limits:
            if name not in command_type.__struct_fields__:
                raise ParameterError(
                    f"{command_type.__name__} has no field '{name}'.", fix=suggest(name, command_type.__struct_fields__)
                )
        self._plant, self._input = plant, input_name
        self.command_type: type[CommandT] = command_type
        self.limits: dict[str, tuple[float, float]] = dict(limits)
        self.title: str = f"The simulated actuator '{input_name}'"

    def write(self, command: CommandT) -> CommandT:
        """Apply a command, clamped to the limits, and return it as applied.

        Raises:
            CommandError: it is not a command of this actuator, or a value is not a finite number. The last applied
                command stays.
        """
        if self.state == "closed":
            raise DeviceError(f"The simulated actuator '{self._input}' was closed.", fix="open it again.")
        if type(command) is not self.command_type:
            expected = self.command_type
            raise CommandError(
                f"'{self._input}' takes {expected.__name__}, not {type(command).__name__}.",
                fix=f"send {expected.__name__}({', '.join(expected.__struct_fields__)}).",
            )
        changed: dict[str, Any] = {}
        for name, (low, high) in self.limits.items():
            value = getattr(command, name)
            if type(value) is not float or not low <= value <= high:
                changed[name] = self._clamp(name, value, low, high)
        if changed:
            command = msgspec.structs.replace(command, **changed)
        self._plant.write(self._input, command)
        return command

    def _clamp(self, name: str, value: Any, low: float, high: float) -> Any:
        if isinstance(value, (list, tuple)):
            return [self._clamp(f"{name}[{i}]", one, low, high) for i, one in enumerate(value)]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise CommandError(
                f"{self._input}.{name} must be a finite number, not {value!r}.",
                fix=f"send a number from {low:g} to {high:g}; look for a division by zero or an overflow before it.",
            )
        return min(high, max(low, value))

    def neutral(self) -> None:
        """Write the neutral command, also after `close`."""
        self._plant.write(self._input, self.command_type())

    def on_deactivate(self, reason: str) -> None:
        """Write the neutral command."""
        self.neutral()

    def on_close(self) -> None:
        """Write the neutral command, also if it was never active."""
        self.neutral()
