"""Turns the vehicle to the heading that is asked for, and keeps it there."""

from laws import turn_moment_nm
from shared import BOARD

from snr_sim import Endpoint, handles


class Heading(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.target_rad = None

    @handles("imu")
    def on_imu(self, imu):
        controls = self.get_data("controls")
        if controls is None:
            return
        BOARD["is_armed"] = controls["is_armed"]
        BOARD["moment_nm"] = 0.0
        if not controls["is_armed"]:
            self.target_rad = None
            return
        if controls["heading_rad"] is not None:  # the pilot sends it in one page only
            self.target_rad = controls["heading_rad"]
        if self.target_rad is None:
            self.target_rad = imu["yaw_rad"]
        BOARD["moment_nm"] = turn_moment_nm(self.target_rad, imu["yaw_rad"], imu["rate_radps"][2])


def factories(robot):
    return [Heading.factory()]
