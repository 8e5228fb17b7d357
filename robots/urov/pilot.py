"""A pilot who does as it is written: for tests, and for scenarios where nobody is at the sticks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec

from snr_sim import Loop, LoopFactory
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.node_api import NodeApi

from .controls import Controls, controls_of


class Cue:
    """From a moment on, some fields of the controls are other ones.

    Args:
        at_s: when.
        changes: fields of `Controls`.

    >>> Cue(2.0, is_armed=True, mode="depth_hold").changes
    {'is_armed': True, 'mode': 'depth_hold'}
    """

    def __init__(self, at_s: float, **changes: Any) -> None:
        self.at_s = at_s
        self.changes = changes


class ScriptedPilotFactory(LoopFactory):
    """Makes the pilot.

    Args:
        script: cues in the order of their times.
        rate_hz: controls per second.
        key: of their page, if it goes to somebody at the surface who makes "controls" of it.

    Raises:
        ParameterError: the cues are not in order.
        CommandError: a cue has what are no controls.
    """

    def __init__(self, script: Sequence[Cue], rate_hz: float, key: str = "controls") -> None:
        super().__init__()
        times = [cue.at_s for cue in script]
        if times != sorted(times):
            raise ParameterError(f"A pilot's cues come at {times} s.", fix="name them in the order of their times.")
        for cue in script:
            controls_of({**msgspec.structs.asdict(Controls()), **cue.changes})
        self.script = tuple(script)
        self.rate_hz = rate_hz
        self.key = key

    def get(self, parent: NodeApi) -> ScriptedPilot:
        """Returns the loop 'pilot'."""
        return ScriptedPilot(self, parent, "pilot", self.rate_hz)


class ScriptedPilot(Loop):
    """Stores page 'controls': what the cues so far have made of them. They begin when the vehicle is first heard of."""

    factory: ScriptedPilotFactory

    def setup(self) -> None:
        """Begins with controls that ask for nothing."""
        self._controls: dict[str, Any] = msgspec.structs.asdict(Controls())
        self._left = list(self.factory.script)
        self._start_s: float | None = None

    def loop(self) -> None:
        """Stores the controls of now; what a cue asks to be held is asked once."""
        controls = self._controls
        controls["number"] += 1
        controls["depth_m"] = controls["heading_rad"] = None
        if self._start_s is None and self.get_data("vehicle") is not None:
            self._start_s = self.get_time_s()
        gone_s = -1.0 if self._start_s is None else self.get_time_s() - self._start_s
        while self._left and gone_s >= self._left[0].at_s - 1e-9:
            controls.update(self._left.pop(0).changes)
        self.store_data(self.factory.key, dict(controls))
