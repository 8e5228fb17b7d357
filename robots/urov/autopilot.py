"""Autopilot of the vehicle: from controls and sensor pages to pulses.

page "controls" --> failsafe: whose word counts --.
page "imu" ------> holds: wrench --> allocation: thrusts --> slew limit --> curve: pulses --> page "pwm"
page "depth" ----'                                                     `--> page "vehicle": its state
pages "leak", "power", "pwm_applied", "recording" --> failsafe: failures, and the actions (failsafes.py)
"""

from __future__ import annotations

import math
from typing import Any

import msgspec

from snr_sim import Endpoint, EndpointFactory, Loop, SomeTasks, Task, handles, tasks
from snr_sim.core.datastore import page_age_s
from snr_sim.errors import CommandError, UnknownNameError
from snr_sim.plants.urov.t200 import curve
from snr_sim.scenario import RECORDING_KEY, NodeApi
from snr_sim.signals import RESET, STOPPED, DepthReading, ImuReading
from snr_sim.std_mods import Allocation, SlewRateLimiter, ThrustCurve

from .controls import Controls, controls_of
from .failsafe_monitor import FailsafeMonitor
from .failsafes import CAUSES, describe_action
from .holds import HoldController
from .parameters import UrovParameters
from .prearm import PreArm, failing_checks
from .readings import Outputs, Readings, outputs_of

TELEMETRY_PERIOD_S = 0.1  # and whenever something else than numbers changes
SURFACE_M = 0.2  # where going up ends: the top of the vehicle is just out of the water
DEPTH_TIMEOUT_S = 0.5  # age of the newest depth from which the depth counts as unknown
ATTITUDE_TIMEOUT_S = 0.25  # age of the newest attitude from which nothing pushes, as of the newest controls
NEAR_SURFACE_M = 0.3  # above this depth buoyancy completes the ascent, unless the vehicle has taken in water
# The node is overloaded if readings have waited so long, for so long; and it is no more if none has for so long.
LATE_S, LATE_FOR_S, IN_TIME_S = 0.1, 0.5, 1.0
CAUSE_NOTES = 3  # limit, because a loose plug would be noted indefinitely
UNANSWERED_S = 0.1  # the inertial unit is answered with a command 50 times a second


class AutopilotFactory(EndpointFactory):
    """Factory of the autopilot of a vehicle, by which `robot.py` knows that its failsafes are ours."""

    def __init__(self, parameters: UrovParameters) -> None:
        super().__init__()
        self.parameters = parameters

    def get(self, parent: NodeApi) -> Autopilot:
        """Return a new one, disarmed."""
        return Autopilot(self, parent, "autopilot")


