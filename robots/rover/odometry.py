"""Where the rover is, from how far its wheels have turned and where it looks. What slips, it does not know.

pages "motor_..." and "imu" --> Odometry --> page "odometry": position_m [x, y] from the start, x to the east, yaw_rad,
page "motor_faults" ------------'                             speed_mps, way_m, track_factor, stamp_s

Turning is not taken from the wheels, which slide sideways then, but from the inertial unit. The two together tell by
how much: `track_factor` is the effective track over the distance of the wheels (`drive.py`), learned in curves.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

from snr_sim import Endpoint, EndpointFactory, SomeTasks, Task, TaskId, TaskType
from snr_sim.scenario import NodeApi, ordered_sum, wrap_rad

from .drive import EFFECTIVE_TRACK
from .parameters import RoverParameters

MIN_TURN_RAD = 0.005  # between two readings: less is noise, not a curve
FIRST_WEIGHT = 0.01  # of the factor at the start: it counts as much as 2 s of turning with 0.3 rad/s
KEPT = 0.99  # of what was learned before, at each reading in a curve: of the last 5 s, most


class WheelOdometry:
    """Adds up the way of the wheels along the heading."""

    def __init__(self, parameters: RoverParameters) -> None:
        wheels = parameters.vehicle.motor_wheels
        self._rolling_m = [wheel.radius_m - parameters.tyre_m for wheel in wheels]
        self._left = [i for i, wheel in enumerate(wheels) if wheel.side == "left"]
        self._right = [i for i, wheel in enumerate(wheels) if wheel.side == "right"]
        self._track_m = 2.0 * ordered_sum(abs(wheel.position_m[1]) for wheel in wheels) / len(wheels)
        self._before: tuple[tuple[float | None, ...], float, float] | None = None
        self._squares = FIRST_WEIGHT
        self._products = FIRST_WEIGHT * EFFECTIVE_TRACK
        self.position_m: tuple[float, float] = (0.0, 0.0)
        self.speed_mps: float = 0.0
        self.way_m: float = 0.0

    @property
    def track_factor(self) -> float:
        """Effective track over the distance of the wheels, as learned so far."""
        return self._products / self._squares

    def update(self, turned_rad: Sequence[float | None], yaw_rad: float, pitch_rad: float, stamp_s: float) -> None:
        """Take how far each wheel has turned since the start, None if unknown, and the attitude at that time."""
        before, self._before = self._before, (tuple(turned_rad), yaw_rad, stamp_s)
        if before is None or stamp_s <= before[2]:
            return
        ways = [
            None if now is None or then is None else rolling * (now - then)
            for rolling, now, then in zip(self._rolling_m, turned_rad, before[0], strict=True)
        ]
        turn = wrap_rad(yaw_rad - before[1])
        left, right = _mean([ways[i] for i in self._left]), _mean([ways[i] for i in self._right])
        half = 0.5 * self.track_factor * self._track_m * turn  # what a side rolls less or more than the middle
        if left is None or right is None:
            ahead = left + half if left is not None else right - half if right is not None else 0.0
        else:
            ahead = 0.5 * (left + right)
            if abs(turn) > MIN_TURN_RAD:
                self._squares = KEPT * self._squares + turn * turn
                self._products = KEPT * self._products + turn * (right - left) / self._track_m
        heading = before[1] + 0.5 * turn
        level = ahead * math.cos(pitch_rad)
        x, y = self.position_m
        self.position_m = x + level * math.cos(heading), y + level * math.sin(heading)
        self.way_m += abs(ahead)
        self.speed_mps = ahead / (stamp_s - before[2])


def _mean(ways: Sequence[float | None]) -> float | None:
    known = [way for way in ways if way is not None]
    return ordered_sum(known) / len(known) if known else None


class Odometry(Endpoint):
    """Answers the last motor's reading of a round with where the rover is."""

    parameters: RoverParameters
    is_watched: bool = False  # whether a MotorWatch runs

    def __init__(self, factory: EndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.keys = [f"motor_{wheel.name}" for wheel in self.parameters.vehicle.motor_wheels]
        self.odometry = WheelOdometry(self.parameters)
        last = self.keys if self.is_watched else self.keys[-1:]  # the last one may fall silent
        self.task_handlers = {(TaskType.process_data, key): self.on_motors for key in last}

    def on_motors(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Take a round of readings, with its last one."""
        imu, motors, broken = self.get_data("imu"), [self.get_data(key) for key in self.keys], self.broken()
        if task.name != next((key for key in reversed(self.keys) if key not in broken), ""):
            return None
        if imu is None or None in motors:
            return None
        odometry, stamp_s = self.odometry, task.page.data["stamp_s"]
        turned_rad = [
            None if key in broken else motor["turned_rad"] for key, motor in zip(self.keys, motors, strict=True)
        ]
        odometry.update(turned_rad, imu["yaw_rad"], imu["pitch_rad"], stamp_s)
        page: dict[str, Any] = {
            "position_m": list(odometry.position_m),
            "yaw_rad": imu["yaw_rad"],
            "speed_mps": odometry.speed_mps,
            "way_m": odometry.way_m,
            "track_factor": odometry.track_factor,
            "stamp_s": stamp_s,
        }
        return self.store_data_task("odometry", page)

    def broken(self) -> Collection[str]:
        """Return the names of the motors that were found broken."""
        faults: Collection[str] = self.get_data("motor_faults")["faults"] if self.is_watched else ()
        return faults
