"""A controller for the rover: sets the rates of its wheels after each reading of the inertial unit.

page "imu":   roll_rad, pitch_rad (positive: the nose goes down), yaw_rad (positive: to the left), stamp_s
page "drive": mode and values, one for each wheel: left front, middle, back, then right
"""

from snr_sim import Endpoint, handles


class ControllerTemplate(Endpoint):
    rate_radps = 5.0  # of each wheel

    @handles("imu")
    def on_imu(self, imu):
        return self.store_data_task("drive", {"mode": "speed", "values": [self.rate_radps] * 6})


def factories(robot):
    return [ControllerTemplate.factory()]