class Autopilot(Endpoint):
    """Answers every reading of the inertial unit with pulses."""

    factory: AutopilotFactory

    def __init__(self, factory: AutopilotFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.parameters = parameters = factory.parameters
        self.failsafe = FailsafeMonitor(parameters.failsafe_limits, parameters.failsafes)
        self.prearm = PreArm()
        self.readings = Readings(parameters.sensors.rates_hz)
        self.thruster = ThrustCurve(*curve(parameters.nominal_v)[:2])
        vehicle = parameters.vehicle
        self.allocation = Allocation(
            vehicle.thruster_matrix(), self.thruster.limits_n, priority_axes=parameters.priority_axes
        )
        self.still = [0.0] * self.allocation.count
        self.slew = SlewRateLimiter(parameters.slew_nps, self.still)
        drag = vehicle.linear_damping[2], vehicle.quadratic_damping[2]
        self.holds = HoldController(parameters.holds, drag, self.allocation.unactuated)
        self.before_s: float | None = None
        self.control_state = "idle"
        self.hold_target: tuple[float, float] = (0.0, 0.0)  # depth and heading while controls arrived
        self.thrust_scale = 1.0
        self.rejected_command = ""
        self.is_depth_stale = False
        self.were_active = False  # the outputs, since they were armed
        self.late_since_s: float | None = None
        self.late_s = -math.inf  # when readings were last late for long enough
        self.causes: dict[str, int] = dict.fromkeys(CAUSES, 0)  # how often each was noted
        self.noted: set[str] = set()  # active causes
        self.last_telemetry_s = -math.inf

    @handles("controls", task=True)
    def on_controls(self, task: Task) -> None:
        """Take a command from the surface.

        An invalid one is reported and not applied; without valid ones the vehicle soon stops pushing.
        """
        try:
            controls = controls_of(self.get_data("controls"))
        except (CommandError, UnknownNameError) as error:
            self._reject(error.message)
            return
        old_s = self.get_age_s("controls")
        if not old_s <= self.parameters.failsafe_limits.stale_s and not controls.is_stop:
            if controls.is_armed and not self.prearm.has_armed and math.isinf(old_s):
                self._reject("Not armed: clock: how far the surface's clock is from the vehicle's is not known.")
            return  # late, or of unknown age: only a stop is accepted then
        if self.allocation.unactuated and controls.mode != self.failsafe.controls.mode and controls.mode != "manual":
            axes = ", ".join(self.allocation.unactuated)
            self.parent.add_note(f"The thrusters cannot push {axes}: that is not held.")
        now_s = self.get_time_s()
        is_armed = controls.is_armed and not controls.is_stop
        refusal_reason = self.prearm.refusal_reason(is_armed, self._failing() if is_armed else [], now_s)
        if refusal_reason:
            self._reject(refusal_reason)
        else:
            self.rejected_command = ""
        if refusal_reason is not None:
            controls = msgspec.structs.replace(controls, is_armed=False, clears_stop=False)
        self.failsafe.on_controls(controls, now_s - old_s if math.isfinite(old_s) else now_s)

    def _reject(self, reason: str) -> None:
        """Report to the surface why its commands are refused; noted once, else it would be twenty notes a second."""
        if not self.rejected_command:
            self.parent.add_note(f"Controls were rejected: {reason}")
        self.rejected_command = reason

    def _failing(self) -> list[str]:
        """Return why the vehicle may not be armed; nothing once it has been."""
        if self.prearm.has_armed:
            return []
        return failing_checks(self.failsafe, self.readings, self._ages_s(), self._outputs())

    def _ages_s(self) -> dict[str, float]:
        return {key: page_age_s(self.parent, page) for key, page in self.readings.pages.items()}

    @handles("leak", task=True)
    def on_leak(self, task: Task) -> None:
        """Note water in the hull."""
        reading = self._take("leak", self.get_time_s())
        self.failsafe.is_leaking = self.failsafe.is_leaking or (reading is not None and reading.is_wet)

    @handles("power", task=True)
    def on_power(self, task: Task) -> None:
        """Watch the battery."""
        reading = self._take("power", self.get_time_s())
        if reading is not None:
            self.failsafe.on_power(reading)

    @handles("imu", task=True)
    def on_imu(self, task: Task) -> SomeTasks:
        """Answer with pulses, and periodically with the vehicle's state; also without a reading (`Watch`)."""
        now_s, page = self.get_time_s(), self.get_page("imu")
        if self.readings.take("imu", page, now_s) and page is not None:
            self._watch_lateness(now_s, page_age_s(self.parent, page))
        return self._answer(now_s)

    def _take(self, key: str, now_s: float) -> Any:
        """Return the reading that a sensor's newest page holds; None if the page is not valid."""
        page = self.get_page(key)
        self.readings.take(key, page, now_s)
        return self.readings.newest.get(key) if page is self.readings.pages.get(key) else None

    def _answer(self, now_s: float) -> SomeTasks:
        self._take("depth", now_s)
        depth, imu = self.readings.newest.get("depth"), self.readings.newest.get("imu")
        ages_s = self._ages_s()
        self._watch_outputs(now_s)
        self._check_causes(now_s, ages_s)
        control_state = self.failsafe.control_state(now_s)
        self._note_causes(now_s)
        dt_s = now_s - self.before_s if self.before_s is not None else 0.0
        self.before_s = now_s
        changed, self.control_state = control_state != self.control_state, control_state
        self.is_depth_stale = ages_s.get("depth", math.inf) > DEPTH_TIMEOUT_S
        thrusts = self.still
        if depth is not None and imu is not None and ages_s["imu"] <= ATTITUDE_TIMEOUT_S + 1e-9 and dt_s > 0.0:
            thrusts = self.slewed(self.thrusts(control_state, depth, imu, dt_s), dt_s)
        else:
            self.holds.reset()
            self.slew.reset()
        pulses = [self.thruster.pulse_us(thrust) for thrust in thrusts]
        command = {"pulses_us": pulses, "is_armed": control_state != "idle", "is_stop": self.failsafe.is_stopped}
        answer = [self.store_data_task("pwm", command, process=False)]
        if changed or now_s - self.last_telemetry_s >= TELEMETRY_PERIOD_S - 1e-9:
            self.last_telemetry_s = now_s
            answer.append(self.store_data_task("vehicle", self.telemetry(now_s, imu)))
        return answer

    # -- what fails ---------------------------------------------------------------------------------------------------

    def _outputs(self) -> Outputs | None:
        """Return the state of the outputs from the newest page of their loop; None if there is none."""
        page = self.parent.datastore.pages.get("pwm_applied")
        return None if page is None else outputs_of(page.data)

    def _watch_outputs(self, now_s: float) -> None:
        """Detect outputs that have disarmed themselves while they should push, and those that recover."""
        outputs = self._outputs()
        if outputs is None:
            return
        if outputs.state == "active" and self.control_state != "idle":
            self.were_active = True
        elif self.control_state == "idle":
            self.were_active = False
        elif self.were_active and outputs.state in ("inactive", "error"):
            words = outputs.fault or "the outputs have disarmed by themselves"
            self.failsafe.mark_outputs_lost(RESET in outputs.reason, words, STOPPED in outputs.reason, now_s)
        self.failsafe.update_outputs(outputs.state, now_s)

    def _watch_lateness(self, now_s: float, waited_s: float) -> None:
        """Notice a node that has more to do than it can: readings wait until they are answered."""
        if waited_s <= LATE_S:
            self.late_since_s = None
            return
        if self.late_since_s is None:
            self.late_since_s = now_s
        if now_s - self.late_since_s >= LATE_FOR_S:
            self.late_s = now_s

    def _check_causes(self, now_s: float, ages_s: dict[str, float]) -> None:
        """Report failures that the monitor cannot detect by itself."""
        update = self.failsafe.update_cause
        stale = self.readings.stale(ages_s)
        update("stale_sensor", f"no fresh reading of {stale}" if stale else "", now_s)
        update("nonsense", self.readings.nonsense(now_s), now_s)
        is_late = now_s - self.late_s <= IN_TIME_S
        update("overloaded", f"readings wait for more than {LATE_S:g} s" if is_late else "", now_s)
        page = self.parent.datastore.pages.get(RECORDING_KEY)  # quietly: a run that records well stores none
        data = page.data if page is not None and isinstance(page.data, dict) else {}
        update("disk_full", f"not recorded: {data['reason']}" if "reason" in data else "", now_s)

    def _note_causes(self, now_s: float) -> None:
        """Note each cause that begins, with the action; a limited number of times."""
        there = set(self.failsafe.since_s)
        for cause in CAUSES:
            if cause not in there - self.noted or self.causes[cause] > CAUSE_NOTES:
                continue
            self.causes[cause] += 1
            is_last = self.causes[cause] > CAUSE_NOTES
            text = "further occurrences are not noted" if is_last else self._describe(cause)
            self.parent.add_note(f"Failsafe {cause}, t = {now_s:.2f} s: {text}")
        self.noted = there

    def _describe(self, cause: str) -> str:
        failsafe = self.failsafe
        return f"{failsafe.words[cause]}; {describe_action(failsafe.failsafes.of(cause), failsafe.limits.hold_s)}"

    # -- what follows -------------------------------------------------------------------------------------------------

    def slewed(self, target_n: list[float], dt_s: float) -> list[float]:
        """Return thrusts with limited slew rate. If all are to be zero, they are so at once."""
        if not any(target_n):
            self.slew.reset()
        return self.slew.update(target_n, dt_s)

    def thrusts(self, control_state: str, depth: DepthReading, imu: ImuReading, dt_s: float) -> list[float]:
        """Return the thrusts for the current control state."""
        is_there = depth.depth_m < NEAR_SURFACE_M and not self.is_depth_stale
        floats = control_state == "surface" and not self.failsafe.is_leaking and is_there
        if control_state in ("idle", "neutral") or floats:
            self.holds.reset()
            return self.still
        if control_state == "pilot":
            controls = self.failsafe.controls
            self.hold_target = depth.depth_m, imu.yaw_rad
        else:
            target_m = self.hold_target[0] if control_state == "hold" else SURFACE_M
            controls = Controls(mode="heading_hold", depth_m=target_m, heading_rad=self.hold_target[1])
        if self.is_depth_stale and controls.mode != "manual":
            controls = msgspec.structs.replace(controls, mode="stabilise")  # of itself it floats up, slowly
        thrusts, self.thrust_scale, _ = self.allocation.allocate(self.holds.wrench(controls, depth, imu, dt_s))
        return thrusts

    def telemetry(self, now_s: float, imu: ImuReading | None) -> dict[str, Any]:
        """Return the vehicle's state for the surface; `failsafes` only if something has failed."""
        failsafe, holds = self.failsafe, self.holds
        failed = {cause: self._describe(cause) for cause in CAUSES if cause in failsafe.since_s}
        return {
            "control_state": self.control_state,
            "mode": failsafe.controls.mode,
            "is_armed": failsafe.controls.is_armed and not (failsafe.is_stopped or failsafe.output_fault),
            "output_fault": failsafe.output_fault,
            "is_stopped": failsafe.is_stopped,
            "number": failsafe.controls.number,
            "age_s": failsafe.age_s(now_s),
            "is_leaking": failsafe.is_leaking,
            "is_battery_low": failsafe.is_battery_low,
            "is_depth_stale": self.is_depth_stale,
            "rejected_command": self.rejected_command,
            "depth_m": holds.depth_m,
            "heading_rad": holds.heading_rad,
            "thrust_scale": self.thrust_scale,
            "attitude_rad": [0.0] * 3 if imu is None else [imu.roll_rad, imu.pitch_rad, imu.yaw_rad],
            **({"failsafes": failed} if failed else {}),
        }


class Watch(Loop):
    """Watchdog: runs the autopilot also without readings, so that outputs become neutral and the surface gets a reason.

    It repeats page 'imu' ten times a second while nothing is commanded; never in a healthy run.
    """

    max_tick_rate_hz = 10.0
    first_tick_after_s = 0.5

    def loop(self) -> None:
        """Check the age of the newest command."""
        page = self.parent.datastore.pages.get("pwm")
        if page is None or self.get_time_s() - page.created_at_s > UNANSWERED_S + 1e-9:
            self.schedule(tasks.process_data("imu"))
