"""Wheels or tracks that follow the speeds they are commanded, with a lag of first order."""

from __future__ import annotations

import math

Pair = tuple[float, float]  # left and right

SAME_MPS = 1e-6  # one that is as near as rounding allows has arrived


class DriveLag:
    """The lag, exact for any step: after `lag_s`, 63 % of a change is reached."""

    def __init__(self, lag_s: float, step_s: float) -> None:
        self._left, self._steps = (math.exp(-step_s / lag_s), lag_s / step_s) if lag_s > 0.0 else (0.0, 0.0)

    def advance(self, now_mps: Pair, goals_mps: Pair) -> tuple[Pair, Pair]:
        """Return the speeds at the end of a step [m/s], and their means in it."""
        if now_mps == goals_mps:
            return now_mps, now_mps
        news = [goal + (now - goal) * self._left for now, goal in zip(now_mps, goals_mps, strict=True)]
        mean_left, mean_right = (
            goal + (now - new) * self._steps for now, new, goal in zip(now_mps, news, goals_mps, strict=True)
        )
        left, right = (goal if abs(new - goal) < SAME_MPS else new for new, goal in zip(news, goals_mps, strict=True))
        return (left, right), (mean_left, mean_right)
