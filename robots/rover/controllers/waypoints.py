"""Drives along the way points of its parameters, and stops at the last one.

pages "motor_...", "imu" --> Odometry --> page "odometry" --.
page "gps" -------------------------------------------------+--> navigation.py --> pages "drive" and "navigation"

page "navigation": state (waiting for a fix, driving, arrived), position_m [x, y] on the map's plane, heading_rad,
                   offset_rad (of the compass), reached (way points so far), left_m (to the next one)
"""

from __future__ import annotations

from typing import Any

from snr_sim_robot_rover.drive import full_brake, wheel_rates
from snr_sim_robot_rover.navigation import Place, RouteFollower
from snr_sim_robot_rover.odometry import Odometry
from snr_sim_robot_rover.parameters import RoverParameters

from snr_sim import Endpoint, EndpointFactory, SomeTasks, handles
from snr_sim.scenario import RobotInfo


def factories(robot: RobotInfo) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    return [Odometry.factory(parameters=robot.parameters), Navigator.factory(parameters=robot.parameters)]


class Navigator(Endpoint):
    """Sets the wheels after each page "odometry"."""

    parameters: RoverParameters

    def begin(self) -> None:
        """Wait for the first fix."""
        self.plane = self.parameters.gps.plane()
        self.place = Place()
        self.route = RouteFollower([self.plane.local(*point)[:2] for point in self.parameters.route])
        self.fixed_s: float | None = None

    @handles("gps")
    def on_gps(self, gps: dict[str, Any]) -> None:
        """Correct the place."""
        since_s, self.fixed_s = self.fixed_s, gps["stamp_s"]
        if since_s is not None and gps["stamp_s"] > since_s:
            # A receiver may leave out both: some firmware has no altitude, and at rest there is no course.
            x, y, _ = self.plane.local(gps["latitude_deg"], gps["longitude_deg"], gps["altitude_m"] or 0.0)
            self.place.fix((x, y), gps["course_rad"], gps["stamp_s"] - since_s)

    @handles("odometry")
    def on_odometry(self, odometry: dict[str, Any]) -> SomeTasks:
        """Drive on, and say where the rover is."""
        place, route = self.place, self.route
        x, y = odometry["position_m"]
        place.move((x, y), odometry["yaw_rad"], odometry["speed_mps"], odometry["stamp_s"])
        is_waiting = self.fixed_s is None
        speed_mps, turn_radps = (
            (0.0, 0.0) if is_waiting else route.steer(place.position_m, place.heading_rad, odometry["speed_mps"])
        )
        if is_waiting or route.has_arrived:
            drive = full_brake(self.parameters)
        else:
            rates = wheel_rates(self.parameters, speed_mps, turn_radps, odometry["track_factor"])
            drive = {"mode": "speed", "values": rates}
        navigation = {
            "state": "waiting" if is_waiting else "arrived" if route.has_arrived else "driving",
            "position_m": list(place.position_m),
            "heading_rad": place.heading_rad,
            "offset_rad": place.offset_rad,
            "reached": route.reached,
            "left_m": route.left_m(place.position_m),
        }
        return [self.store_data_task("drive", drive), self.store_data_task("navigation", navigation)]
