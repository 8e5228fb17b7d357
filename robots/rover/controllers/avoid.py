"""Drives to a goal and around what is in the way, by wheels, gyroscope and a scan of the distances around.

page "scan" --> points around --------------.
pages "imu", "odometry" --> DeadReckoning --+--> free heading --> page "drive", page "avoid"
"""

from __future__ import annotations

import math
from typing import Any

from snr_sim_robot_rover.avoid import Point, free_heading, points_of
from snr_sim_robot_rover.drive import full_brake, wheel_rates
from snr_sim_robot_rover.navigation import DeadReckoning, Steering
from snr_sim_robot_rover.odometry import Odometry
from snr_sim_robot_rover.parameters import RoverParameters

from snr_sim import Endpoint, EndpointFactory, SomeTasks, handles
from snr_sim.scenario import RobotInfo, wrap_rad

SPEED_MPS = 0.6
AHEAD_M = 1.5  # of the point that it drives to
ARRIVED_M = 0.5


def factories(robot: RobotInfo) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    return [Odometry.factory(parameters=robot.parameters), Avoid.factory(parameters=robot.parameters)]


class Avoid(Endpoint):
    """Chooses a heading with each scan, and sets the wheels after each page "odometry"."""

    parameters: RoverParameters

    def begin(self) -> None:
        """Begin at the start, with no scan."""
        self.place = DeadReckoning(self.parameters.stands_s)
        self.steering = Steering(SPEED_MPS)
        self.heading_rad: float | None = None  # to take, from the start's; None: stand
        self.has_arrived = False

    @handles("imu")
    def on_imu(self, imu: dict[str, Any]) -> None:
        """Follow the turning."""
        self.place.turn(imu["rate_radps"][2], imu["stamp_s"])

    @property
    def goal(self) -> Point:
        """Bearing of the goal [rad], from where the rover looks, and its distance [m]."""
        (x, y), (to_x, to_y) = self.place.position_m, self.parameters.points_m[-1]
        return wrap_rad(math.atan2(to_y - y, to_x - x) - self.place.heading_rad), math.dist((x, y), (to_x, to_y))

    @handles("scan")
    def on_scan(self, scan: dict[str, Any]) -> None:
        """Choose where to drive."""
        points = points_of(scan["ranges_m"], scan["angles_rad"], self.parameters.lidar.reach_m)
        now_rad, (goal_rad, goal_m) = self.place.heading_rad, self.goal
        before_rad = goal_rad if self.heading_rad is None else wrap_rad(self.heading_rad - now_rad)
        heading_rad = free_heading(points, goal_rad, goal_m, before_rad)
        self.heading_rad = None if heading_rad is None else wrap_rad(now_rad + heading_rad)

    @handles("odometry")
    def on_odometry(self, odometry: dict[str, Any]) -> SomeTasks:
        """Drive on."""
        place, speed_mps = self.place, odometry["speed_mps"]
        if not place.move(speed_mps, odometry["stamp_s"]):
            return None
        goal_m = self.goal[1]
        self.has_arrived = self.has_arrived or goal_m < ARRIVED_M
        drive = full_brake(self.parameters)
        if self.heading_rad is not None and not self.has_arrived:
            target = self.steering.steer(wrap_rad(self.heading_rad - place.heading_rad), AHEAD_M, speed_mps)
            drive = {"mode": "speed", "values": wheel_rates(self.parameters, *target, odometry["track_factor"])}
        state = "arrived" if self.has_arrived else "blocked" if self.heading_rad is None else "driving"
        page = {"state": state, "position_m": list(place.position_m), "heading_rad": self.heading_rad, "left_m": goal_m}
        return [self.store_data_task("drive", drive), self.store_data_task("avoid", page)]
