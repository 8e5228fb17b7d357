"""Drives straight ahead, also when one of its motors breaks.

page "imu" --> heading by the gyroscope ----------------------------------------------------.
pages "motor_..." --> MotorWatch --> page "motor_faults" --> Odometry --> page "odometry" --> page "drive"
"""

from __future__ import annotations

from typing import Any

from snr_sim_robot_rover.drive import wheel_rates
from snr_sim_robot_rover.motor_watch import MotorWatch
from snr_sim_robot_rover.navigation import DeadReckoning, RouteFollower
from snr_sim_robot_rover.odometry import Odometry
from snr_sim_robot_rover.parameters import RoverParameters

from snr_sim import Endpoint, EndpointFactory, SomeTasks, handles
from snr_sim.scenario import RobotInfo

LINE_M = 1000.0  # longer than any drive


def factories(robot: RobotInfo) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    parameters = robot.parameters
    odometry = Odometry.factory(parameters=parameters, is_watched=True)
    return [MotorWatch.factory(parameters=parameters), odometry, Straight.factory(parameters=parameters)]


class Straight(Endpoint):
    """Sets the wheels after each page "odometry"."""

    parameters: RoverParameters

    def begin(self) -> None:
        """Begin at the start of the line."""
        self.place = DeadReckoning(self.parameters.stands_s)
        self.route = RouteFollower([(LINE_M, 0.0)])

    @handles("imu")
    def on_imu(self, imu: dict[str, Any]) -> None:
        """Follow the turning."""
        self.place.turn(imu["rate_radps"][2], imu["stamp_s"])

    @handles("odometry")
    def on_odometry(self, odometry: dict[str, Any]) -> SomeTasks:
        """Drive on along the line."""
        place, speed_mps = self.place, odometry["speed_mps"]
        if not place.move(speed_mps, odometry["stamp_s"]):
            return None
        wanted = self.route.steer(place.position_m, place.heading_rad, speed_mps)
        rates = wheel_rates(self.parameters, *wanted, odometry["track_factor"])
        return self.store_data_task("drive", {"mode": "speed", "values": rates})
