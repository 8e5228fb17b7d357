"""Drives from point to point by its wheels and its gyroscope, also when one of its motors breaks.

page "imu" --> heading by the gyroscope ----------------------------------------------------.
pages "motor_..." --> MotorWatch --> page "motor_faults" --> Odometry --> page "odometry" --> pages "drive", "place"
"""

from __future__ import annotations

from typing import Any

from snr_sim_robot_rover.drive import full_brake, wheel_rates
from snr_sim_robot_rover.motor_watch import MotorWatch
from snr_sim_robot_rover.navigation import DeadReckoning, RouteFollower
from snr_sim_robot_rover.odometry import Odometry
from snr_sim_robot_rover.parameters import RoverParameters

from snr_sim import Endpoint, EndpointFactory, SomeTasks, handles
from snr_sim.scenario import RobotInfo


def factories(robot: RobotInfo) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    parameters = robot.parameters
    odometry = Odometry.factory(parameters=parameters, is_watched=True)
    return [MotorWatch.factory(parameters=parameters), odometry, PointFollower.factory(parameters=parameters)]


class PointFollower(Endpoint):
    """Sets the wheels after each page "odometry"."""

    parameters: RoverParameters

    def begin(self) -> None:
        """Begin at the start."""
        self.place = DeadReckoning(self.parameters.stands_s)
        self.route = RouteFollower(self.parameters.points_m)

    @handles("imu")
    def on_imu(self, imu: dict[str, Any]) -> None:
        """Follow the turning."""
        self.place.turn(imu["rate_radps"][2], imu["stamp_s"])

    @handles("odometry")
    def on_odometry(self, odometry: dict[str, Any]) -> SomeTasks:
        """Drive on, and say where it is."""
        place, speed_mps = self.place, odometry["speed_mps"]
        if not place.move(speed_mps, odometry["stamp_s"]):
            return None
        target = self.route.steer(place.position_m, place.heading_rad, speed_mps)
        rates = wheel_rates(self.parameters, *target, odometry["track_factor"])
        drive = full_brake(self.parameters) if self.route.has_arrived else {"mode": "speed", "values": rates}
        page = {
            "position_m": list(place.position_m),
            "heading_rad": place.heading_rad,
            "reached": self.route.reached,
            "left_m": self.route.left_m(place.position_m),
        }
        return [self.store_data_task("drive", drive), self.store_data_task("place", page)]
