"""Finds motors that are broken, by what the others do at the same time.

pages "motor_..." and "drive" --> MotorWatch --> page "motor_faults": faults, from the name of a motor to what it is:
    silent   its controller has sent nothing for `SILENT_S`
    drags    it pushes with all its current, and its wheel turns less than half as fast as it is asked to
    dead     it is asked to turn and takes hardly a current, while most others take some

A motor that is found broken stays so for the run. But for silence, only motors that are asked for speeds are judged,
and none after the first that is found broken, which shifts the load of the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from snr_sim import Endpoint, SomeTasks, Task, handles

from .parameters import RoverParameters

SILENT_S = 0.3
SUSTAINED_S = 0.8  # a wheel may hang on a rock, or in the air, for half a second
ASKED_RADPS = 1.0  # slower wheels say nothing
SLOW, FULL = 0.5, 0.9  # shares of the speed that is asked for, and of the largest current
LITTLE, SOME_A = 0.3, 0.3  # share of the others' current, and how much that is at least


class MotorJudge:
    """Judges motors by their readings.

    Args:
        limit_a: largest current of a motor.
    """

    def __init__(self, limit_a: float) -> None:
        self._limit_a = limit_a
        self._since_s: dict[tuple[str, str], float] = {}  # since when a motor has looked like this
        self.faults: dict[str, str] = {}

    def judge(
        self, now_s: float, asked_radps: Mapping[str, float], motors: Mapping[str, Any], ages_s: Mapping[str, float]
    ) -> bool:
        """Take the newest reading of each motor; return whether another one was found broken.

        Args:
            asked_radps: speed that each is asked for; empty if it is something else.
            motors: page of each.
            ages_s: of these pages.
        """
        before = len(self.faults)
        whole = [name for name in motors if name not in self.faults]
        currents_a = sorted(abs(motors[name]["current_a"]) for name in whole)
        others_a = currents_a[len(currents_a) // 2] if currents_a else 0.0
        for name in whole:
            looks = ""
            if name in asked_radps and not self.faults:
                looks = self._looks(asked_radps[name], motors[name], others_a)
            if ages_s[name] > SILENT_S:
                self.faults[name] = "silent"
            elif self._lasts(now_s, name, looks):
                self.faults[name] = looks
        return len(self.faults) > before

    def _looks(self, asked_radps: float, motor: Mapping[str, float], others_a: float) -> str:
        if abs(asked_radps) < ASKED_RADPS:
            return ""
        current_a = abs(motor["current_a"])
        if current_a > FULL * self._limit_a and motor["speed_radps"] / asked_radps < SLOW:
            return "drags"
        return "dead" if others_a > SOME_A and current_a < LITTLE * others_a else ""

    def _lasts(self, now_s: float, name: str, looks: str) -> bool:
        for fault in ("drags", "dead"):
            if fault != looks:
                self._since_s.pop((name, fault), None)
        return looks != "" and now_s - self._since_s.setdefault((name, looks), now_s) >= SUSTAINED_S


class MotorWatch(Endpoint):
    """Looks at the motors with each reading of the inertial unit."""

    parameters: RoverParameters

    def begin(self) -> SomeTasks:
        """Begin with all motors whole."""
        self.keys: Sequence[str] = [f"motor_{wheel.name}" for wheel in self.parameters.vehicle.motor_wheels]
        self.judge = MotorJudge(self.parameters.vehicle.motor.limit_a)
        return self.faults_task()

    @handles("imu")
    def on_imu(self, imu: dict[str, Any]) -> SomeTasks:
        """Look at all of them, and say when one is found broken."""
        drive = self.get_data("drive")
        motors = {key: reading for key in self.keys if (reading := self.get_data(key)) is not None}
        ages_s = {key: self.get_age_s(key) for key in motors}
        is_asked = drive is not None and drive["mode"] == "speed" and drive["values"]
        asked = dict(zip(self.keys, drive["values"], strict=True)) if is_asked else {}
        if not self.judge.judge(self.get_time_s(), asked, motors, ages_s):
            return None
        return self.faults_task()

    def faults_task(self) -> Task:
        """Return what stores the faults found so far."""
        return self.store_data_task("motor_faults", {"faults": dict(self.judge.faults)})
