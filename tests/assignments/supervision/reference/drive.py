from snr_sim import Endpoint, handles

ROLLING_M = 0.1255
LEASE_S = 0.2
BRAKE = {"mode": "brake", "values": [6.0] * 6}


def factories(robot):
    return [Drive.factory()]


class Drive(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.begun_s = None
        self.stick = None

    @handles("stick")
    def on_stick(self, stick):
        if self.begun_s is None or stick["made_s"] <= self.begun_s:
            return
        if self.stick is None or stick["made_s"] > self.stick["made_s"]:
            self.stick = stick

    @handles("imu")
    def on_imu(self, imu):
        if self.begun_s is None:
            self.begun_s = imu["stamp_s"]
        if self.stick is None or imu["stamp_s"] - self.stick["made_s"] > LEASE_S:
            return self.store_data_task("drive", BRAKE)
        rate_radps = self.stick["speed_mps"] / ROLLING_M
        return self.store_data_task("drive", {"mode": "speed", "values": [rate_radps] * 6})
