"""Readings of sensors: the loop that stores them as pages, and simulated sensors with the errors of real ones.

A simulated sensor measures any output of a plant, through the plant's interface only. Errors apply to the true value in
this order: bias and drift, noise, limits, resolution. `SimSensor` adds delay and rate.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import msgspec

from snr_sim.core.loop import LoopFactory
from snr_sim.devices.device_loop import DeviceLoop, start_device
from snr_sim.prelude.device import Sensor, Stale
from snr_sim.prelude.errors import ParameterError, SensorLostError, suggest
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.task import Page, Task

if TYPE_CHECKING:
    import numpy as np

MAX_STALE_NOTES = 5  # a loose plug is not logged indefinitely
SMOOTHNESS = 500.0  # steps of a drifting error within its correlation time: each is 6 % of its sigma
NOISE_BLOCK = 256  # drawn at once: single draws cost 40 times as much
SAME_TIME_S = 1e-9  # times closer than this are equal, to allow for rounding


class SensorLoopFactory(LoopFactory):
    """Reads a sensor at a rate and stores each reading as a page.

    Args:
        key: of the page.
        open_device: opens the sensor.
        rate_hz: how often it is read.
        process: whether a reading triggers a task `process_data`, or is only stored for later queries.
    """

    def __init__(self, key: str, open_device: Callable[[], Sensor[Any]], rate_hz: float, process: bool = True) -> None:
        super().__init__()
        self.key: str = key
        self.open_device: Callable[[], Sensor[Any]] = open_device
        self.rate_hz: float = rate_hz
        self.process: bool = process

    def get(self, parent: NodeApi) -> SensorLoop:
        """Return the loop `<key>_sensor`."""
        return SensorLoop(self, parent, f"{self.key}_sensor", self.rate_hz)

    def data_of(self, reading: Any) -> dict[str, Any]:
        """Return the data of a reading's page, with copies of lists and arrays."""
        data: dict[str, Any] = msgspec.to_builtins(reading)
        return data


class SensorLoop(DeviceLoop):
    """Stores `{field: value}` of the newest reading under the sensor's key.

    Without a reading nothing is stored, so the page grows old (`get_age_s`); this is logged once.
    """

    factory: SensorLoopFactory

    def setup(self) -> None:
        """Open the sensor."""
        self._stale_times = 0
        self._is_stale = False
        self.device: Any = start_device(self.factory.open_device(), f"the sensor '{self.factory.key}'")

    def loop(self) -> None:
        """Read once."""
        factory = self.factory
        reading = self.device.read()
        if type(reading) is Stale:
            self._log_stale(reading)
            return
        if self._is_stale:
            self._is_stale = False
            self._log_state("answers again")
        data = factory.data_of(reading)  # made here, so no snapshot is needed
        self.schedule(Task.store_page(Page(factory.key, data, self.parent.name, self.get_time_s(), factory.process)))

    def _log_stale(self, stale: Stale) -> None:
        if not self._is_stale:
            self._is_stale = True
            self._stale_times += 1
            self._log_state(f"has no reading: {stale.reason}")

    def _log_state(self, what: str) -> None:
        text = f"Sensor '{self.factory.key}', t = {self.get_time_s():.2f} s: it {what}"
        if self._stale_times < MAX_STALE_NOTES:
            self.parent.add_note(text)
        elif self._stale_times == MAX_STALE_NOTES:
            self.parent.add_note(f"{text} (not reported again)")


@dataclass(frozen=True)
class BiasDrift:
    """A slow error: a constant bias, or one that drifts (a Gauss-Markov process of first order).

    Args:
        sigma: its standard deviation, from the first reading on, in the field's unit.
        correlation_time_s: time after which it has decayed to 1/e; infinite for a bias that is constant in a run.
    """

    sigma: float
    correlation_time_s: float = math.inf


