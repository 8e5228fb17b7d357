"""Drives ahead, holds its heading, and stops on the first steep slope.

page "imu":   pitch_rad (negative uphill), yaw_rad, stamp_s
page "drive": mode, values: six rates of wheels [rad/s], or currents of brakes [A]
"""

from __future__ import annotations

from typing import Any

from snr_sim_robot_rover.drive import full_brake, wheel_rates
from snr_sim_robot_rover.parameters import RoverParameters

from snr_sim import Endpoint, EndpointFactory, SomeTasks, handles
from snr_sim.scenario import RobotInfo, wrap_rad


def factories(robot: RobotInfo) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    return [Climb.factory(parameters=robot.parameters)]


class Climb(Endpoint):
    """Sets the wheels after each reading of the inertial unit."""

    parameters: RoverParameters
    speed_mps: float = 0.9
    steep_rad: float = 0.2  # 11 degrees
    after_s: float = 3.0  # on the slope
    turn_per_s: float = 1.0  # how fast it turns back to its heading

    def begin(self) -> None:
        """Begin to drive, to where it looks."""
        self.heading_rad: float | None = None
        self.steep_since_s: float | None = None
        self.has_arrived = False

    @handles("imu")
    def on_imu(self, imu: dict[str, Any]) -> SomeTasks:
        """Drive on, or brake once it is on the slope."""
        if self.heading_rad is None:
            self.heading_rad = imu["yaw_rad"]
        self.note_slope(-imu["pitch_rad"], imu["stamp_s"])
        if self.has_arrived:
            return self.store_data_task("drive", full_brake(self.parameters))
        turn_radps = self.turn_per_s * wrap_rad(self.heading_rad - imu["yaw_rad"])
        rates = wheel_rates(self.parameters, self.speed_mps, turn_radps)
        return self.store_data_task("drive", {"mode": "speed", "values": rates})

    def note_slope(self, up_rad: float, now_s: float) -> None:
        """Note since when the ground is steep; it has arrived when it has been for long enough."""
        if up_rad < self.steep_rad:
            self.steep_since_s = None
        elif self.steep_since_s is None:
            self.steep_since_s = now_s
        elif now_s - self.steep_since_s > self.after_s:
            self.has_arrived = True
