"""Steering by eye: sticks that bring the vehicle to a point, forward and sideways, at a speed that it can brake from.

position, goal --> error in the world --> two PID controllers --> turned into the vehicle's frame --> sticks
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from snr_sim.std_mods.pid import Pid
from snr_sim.std_mods.slew import approach

# Sticks per metre, per metre and second, and per metre a second: for a full stick of 60 N, 20 kg with water and a
# delay of 0.3 s. Our own choice.
KP, KI, KD, MOST = 0.35, 0.06, 0.55, 0.7
SPEED_MPS, BRAKE_MPS2 = 0.35, 0.06  # of the approach
FEEL = 1.5  # stick per m/s that it takes to go so fast, with what KD takes away


class Steering:
    """Controller with a reference point that moves to the goal."""

    def __init__(self) -> None:
        self.let_go()

    def let_go(self) -> None:
        """Reset: the next path begins at the vehicle's position then."""
        self._along = [Pid(KP, KI, KD, (-MOST, MOST), smoothing_s=0.3) for _ in range(2)]
        self._wanted_m: tuple[float, float] | None = None  # reference point on the path to the goal

    def sticks(
        self, goal_m: Sequence[float], place_m: Sequence[float], yaw_rad: float, dt_s: float
    ) -> tuple[float, float]:
        """Return surge and sway for now, -1 to 1.

        Args:
            goal_m, place_m: x and y, world frame.
            yaw_rad: where the vehicle points.
            dt_s: since the last call, more than 0.
        """
        east, north = self._towards(goal_m, (place_m[0], place_m[1]), dt_s)
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        return cos * east + sin * north, -sin * east + cos * north

    def _towards(self, goal_m: Sequence[float], place_m: tuple[float, float], dt_s: float) -> list[float]:
        """Return sticks to the east and to the north, for a path to the goal at a speed that can be kept."""
        from_m = self._wanted_m or place_m
        left_m = math.dist((goal_m[0], goal_m[1]), from_m)
        share = approach(left_m, SPEED_MPS, BRAKE_MPS2, dt_s) / left_m if left_m > 0.0 else 0.0
        steps_m = share * (goal_m[0] - from_m[0]), share * (goal_m[1] - from_m[1])
        self._wanted_m = from_m[0] + steps_m[0], from_m[1] + steps_m[1]
        sticks = zip(self._along, self._wanted_m, place_m, steps_m, strict=True)
        return [pid.update(wanted, at, dt_s, feed_forward=FEEL * step / dt_s) for pid, wanted, at, step in sticks]
