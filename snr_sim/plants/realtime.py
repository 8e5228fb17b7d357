"""A plant that follows the wall clock, for robots whose roles run as processes of their own.

It has no stepping loop: each read or write first advances it to the present. Loops on threads make
such calls many times a second, one at a time.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from snr_sim.plants.stepping import Stepper
from snr_sim.prelude.clock import Clock
from snr_sim.prelude.plant import Plant


class RealTimePlant:
    """Interface of a plant for devices and viewers, at the pace of a clock and for several threads at once.

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
