"""Moves the wrist of the arm outwards along a level line, and keeps the hand level. The rover stands.

page "arm":       angles_rad of the joints, stamp_s
page "arm_goals": angles_rad: base, shoulder, elbow, wrist_pitch, wrist_roll, grip
page "drive":     the brake
"""

from __future__ import annotations

from typing import Any

from snr_sim_robot_rover.arm import angles_rad
from snr_sim_robot_rover.drive import full_brake
from snr_sim_robot_rover.parameters import RoverParameters

from snr_sim import Endpoint, EndpointFactory, SomeTasks, handles
from snr_sim.scenario import RobotInfo


def factories(robot: RobotInfo) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    return [ArmLine.factory(parameters=robot.parameters)]


class ArmLine(Endpoint):
    """Sets the joints after each reading of them."""

    parameters: RoverParameters
    speed_mps: float = 0.05
    near_rad: float = 0.02  # so near to the beginning of the line it starts

    def begin(self) -> None:
        """Begin by going to the line."""
        self.began_s: float | None = None

    @handles("arm")
    def on_arm(self, arm: dict[str, Any]) -> SomeTasks:
        """Move on along the line."""
        height_m, from_m, to_m = self.parameters.arm_line_m
        way_m = 0.0 if self.began_s is None else self.speed_mps * (arm["stamp_s"] - self.began_s)
        angles = angles_rad(self.parameters.vehicle.arm, min(to_m, from_m + way_m), height_m)
        if angles is None:
            return None  # the line ends where the arm cannot reach
        shoulder, elbow = angles
        goals = [0.0, shoulder, elbow, -shoulder - elbow, 0.0, 0.0]
        is_there = max(abs(goal - now) for goal, now in zip(goals, arm["angles_rad"], strict=True)) < self.near_rad
        if self.began_s is None and is_there:
            self.began_s = arm["stamp_s"]
        hold = self.store_data_task("drive", full_brake(self.parameters))
        return [hold, self.store_data_task("arm_goals", {"angles_rad": goals})]
