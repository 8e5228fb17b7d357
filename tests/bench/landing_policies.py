"""Policies that land the environments, many at once: by rules, of what is measured."""

from __future__ import annotations

from typing import Any

import numpy as np


def straight_down(seen: Any) -> Any:
    """Return actions of `LanderVertical`: full throttle while it falls faster than suits the height."""
    return np.where(seen[:, 1] < -np.sqrt(1.0 + 3.24 * np.maximum(0.0, seen[:, 0])), 3, 0)


def to_the_ground(seen: Any) -> Any:
    """Return actions of `LanderPad`: nearly all land, some off the pad; after a touchdown the engine is off."""
    x, height, vx, vz, tilt, rate, left, right, _ = seen.T
    goal_mps = -np.sqrt(1.0 + np.maximum(0.0, height - 2.0))
    goal_mps = np.where(height < 30.0, np.maximum(goal_mps, -0.5 - 0.1 * height), goal_mps)
    throttle = np.where(goal_mps - vz > 0.5, 2, np.where(goal_mps - vz > -0.7, 1, 0))
    max_lean = np.where(height > 8.0, 0.3, 0.09)
    lean = np.clip(0.15 * vx + np.where(height > 8.0, 0.003, 0.0) * x, -max_lean, max_lean) - tilt - 2.2 * rate
    turn = np.where(lean > 0.02, 2, np.where(lean < -0.02, 0, 1))
    return np.where((left > 0.0) | (right > 0.0), 1, 3 * throttle + turn)