@dataclass(frozen=True)
class SensorErrors:
    """Errors of a sensor. Empty: none. Each number of a list has an error of its own.

    Args:
        noise: standard deviation by field, in the field's unit.
        resolution: step that values are rounded to, by field.
        delay_s: how old a reading is when it is read.
        drift: bias and drift, by field.
        limits: measuring range, by field.
        period_s: between two measurements; reading more often returns the same reading again.

    Raises:
        ParameterError: a number is negative or not finite.
    """

    noise: dict[str, float] = field(default_factory=dict)
    resolution: dict[str, float] = field(default_factory=dict)
    delay_s: float = 0.0
    drift: dict[str, BiasDrift] = field(default_factory=dict)
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    period_s: float = 0.0

    def __post_init__(self) -> None:
        sizes = {"delay_s": self.delay_s, "period_s": self.period_s}
        sizes |= {f"noise of {name}": sigma for name, sigma in self.noise.items()}
        sizes |= {f"resolution of {name}": step for name, step in self.resolution.items()}
        sizes |= {f"drift of {name}": drift.sigma for name, drift in self.drift.items()}
        for what, size in sizes.items():
            if not 0.0 <= size < math.inf:
                raise ParameterError(f"The {what} of a sensor must be 0 or more, not {size!r}.", fix="use 0 for none.")
        for name, drift in self.drift.items():
            if not drift.correlation_time_s > 0.0:
                raise ParameterError(
                    f"The drift of {name} has correlation_time_s={drift.correlation_time_s!r}.",
                    fix="use a time greater than 0.",
                )
        for name, (low, high) in self.limits.items():
            if not low <= high:
                raise ParameterError(f"The limits of {name} are ({low!r}, {high!r}).", fix="use (min, max).")

    @property
    def fields(self) -> set[str]:
        """All fields with errors."""
        return {*self.noise, *self.resolution, *self.drift, *self.limits}


class SensorErrorModel:
    """Adds errors to readings of one kind.

    Args:
        sample: one of them, a msgspec Struct of two fields or more.
        errors: the errors to add.
        rng: their random generator.
        name: of the sensor, for errors.

    Raises:
        ParameterError: the errors name a field that the readings do not have.
    """

    def __init__(self, sample: Any, errors: SensorErrors, rng: np.random.Generator, name: str) -> None:
        fields = sample.__struct_fields__
        for field_name in errors.fields:
            if field_name not in fields:
                raise ParameterError(
                    f"Readings of '{name}' have no field '{field_name}'.", fix=suggest(field_name, fields)
                )
        self._type: type[Any] = type(sample)
        self._values_of = attrgetter(*fields)
        self._rng = rng
        self._noise: list[float] = []
        self._fields = [
            _Field(i, getattr(sample, field), field, errors) for i, field in enumerate(fields) if field in errors.fields
        ]
        self._draws = sum(part.draws for part in self._fields)  # exact: integers

    def apply(self, reading: Any) -> Any:
        """Return the reading with errors."""
        values = list(self._values_of(reading))
        if len(self._noise) < self._draws:
            self._noise = self._rng.standard_normal(max(NOISE_BLOCK, self._draws)).tolist() + self._noise
        draw = self._noise.pop
        for part in self._fields:
            value = values[part.index]
            numbers = value if part.is_list else [value]
            if part.drift is not None:
                numbers = part.drift.add_to(numbers, reading.stamp_s, draw)
            if part.sigma:
                sigma = part.sigma
                numbers = [one + sigma * draw() for one in numbers]
            if part.limits is not None:
                low, high = part.limits
                numbers = [low if one < low else high if one > high else one for one in numbers]
            if part.step:
                step = part.step
                numbers = [round(one / step) * step for one in numbers]
            values[part.index] = numbers if part.is_list else numbers[0]
        return self._type(*values)


class _Field:
    """Errors of one field of a reading."""

    def __init__(self, index: int, sample: Any, name: str, errors: SensorErrors) -> None:
        self.index = index
        self.is_list = isinstance(sample, list)
        self.sigma = errors.noise.get(name, 0.0)
        self.step = errors.resolution.get(name, 0.0)
        self.limits = errors.limits.get(name)
        drift = errors.drift.get(name)
        self.drift = _DriftProcess(drift) if drift is not None and drift.sigma else None
        self.draws = (len(sample) if self.is_list else 1) * ((self.sigma > 0.0) + (self.drift is not None))


class _DriftProcess:
    """A slow error of one field."""

    def __init__(self, drift: BiasDrift) -> None:
        self._drift = drift
        self._errors: list[float] = []
        self._moved_s = 0.0
        self._step_s = drift.correlation_time_s / SMOOTHNESS

    def add_to(self, values: list[float], stamp_s: float, draw: Callable[[], float]) -> list[float]:
        """Return the values with the errors at a time."""
        sigma = self._drift.sigma
        if not self._errors:
            self._errors = [sigma * draw() for _ in values]
            self._moved_s = stamp_s
        elif stamp_s - self._moved_s >= self._step_s:
            kept = math.exp((self._moved_s - stamp_s) / self._drift.correlation_time_s)
            new = sigma * math.sqrt(1.0 - kept * kept)
            self._errors = [kept * error + new * draw() for error in self._errors]
            self._moved_s = stamp_s
        return [value + error for value, error in zip(values, self._errors, strict=True)]


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
        """Return the newest reading, or Stale if the plant has none.

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
        if type(reading) is Stale:  # the part is broken
            return reading
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
