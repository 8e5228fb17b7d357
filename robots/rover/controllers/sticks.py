"""Drives as a person's sticks say, and says which of their commands count.

page "controls" --> which command counts --.
page "imu" -----------------------------> sticks to wheels --> page "drive", page "vehicle"
pages "motor_..." -----------------------'

    idle      brakes: disarmed, or an emergency stop that is not yet cleared
    neutral   brakes: the newest controls are older than a command of the motors may be, as when the link is cut
    pilot     the sticks apply

Idle is a command for neutral, which arms motors that were lost and found again. In neutral it has values, those of
brakes, and does not arm.
"""

from __future__ import annotations

import math
from typing import Any

from snr_sim_robot_rover.controls import Controls, controls_of
from snr_sim_robot_rover.drive import HeadingLoop, braked, full_brake, side_values, wheel_rates
from snr_sim_robot_rover.odometry import Odometry
from snr_sim_robot_rover.parameters import RoverParameters
from snr_sim_robot_rover.sticks import arcade, curve, tank

from snr_sim import Endpoint, EndpointFactory, SomeTasks, Task, handles
from snr_sim.errors import CommandError, UnknownNameError
from snr_sim.scenario import RobotInfo
from snr_sim.teleop import NewestControls

TELEMETRY_PERIOD_S = 0.1  # and whenever the state changes


def factories(robot: RobotInfo) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    return [Odometry.factory(parameters=robot.parameters), SticksDriver.factory(parameters=robot.parameters)]


class SticksDriver(Endpoint):
    """Answers every reading of the inertial unit with a command of the wheels."""

    parameters: RoverParameters

    def begin(self) -> None:
        """Begin disarmed."""
        self.newest = NewestControls(Controls(), self.parameters.drive_timeout_s)
        self.heading = HeadingLoop()
        self.rejected_command = ""
        self.before_s: float | None = None
        self.sent: tuple[str, bool, str] | None = None
        self.sent_s = -math.inf

    @handles("controls", task=True)
    def on_controls(self, task: Task) -> None:
        """Take a command from the surface; an invalid one is reported and not applied, an old one may only stop."""
        try:
            controls = controls_of(self.get_data("controls"))
        except (CommandError, UnknownNameError) as error:
            if not self.rejected_command:  # else it would be twenty notes a second
                self.parent.add_note(f"Controls were rejected: {error.message}")
            self.rejected_command = error.message
            return
        self.rejected_command = ""
        old_s = self.get_age_s("controls")
        if old_s <= self.parameters.drive_timeout_s or controls.is_stop:
            now_s = self.get_time_s()
            self.newest.take(controls, now_s - old_s if math.isfinite(old_s) else now_s)

    @handles("imu")
    def on_imu(self, imu: dict[str, Any]) -> SomeTasks:
        """Set the wheels, and from time to time say in what state the rover is."""
        now_s = self.get_time_s()
        dt_s = 0.0 if self.before_s is None else now_s - self.before_s
        self.before_s = now_s
        state = self.control_state(now_s)
        if state != "pilot":
            self.heading.reset()
        drive = self.command(imu["yaw_rad"], dt_s) if state == "pilot" else self.brakes(state)
        tasks = [self.store_data_task("drive", drive)]
        summary = state, self.newest.is_stopped, self.rejected_command
        if summary != self.sent or now_s - self.sent_s >= TELEMETRY_PERIOD_S - 1e-9:
            self.sent, self.sent_s = summary, now_s
            tasks.append(self.store_data_task("vehicle", self.status(state, now_s)))
        return tasks

    def control_state(self, now_s: float) -> str:
        """Return whose word counts now, by the names above."""
        newest, age_s = self.newest, self.newest.age_s(now_s)
        if age_s is None or newest.is_stopped or not newest.controls.is_armed:
            return "idle"
        return "pilot" if age_s <= self.parameters.drive_timeout_s else "neutral"

    def brakes(self, state: str) -> dict[str, Any]:
        """Return the command of the wheels for a state without a pilot."""
        parameters = self.parameters
        count = len(parameters.vehicle.motor_wheels)
        return {"mode": "brake", "values": [] if state == "idle" else [parameters.neutral_a] * count}

    def command(self, yaw_rad: float, dt_s: float) -> dict[str, Any]:
        """Return the command of the wheels for the newest controls."""
        controls, parameters = self.newest.controls, self.parameters
        mode, brakes = controls.mode, [side for side in ("left", "right") if getattr(controls, f"brake_{side}")]
        if len(brakes) == 2:
            self.heading.reset()
            return full_brake(parameters)
        sides = tank(controls.left, controls.right) if controls.left or controls.right else None
        turn_radps = curve(controls.turn) * parameters.limit_radps
        speed_mps = curve(controls.ahead) * parameters.limit_mps
        if mode == "speed" and sides is None and not brakes and (speed_mps or turn_radps):
            turn_radps = self.heading.turn_radps(turn_radps, yaw_rad, dt_s)
            return {"mode": mode, "values": wheel_rates(parameters, speed_mps, turn_radps)}
        self.heading.reset()
        sides = sides or arcade(controls.ahead, controls.turn)
        values = side_values(parameters, mode, sides)
        return {"mode": mode, "values": braked(parameters, mode, values, brakes, self.wheel_speeds())}

    def wheel_speeds(self) -> list[float]:
        """Return the newest speed of each wheel [rad/s]; 0 before the first."""
        readings = [self.get_data(f"motor_{wheel.name}") for wheel in self.parameters.vehicle.motor_wheels]
        return [0.0 if reading is None else reading["speed_radps"] for reading in readings]

    def status(self, state: str, now_s: float) -> dict[str, Any]:
        """Return page "vehicle"."""
        controls = self.newest.controls
        return {
            "control_state": state,
            "mode": controls.mode,
            "is_armed": state != "idle",
            "is_stopped": self.newest.is_stopped,
            "number": controls.number,
            "age_s": self.newest.age_s(now_s),
            "rejected_command": self.rejected_command,
        }
