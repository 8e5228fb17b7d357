"""Makes pulses out of what the others want."""

from laws import STOP_US, pulses_us
from shared import BOARD

from snr_sim import Endpoint, handles


class Mixer(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.force_n = 0.0

    @handles("imu")
    def on_imu(self, imu):
        is_armed = BOARD["is_armed"]
        pulses = pulses_us(BOARD["moment_nm"], self.force_n) if is_armed else [STOP_US] * 8
        return self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": is_armed}, process=False)


def factories(robot):
    return [Mixer.factory()]
