"""Keeps a plant up with a clock: whenever the clock jumps, the plant is stepped to the same moment."""

from __future__ import annotations

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
