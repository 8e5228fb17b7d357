"""The vehicle's own mind: from controls and sensor pages to pulses.

page "controls" --> guard: whose word counts --.
page "imu" ------> holds: wrench --> allocation: thrusts --> slew limit --> curve: pulses --> page "pwm"
page "depth" ----'                                                     `--> page "vehicle": what it is doing
pages "leak", "power" --> guard
"""

from __future__ import annotations

import math
from typing import Any

import msgspec

from snr_sim import Endpoint, EndpointFactory, Node, SomeTasks, Task, TaskId, TaskType
from snr_sim.plants.t200 import curve
from snr_sim.prelude.errors import CommandError, UnknownName
from snr_sim.prelude.signals import DepthReading, ImuReading, PowerReading
from snr_sim.std_mods.allocation import Allocation
from snr_sim.std_mods.slew import SlewLimit
from snr_sim.std_mods.thrust_curve import ThrustCurve

from .controls import Controls, controls_of
from .guard import Guard
from .holds import Holds
from .parameters import UrovParameters

TOLD_EVERY_S = 0.1  # and whenever something else than numbers changes
SURFACE_M = 0.2  # where going up ends: the top of the vehicle is just out of the water
BLIND_S = 0.5  # age of the newest depth from which the vehicle does not know how deep it is
NEAR_SURFACE_M = 0.3  # less deep than this, buoyancy does the rest of the way up, unless the vehicle has taken in water


class AutopilotFactory(EndpointFactory):
    """Makes the vehicle's mind.

    Args:
        parameters: of the vehicle.
    """

    def __init__(self, parameters: UrovParameters) -> None:
        super().__init__()
        self.parameters = parameters

    def get(self, parent: Node) -> Autopilot:
        """Returns a new one, disarmed."""
        return Autopilot(self, parent, "autopilot")


