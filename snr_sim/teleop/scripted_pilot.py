"""A pilot that follows a script: for tests, and for scenarios without a person at the sticks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import msgspec

from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.node_api import NodeApi


class Cue:
    """From a moment on, some fields of the controls have other values.

    Args:
        at_s: when, from the first page "vehicle" on.
        changes: fields of the controls.

    >>> Cue(2.0, is_armed=True, mode="depth_hold").changes
    {'is_armed': True, 'mode': 'depth_hold'}
    """

    def __init__(self, at_s: float, **changes: Any) -> None:
        self.at_s: float = at_s
        self.changes = changes


class ScriptedPilotFactory(LoopFactory):
    """Makes the pilot.

    Args:
        script: cues in the order of their times.
        rate_hz: controls per second.
        neutral: controls without a command, with a field `number`, which counts up.
        check: raises CommandError for a dict that holds no controls.
        once: fields that a cue sets in one page only: later ones have the neutral value.
        key: of the page, if a component at the surface makes "controls" of it.

    Raises:
        ParameterError: the cues are not in order.
        CommandError: `check` rejects a cue.
    """

    def __init__(
        self,
        script: Sequence[Cue],
        rate_hz: float,
        neutral: msgspec.Struct,
        check: Callable[[dict[str, Any]], object],
        once: Sequence[str] = (),
        key: str = "controls",
    ) -> None:
        super().__init__()
        times = [cue.at_s for cue in script]
        if times != sorted(times):
            raise ParameterError(f"A pilot's cues come at {times} s.", fix="name them in the order of their times.")
        self.neutral: dict[str, Any] = msgspec.structs.asdict(neutral)
        for cue in script:
            check({**self.neutral, **cue.changes})
        self.script: tuple[Cue, ...] = tuple(script)
        self.rate_hz: float = rate_hz
        self.once: dict[str, Any] = {name: self.neutral[name] for name in once}
        self.key: str = key

    def get(self, parent: NodeApi) -> ScriptedPilot:
        """Return the loop 'pilot'."""
        return ScriptedPilot(self, parent, "pilot", self.rate_hz)


class ScriptedPilot(Loop):
    """Stores page 'controls', changed by the cues so far. The script begins with the first page 'vehicle'."""

    factory: ScriptedPilotFactory

    def setup(self) -> None:
        """Start with neutral controls."""
        self._controls = dict(self.factory.neutral)
        self._left = list(self.factory.script)
        self._start_s: float | None = None

    def loop(self) -> None:
        """Store the controls of now."""
        controls = self._controls
        controls["number"] += 1
        controls.update(self.factory.once)
        if self._start_s is None and self.get_data("vehicle") is not None:
            self._start_s = self.get_time_s()
        gone_s = -1.0 if self._start_s is None else self.get_time_s() - self._start_s
        while self._left and gone_s >= self._left[0].at_s - 1e-9:
            controls.update(self._left.pop(0).changes)
        self.store_data(self.factory.key, dict(controls))
