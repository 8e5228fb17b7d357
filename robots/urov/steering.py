"""Steering by eye: sticks that bring the vehicle to a point, forward and sideways, at a speed that it can brake from.

position, goal --> error in the world --> two PID controllers --> turned into the vehicle's frame --> sticks
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from snr_sim.std_mods import Pid, approach

# Sticks per metre, per metre and second, and per metre a second: for a full stick of 60 N, 20 kg with water and a
# delay of 0.3 s. Our own choice.
KP, KI, KD, MAX_STICK = 0.35, 0.06, 0.55, 0.7
SPEED_MPS, BRAKE_MPS2 = 0.35, 0.06  # of the approach
STICK_PER_MPS = 1.5  # stick per m/s that it takes to go so fast, with what KD takes away


class Steering:
    """Controller with a reference point that moves to the goal."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Reset: the next path begins at the vehicle's position then."""
        self._along = [Pid(KP, KI, KD, (-MAX_STICK, MAX_STICK), derivative_filter_s=0.3) for _ in range(2)]
        self._target_m: tuple[float, float] | None = None  # reference point on the path to the goal

    def sticks(
        self, goal_m: Sequence[float], position_m: Sequence[float], yaw_rad: float, dt_s: float
    ) -> tuple[float, float]:
        """Return surge and sway for now, -1 to 1.

        Args:
            goal_m, position_m: x and y, world frame.
            yaw_rad: where the vehicle points.
            dt_s: since the last call, more than 0.
        """
        east, north = self._towards(goal_m, (position_m[0], position_m[1]), dt_s)
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        return cos * east + sin * north, -sin * east + cos * north

    def _towards(self, goal_m: Sequence[float], position_m: tuple[float, float], dt_s: float) -> list[float]:
        """Return sticks to the east and to the north, for a path to the goal at a speed that can be kept."""
        from_m = self._target_m or position_m
        left_m = math.dist((goal_m[0], goal_m[1]), from_m)
        fraction = approach(left_m, SPEED_MPS, BRAKE_MPS2, dt_s) / left_m if left_m > 0.0 else 0.0
        steps_m = fraction * (goal_m[0] - from_m[0]), fraction * (goal_m[1] - from_m[1])
        self._target_m = from_m[0] + steps_m[0], from_m[1] + steps_m[1]
        sticks = zip(self._along, self._target_m, position_m, steps_m, strict=True)
        return [
            pid.update(target, at, dt_s, feed_forward=STICK_PER_MPS * step / dt_s) for pid, target, at, step in sticks
        ]
