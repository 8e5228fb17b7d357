"""At the vehicle: applies the surface's commands while they are fresh.

page "controls" --> the newest command --.
page "imu" comes, 50 times a second ------+--> page "pwm", and five times less often page "vehicle"
"""

import math

from telling import vehicle_status
from thrusters import neutral_us, pulses_us

from snr_sim import Endpoint, handles

COUNTS_S = 0.45  # how long a command counts after it was made
IMU_PAGES_PER_STATUS = 5  # answers to "imu"


class Vehicle(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.command = None
        self.made_s = -math.inf
        self.answers = 0

    @handles("controls")
    def on_controls(self, controls):
        made_s = self.get_time_s() - self.get_age_s("controls")
        if made_s > self.made_s:
            self.command, self.made_s = controls, made_s

    @handles("imu")
    def on_imu(self, imu):
        counts = self.counts()
        is_armed = self.command is not None and self.command["is_armed"]
        pulses = neutral_us()
        if counts:
            pulses = pulses_us(self.command["surge"], self.command["yaw"])
        answer = [self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": is_armed}, process=False)]
        self.answers += 1
        if self.answers % IMU_PAGES_PER_STATUS == 1:
            answer.append(self.store_data_task("vehicle", vehicle_status(self.command, counts, imu)))
        return answer

    def counts(self):
        """Return whether the newest command counts now."""
        if self.command is None or not self.command["is_armed"]:
            return False
        return self.get_time_s() - self.made_s <= COUNTS_S
