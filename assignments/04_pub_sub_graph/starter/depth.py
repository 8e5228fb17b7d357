"""Brings the vehicle to the depth that is asked for, and keeps it there."""

from typing import Any

from laws import Rate, lift_force_n
from shared import BOARD

from snr_sim import Endpoint, handles


class DepthHold(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.mixer: Any = parent.components["mixer"]
        self.target_m = None
        self.rate = Rate()

    @handles("imu")
    def on_imu(self, imu):
        controls, depth = self.get_data("controls"), self.get_data("depth")
        if controls is None or depth is None:
            return
        rate_mps = self.rate.update(depth["depth_m"], depth["stamp_s"])
        self.mixer.force_n = 0.0
        if not BOARD["is_armed"]:
            self.target_m = None
            return
        if controls["depth_m"] is not None:  # the pilot sends it in one page only
            self.target_m = controls["depth_m"]
        if self.target_m is None:
            self.target_m = depth["depth_m"]
        self.mixer.force_n = lift_force_n(self.target_m, depth["depth_m"], rate_mps)


def factories(robot):
    return [DepthHold.factory()]
