"""Checks of the settings of a training, made before it begins and not an hour into it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from snr_sim.prelude.errors import ParameterError


def check_whole(name: str, value: Any, min_value: int) -> None:
    """Raise ParameterError if a setting is not a whole number, or less than the minimum."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < min_value:
        raise ParameterError(f"A training with {name}={value!r}.", fix=f"a whole number, {min_value} or more.")


def check_share(name: str, value: Any) -> None:
    """Raise ParameterError if a setting is not a number from 0 to 1."""
    is_number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
    if not (is_number and 0.0 <= value <= 1.0):
        raise ParameterError(f"A training with {name}={value!r}.", fix="a number from 0 to 1.")


def check_batch(training: Any, counts: Sequence[str]) -> None:
    """Raise ParameterError if a setting of a training in a batch is out of range; it names the setting.

    Args:
        training: with a `seed`, and `epsilon` and `min_step_size`, which are in 0 to 1.
        counts: names of its other numbers, whole and 1 or more.
    """
    for name in counts:
        check_whole(name, getattr(training, name), min_value=1)
    check_whole("seed", training.seed, min_value=0)
    for name in ("epsilon", "min_step_size"):
        value = getattr(training, name)
        for share in value if isinstance(value, (tuple, list)) else (value,):
            check_share(name, share)


def check_finite(td_error: float, where: str) -> None:
    """Raise ParameterError if a new value is infinite or NaN."""
    if not math.isfinite(td_error):
        raise ParameterError(
            f"At {where} a value is to become {td_error}, so nothing more can be learned.",
            fix="look where the reward or the values of before are not finite.",
        )
