"""One simulated sensor of many landers: noise, steps and delay as `devices/readings.py` computes them for each.

Each lander's noise comes from the generator that its own sensor would have, in the order in which that would draw it.
So a lander in a batch gets bitwise the same readings as the same lander alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from snr_sim.devices.readings import NOISE_BLOCK, SensorErrors
from snr_sim.prelude.rng import rng_for

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


class SensorBatch:
    """Sensors of one kind, each a reading late.

    Args:
        name: of the sensor in the robot's table of devices.
        fields: of its readings, in their order; of a list once for each number.
        errors: how badly it measures: noise, resolution, and a delay of one period.
    """

    def __init__(self, name: str, fields: Sequence[str], errors: SensorErrors, count: int) -> None:
        self._name = f"device:{name}"
        self._sigma = np.array([[errors.noise.get(field, 0.0)] for field in fields])
        self._step = np.array([[errors.resolution.get(field, 0.0)] for field in fields])
        self._coarse = np.flatnonzero(self._step)
        self._noisy = np.flatnonzero(self._sigma)
        draws = len(self._noisy)
        self._blocks = draws // math.gcd(draws, NOISE_BLOCK)  # so many hold a whole number of readings
        self._readings = self._blocks * NOISE_BLOCK // draws
        self._noise = np.empty((count * self._readings, draws))
        self._first = np.arange(count) * self._readings
        self._used = np.zeros(count, np.int64)
        self._generators: list[np.random.Generator | None] = [None] * count
        self._all = np.arange(count)
        self._truth, self._before = np.zeros((2, len(fields), count))

    def begin(self, which: Indices, seeds: Sequence[int], truth: Floats) -> None:
        """Begin the episodes of some landers, by the seeds of their runs.

        What they measure at first, `truth`, has the shape (fields, len(which)).
        """
        for i, seed in zip(which.tolist(), seeds, strict=True):
            self._generators[i] = rng_for(seed, self._name)
            self._draw(i)
        self._truth[:, which] = self._before[:, which] = truth

    def sample(self, truth: Floats) -> None:
        """Store what all sensors measure now, shape (fields, count); it is returned one reading later."""
        self._truth, self._before = truth, self._truth

    def stop(self, i: int) -> None:
        """Repeat a lander's last reading once more: its plant has ended before the next reading is due."""
        self._truth[:, i] = self._before[:, i]

    def read(self, which: Indices | None = None) -> Floats:
        """Return the readings of some landers, or of all: shape (fields, number of them). Advances only the noise."""
        is_all = which is None
        indices = self._all if which is None else which
        for i in indices[self._used[indices] == self._readings].tolist():
            self._draw(i)
        noise = self._noise.take(self._first[indices] + self._used[indices], axis=0)
        self._used[indices] += 1
        values = self._truth.copy() if is_all else self._truth[:, indices]
        values[self._noisy] += self._sigma[self._noisy] * noise.T
        step = self._step[self._coarse]
        values[self._coarse] = np.rint(values[self._coarse] / step) * step
        return values

    def _draw(self, i: int) -> None:
        """Draw noise for the next readings of a lander; each block is used from its end, as `SensorErrorModel` does."""
        generator = self._generators[i]
        assert generator is not None
        drawn = generator.standard_normal((self._blocks, NOISE_BLOCK))[:, ::-1]
        first = int(self._first[i])
        self._noise[first : first + self._readings] = drawn.reshape(self._readings, -1)
        self._used[i] = 0
