"""At the vehicle: applies the surface's commands while they are fresh.

page "controls" --> the newest command --.
page "imu" comes, 50 times a second ------+--> page "pwm", and five times less often page "vehicle"
"""

from telling import vehicle_status
from thrusters import neutral_us, pulses_us

from snr_sim import Endpoint, handles

COUNTS_S = 0.45  # how long a command counts after it was made
IMU_PAGES_PER_STATUS = 5  # answers to "imu"


class Vehicle(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.command = None
        self.answers = 0

    @handles("controls")
    def on_controls(self, controls):
        # Step 3: a page that has overtaken another one is followed by an older one.
        self.command = controls

    @handles("imu")
    def on_imu(self, imu):
        counts = self.counts()
        is_armed = self.command is not None and self.command["is_armed"]
        pulses = neutral_us()
        if self.command is not None and counts:
            pulses = pulses_us(self.command["surge"], self.command["yaw"])
        answer = [self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": is_armed}, process=False)]
        self.answers += 1
        if self.answers % IMU_PAGES_PER_STATUS == 1:
            answer.append(self.store_data_task("vehicle", vehicle_status(self.command, counts, imu)))
        return answer

    def counts(self):
        """Return whether the newest command counts now."""
        # Step 3: how old is it?
        return self.command is not None and self.command["is_armed"]
