"""A recorded run as a plant: it plays back the sensors' pages and the true state, and ignores commands.

`--io replay:RUN` uses it: the current program reads the recorded readings, and its commands have no effect. This is
different from `snr replay`, which executes the recorded tasks and compares.
"""

from __future__ import annotations

import bisect
from typing import Any

from snr_sim.prelude.errors import PlantError, TraceError, UnknownNameError, ValueEncodingError, suggest
from snr_sim.prelude.scenario import Verdict
from snr_sim.prelude.task import Page
from snr_sim.prelude.values import decode_value
from snr_sim.recording.reader import Trace
from snr_sim.recording.records import InputRecord, TruthRecord

_ROUNDING_S = 1e-6
_SENSOR_LOOP = "_sensor"  # suffix of a sensor loop's name, after the key


class RecordedRun:
    """Plant that plays back a recorded run. Implements the reading half of `Plant`; its verdict is only the end.

    Raises:
        TraceError: the trace has no sensor readings.
    """

    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    step_s: float | None = None

    def __init__(self, trace: Trace) -> None:
        self.trace: Trace = trace
        self.engine: str = f"as recorded of {trace.header.engine or 'real devices'}"
        self.time_s: float = 0.0
        self.__file__: str = str(trace.path)
        self._inputs = [
            record
            for record in trace.records
            if isinstance(record, InputRecord)
            and record.type == "store_page"
            and record.source == f"{record.name}{_SENSOR_LOOP}"
        ]
        self._truths = [record for record in trace.records if isinstance(record, TruthRecord)]
        self._truth_times_s = [record.t for record in self._truths]
        if not self._inputs:
            raise TraceError(f"In the run {trace.path} no sensor was read.", fix="name one of a robot with sensors.")
        self.end_s: float = self._inputs[-1].t

    def pages(self, key: str) -> list[Page]:
        """Return the pages that a sensor stored, in order.

        Raises:
            TraceError: it stored none, or they cannot be decoded.
        """
        records = [record for record in self._inputs if record.name == key]
        if not records:
            read = {record.name for record in self._inputs}
            raise TraceError(f"In the run {self.trace.path} there is no sensor '{key}'.", fix=suggest(key, read))
        try:
            return [decode_value(bytes(record.values), {"page": Page})[0] for record in records]
        except ValueEncodingError as error:
            raise TraceError(
                f"Pages of the sensor '{key}' in {self.trace.path} cannot be brought back: {error.message}",
                fix="leave this sensor out.",
            ) from error

    def verdict(self, plant: object) -> Verdict | None:
        """Return 'replayed' once the recording is over."""
        return Verdict("replayed", True) if self.time_s >= self.end_s - _ROUNDING_S else None

    def metrics(self, plant: object, seed: int) -> dict[str, Any]:
        """Return no metrics: commands have no effect that could be measured."""
        return {}

    def reset(self, seed: int) -> None:
        """Go back to the beginning."""
        self.time_s = 0.0

    def step(self, dt_s: float) -> None:
        """Advance the time of the playback."""
        self.time_s += dt_s

    def write(self, name: str, command: Any) -> None:
        """Raise PlantError: a recorded run has no actuators."""
        raise PlantError(f"'{name}' was written to a recorded run, which nothing moves.", fix="use --io sim.")

    def read(self, name: str) -> Any:
        """Raise UnknownNameError: sensor readings are available as pages only."""
        raise UnknownNameError(
            f"A recorded run has no output '{name}'.", fix="context.recorded(key) has a sensor's pages."
        )

    def snapshot(self) -> Any:
        """Return the current playback time."""
        return self.time_s

    def restore(self, snapshot: Any) -> None:
        """Set the playback time."""
        self.time_s = snapshot

    def scene(self) -> dict[str, Any]:
        """Return the recorded scene."""
        return self.trace.header.scene or {"statics": {}, "bodies": {}}

    def truth(self) -> dict[str, Any]:
        """Return the newest true state up to now; an empty dict if the run had no plant."""
        place = bisect.bisect_right(self._truth_times_s, self.time_s + _ROUNDING_S) - 1
        if place < 0:
            return {"poses": {}, "vectors": {}, "values": {}}
        record = self._truths[place]
        return {"poses": record.poses, "vectors": record.vectors, "values": record.values}
