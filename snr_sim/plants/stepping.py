"""Keeps a plant up with a clock: with jumps of virtual time, or with the wall clock."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from snr_sim.prelude.clock import Clock
from snr_sim.prelude.plant import Plant

# A plant that is integrated with a fixed step is brought to the last whole step; rounding must not cost one.
_ROUNDING = 1e-6


class Stepper:
    """Steps a plant that was just reset; give its `advance_to` to `SimClock.follow`."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._step_s = plant.step_s
        self._steps = 0

    def advance_to(self, time_s: float) -> None:
        """Bring the plant to `time_s`: exactly, or to the last multiple of its step."""
        plant, step_s = self._plant, self._step_s
        if step_s is None:
            if time_s > plant.time_s:
                plant.step(time_s - plant.time_s)
            return
        target = int(time_s / step_s + _ROUNDING)
        step = plant.step
        for _ in range(target - self._steps):
            step(step_s)
        self._steps = target


class RealTimePlant:
    """Interface of a plant for devices and viewers, at the pace of a clock and for several threads at once.

    For robots whose roles run as processes of their own. It has no stepping loop: each read or write first advances the
    plant to the present. Loops on threads make such calls many times a second, one at a time.

    Args:
        plant: as it was reset, at time 0; from now on reached through this one only.
        clock: whose seconds count.
    """

    def __init__(self, plant: Plant, clock: Clock) -> None:
        self._plant = plant
        self._clock = clock
        self._stepper = Stepper(plant)
        self._lock = threading.RLock()

    def follow(self, clock: Clock) -> None:
        """Use another clock from now on: one that starts when the run does, after all setup."""
        self._clock = clock

    @contextmanager
    def now(self) -> Iterator[Any]:
        """Yield the plant itself, advanced to the present; other threads wait meanwhile."""
        with self._lock:
            self._stepper.advance_to(self._clock.now_s())
            yield self._plant

    @property
    def time_s(self) -> float:
        """Simulated time that the plant has reached."""
        return self._plant.time_s

    def write(self, name: str, command: Any) -> None:
        """Set an input from now on."""
        with self.now() as plant:
            plant.write(name, command)

    def read(self, name: str) -> Any:
        """Return the present value of an output."""
        with self.now() as plant:
            return plant.read(name)

    def scene(self) -> dict[str, Any]:
        """Return the static geometry, and the shapes of moving parts."""
        return self._plant.scene()

    def truth(self) -> dict[str, Any]:
        """Return the present true state."""
        with self.now() as plant:
            truth: dict[str, Any] = plant.truth()
            return truth
