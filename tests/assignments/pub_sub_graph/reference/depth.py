"""Brings the vehicle to the depth that is asked for, and keeps it there.

page "controls" --> the depth wanted ----.
page "depth" -----> depth and its rate --+
page "imu" comes, 50 times a second -----+--> page "lift"
"""

from laws import Rate, lift_force_n

from snr_sim import Endpoint, handles


class DepthHold(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.target_m = None
        self.is_armed = False
        self.depth_m = None
        self.rate = Rate()

    @handles("controls")
    def on_controls(self, controls):
        self.is_armed = controls["is_armed"]
        if not self.is_armed:
            self.target_m = None
        elif controls["depth_m"] is not None:
            self.target_m = controls["depth_m"]

    @handles("imu")
    def on_imu(self, imu):
        depth = self.get_data("depth")
        if depth is None:
            return None
        rate_mps = self.rate.update(depth["depth_m"], depth["stamp_s"])
        force_n = 0.0
        if self.is_armed:
            if self.target_m is None:
                self.target_m = depth["depth_m"]
            force_n = lift_force_n(self.target_m, depth["depth_m"], rate_mps)
        return self.store_data_task("lift", {"stamp_s": imu["stamp_s"], "force_n": force_n})


def factories(robot):
    return [DepthHold.factory()]