class Autopilot(Endpoint):
    """Answers every reading of the inertial unit with pulses."""

    factory: AutopilotFactory

    def __init__(self, factory: AutopilotFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        parameters = factory.parameters
        self.parameters = parameters
        self.guard = Guard(parameters.guard)
        self.thruster = ThrustCurve(*curve(parameters.nominal_v)[:2])
        self.allocation = Allocation(
            parameters.vehicle.thruster_matrix(), self.thruster.limits_n, first=parameters.first
        )
        self.still = [0.0] * self.allocation.count
        self.slew = SlewLimit(parameters.slew_nps, self.still)
        vehicle = parameters.vehicle
        drag = vehicle.linear_damping[2], vehicle.quadratic_damping[2]
        self.holds = Holds(parameters.holds, drag, self.allocation.lacking)
        self.before_s: float | None = None
        self.rules = "idle"
        self.kept: tuple[float, float] = (0.0, 0.0)  # depth and heading while a pilot was heard
        self.share = 1.0
        self.refused = ""
        self.is_blind = False
        self.were_active = False  # the outputs, since they were armed
        self.told_s = -math.inf
        self.task_handlers = {
            (TaskType.process_data, "controls"): self.on_controls,
            (TaskType.process_data, "leak"): self.on_leak,
            (TaskType.process_data, "power"): self.on_power,
            (TaskType.process_data, "imu"): self.on_imu,
        }

    def on_controls(self, task: Task, task_id: TaskId) -> None:
        """Hears the surface. What is no command is not obeyed, and told; soon there is none, and nothing pushes."""
        try:
            controls = controls_of(self.get_data("controls"))
        except (CommandError, UnknownName) as error:
            if not self.refused:  # each value would be a note of its own, twenty times a second
                self.parent.note(f"Controls were refused: {error.message}")
            self.refused = error.message
            return
        age_s = self.get_age_s("controls")
        if not age_s <= self.parameters.guard.stale_s and not controls.is_stop:
            return  # held up on its way, or nobody knows when it was made: only to stop it is never too late
        self.refused = ""
        if self.allocation.lacking and controls.mode != self.guard.controls.mode and controls.mode != "manual":
            self.parent.note(f"The thrusters cannot push {', '.join(self.allocation.lacking)}: that is not held.")
        now_s = self.get_time_s()
        self.guard.hear(controls, now_s - age_s if math.isfinite(age_s) else now_s)

    def on_leak(self, task: Task, task_id: TaskId) -> None:
        """Notes water in the hull."""
        self.guard.is_wet = self.guard.is_wet or self.get_data("leak")["is_wet"]

    def on_power(self, task: Task, task_id: TaskId) -> None:
        """Watches the battery."""
        was_low = self.guard.is_low
        self.guard.measure(PowerReading(**self.get_data("power")))
        if self.guard.is_low and not was_low:
            limits = self.guard.limits
            does = "the vehicle comes up" if limits.surfaces_on_low else "charge it"
            self.parent.note(
                f"The battery is low: for {limits.low_s:g} s it had less than {limits.low_v:g} V at rest; {does}."
            )

    def on_imu(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Answers with pulses, and now and then with what it is doing."""
        depth_data = self.get_data("depth")
        if depth_data is None:
            return None
        now_s = self.get_time_s()
        depth, imu = DepthReading(**depth_data), ImuReading(**self.get_data("imu"))
        self._watch_outputs()
        rules = self.guard.rules(now_s)
        dt_s = now_s - self.before_s if self.before_s is not None else 0.0
        self.before_s = now_s
        changed, self.rules = rules != self.rules, rules
        self._see(self.get_age_s("depth"))
        thrusts = self.slewed(self.thrusts(rules, depth, imu, dt_s), dt_s) if dt_s > 0.0 else self.still
        pulses = [self.thruster.pulse_us(thrust) for thrust in thrusts]
        command = {"pulses_us": pulses, "is_armed": rules != "idle", "is_stop": self.guard.is_stopped}
        answer = [self.store_data_task("pwm", command, process=False)]
        if changed or now_s - self.told_s >= TOLD_EVERY_S - 1e-9:
            self.told_s = now_s
            answer.append(self.store_data_task("vehicle", self.told(now_s, imu)))
        return answer

    def _watch_outputs(self) -> None:
        """Notices outputs that have let go while they should push: nobody arms them again but who disarms first."""
        page = self.parent.datastore.get("pwm_applied")
        if page is None:
            return
        state = page.data["state"]
        if state == "active" and self.rules != "idle":
            self.were_active = True
        elif self.rules == "idle":
            self.were_active = False
        elif self.were_active and state in ("inactive", "error"):
            self.guard.let_go = page.data["fault"] or "the outputs have disarmed by themselves"

    def _see(self, age_s: float) -> None:
        """Notices that depth is no longer measured, and that it is again."""
        is_blind = age_s > BLIND_S
        if is_blind and not self.is_blind:
            self.parent.note(
                f"Depth is not known, t = {self.get_time_s():.2f} s: it is no longer held, heave is as told."
            )
        self.is_blind = is_blind

    def slewed(self, wanted_n: list[float], dt_s: float) -> list[float]:
        """Returns thrusts on their way to those wanted. To nothing at all there is no way: that is obeyed at once."""
        if not any(wanted_n):
            self.slew.reset()
        return self.slew.update(wanted_n, dt_s)

    def thrusts(self, rules: str, depth: DepthReading, imu: ImuReading, dt_s: float) -> list[float]:
        """Returns the thrusts that are wanted now, by whose word counts."""
        is_there = depth.depth_m < NEAR_SURFACE_M and not self.is_blind
        floats = rules == "surface" and not self.guard.is_wet and is_there
        if rules in ("idle", "neutral") or floats:
            self.holds.let_go()
            return self.still
        if rules == "pilot":
            controls = self.guard.controls
            self.kept = depth.depth_m, imu.yaw_rad
        else:
            wanted_m = self.kept[0] if rules == "hold" else SURFACE_M
            controls = Controls(mode="heading_hold", depth_m=wanted_m, heading_rad=self.kept[1])
        if self.is_blind and controls.mode != "manual":
            controls = msgspec.structs.replace(controls, mode="stabilise")  # of itself it floats up, slowly
        thrusts, self.share, _ = self.allocation.allocate(self.holds.wrench(controls, depth, imu, dt_s))
        return thrusts

    def told(self, now_s: float, imu: ImuReading) -> dict[str, Any]:
        """Returns what the surface is told about the vehicle."""
        guard, holds = self.guard, self.holds
        return {
            "rules": self.rules,
            "mode": guard.controls.mode,
            "is_armed": guard.controls.is_armed and not (guard.is_stopped or guard.let_go),
            "let_go": guard.let_go,
            "is_stopped": guard.is_stopped,
            "number": guard.controls.number,
            "age_s": guard.age_s(now_s),
            "is_wet": guard.is_wet,
            "is_low": guard.is_low,
            "is_blind": self.is_blind,
            "refused": self.refused,
            "depth_m": holds.depth_m,
            "heading_rad": holds.heading_rad,
            "share": self.share,
            "attitude_rad": [imu.roll_rad, imu.pitch_rad, imu.yaw_rad],
        }
