"""Steers the vehicle by page "target" from any component. Do not change this file.

page "target" --> sticks ahead and sideways, depth --> the vehicle's own autopilot --> page "pwm"

    mode      track: bring the target to the middle; stop: push nowhere; search: rise, so that more can be seen
    right_px  how far right of the middle of the picture the target is
    down_px   how far below it; what is ahead of the vehicle is at the top
    stamp_s   when that was seen
"""

import msgspec
from snr_sim_robot_urov.autopilot import Autopilot, AutopilotFactory

STICK_PER_PX = 0.012
STICK_PER_PX_PER_S = 0.02  # against how fast the target moves
MAX_STICK = 0.5
SMOOTHING_S = 0.3
RISE_MPS, RISE_M = 0.1, 1.0  # while it searches, above the depth at which it lost the target
OLD_S = 1.0  # an older page is ignored


class SteerFactory(AutopilotFactory):
    def get(self, parent):
        return Steer(self, parent, "steer")


class Steer(Autopilot):
    """The vehicle's autopilot, with a hand of its own at the sticks."""

    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.seen = None
        self.speeds = [0.0, 0.0]
        self.target_m = None
        self.risen_m = 0.0

    def thrusts(self, control_state, depth, imu, dt_s):
        if control_state == "pilot":
            asked = self.failsafe.controls
            if asked.depth_m is not None:
                self.target_m = asked.depth_m
            ahead, left = self.sticks()
            target_m = None if self.target_m is None else max(0.5, self.target_m - self.risen_m)
            self.failsafe.controls = msgspec.structs.replace(asked, surge=ahead, sway=left, depth_m=target_m)
        return super().thrusts(control_state, depth, imu, dt_s)

    def sticks(self):
        """Return what to push ahead and to the left, -1 to 1; and rises while it searches."""
        target = self.get_data("target")
        mode = "stop" if target is None or self.get_age_s("target") > OLD_S else target["mode"]
        step_m = RISE_MPS / 50.0
        if mode == "search":
            self.risen_m = min(RISE_M, self.risen_m + step_m)
        elif mode == "track":
            self.risen_m = max(0.0, self.risen_m - step_m)
        if target is None or mode != "track":
            self.seen, self.speeds = None, [0.0, 0.0]
            return 0.0, 0.0
        errors = [target["down_px"], target["right_px"]]
        if self.seen is not None and target["stamp_s"] > self.seen[0]:
            period_s = target["stamp_s"] - self.seen[0]
            for i in range(2):
                speed = (errors[i] - self.seen[1][i]) / period_s
                self.speeds[i] += (speed - self.speeds[i]) * period_s / (period_s + SMOOTHING_S)
        if self.seen is None or target["stamp_s"] > self.seen[0]:
            self.seen = (target["stamp_s"], errors)
        pushes = [-STICK_PER_PX * errors[i] - STICK_PER_PX_PER_S * self.speeds[i] for i in range(2)]
        return [min(MAX_STICK, max(-MAX_STICK, push)) for push in pushes]
