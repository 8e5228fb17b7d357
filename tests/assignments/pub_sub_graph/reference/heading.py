"""Turns the vehicle to the heading that is asked for, and keeps it there.

page "controls" --> the heading wanted --.
page "imu" comes, 50 times a second -----+--> page "turn"
"""

from laws import turn_moment_nm

from snr_sim import Endpoint, handles


class Heading(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.target_rad = None
        self.is_armed = False

    @handles("controls")
    def on_controls(self, controls):
        self.is_armed = controls["is_armed"]
        if not self.is_armed:
            self.target_rad = None
        elif controls["heading_rad"] is not None:
            self.target_rad = controls["heading_rad"]

    @handles("imu")
    def on_imu(self, imu):
        return self.store_data_task("turn", {"stamp_s": imu["stamp_s"], "moment_nm": self.moment_nm(imu)})

    def moment_nm(self, imu):
        if not self.is_armed:
            return 0.0
        if self.target_rad is None:
            self.target_rad = imu["yaw_rad"]
        return turn_moment_nm(self.target_rad, imu["yaw_rad"], imu["rate_radps"][2])


def factories(robot):
    return [Heading.factory()]
