"""LoopSteps: a process's `loop`, a function or a generator, as steps that each end with a time to wait."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

from snr_sim.core.loop import NEVER_S
from snr_sim.prelude.errors import ParameterError

# A loop that returns None is called again after this time: no loop takes a whole core, and in lock step time advances.
MIN_WAIT_S = 0.001


class LoopSteps:
    """A function as steps, each followed by a wait: a call of it, or its generator up to the next yield.

    Args:
        process: its name, for messages.
        function: a process's `loop`, or one that `spawn_thread` was given.
        repeats: whether it is called again after its end.
    """

    def __init__(self, process: str, function: Callable[[], Any], repeats: bool = True) -> None:
        self._process = process
        self._function = function
        self._repeats = repeats
        self._generator: Iterator[float] | None = None

    def step(self) -> float:
        """Do the next step; return the time to wait after it [s], `NEVER_S` if it was the last one.

        Raises:
            ParameterError: what the function has returned or yielded is not a time.
        """
        waited: Any = None
        if self._generator is None:
            waited = self._function()
            if isinstance(waited, Iterator):
                self._generator = waited
        if self._generator is not None:
            try:
                waited = next(self._generator)
            except StopIteration:
                self._generator = waited = None
        if self._generator is None and not self._repeats:
            return NEVER_S
        if waited is None:
            return MIN_WAIT_S
        if isinstance(waited, (int, float)) and 0 <= waited < math.inf:
            return max(float(waited), MIN_WAIT_S)
        verb = "returned" if self._generator is None else "yielded"
        raise ParameterError(
            f"loop() of {self._process} {verb} {repr(waited)[:80]}, which is not a time to wait.",
            fix="seconds, such as 0.05; or None.",
        )

    def close(self) -> None:
        """Leave the generator: its `finally` blocks are executed."""
        close = getattr(self._generator, "close", None)
        if close is not None:
            with suppress(ValueError):  # it is being executed: its thread did not end in time
                close()
