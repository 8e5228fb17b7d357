"""Drives as the stick says. After a restart it brakes until a person moves the stick again.

page "stick": speed_mps, and made_s: when a person moved it, in seconds of the rover's clock. The state manager sends
              the last one again to a process that starts, so the first may be old. They may also overtake each other.
page "imu":   stamp_s, the rover's clock; 50 times a second
page "drive": what the motors do: mode "brake" with six currents, or "speed" with six rates of wheels
"""

from snr_sim import Endpoint, handles

ROLLING_M = 0.1255
LEASE_S = 0.2  # a command counts for so long
BRAKE = {"mode": "brake", "values": [6.0] * 6}


def factories(robot):
    return [Drive.factory()]


class Drive(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.begun_s = None  # the rover's clock when this Drive began: that of the first page "imu"
        self.stick = None  # the newest command that counts

    @handles("stick")
    def on_stick(self, stick):
        # Step 6: which of them count?
        self.stick = stick

    @handles("imu")
    def on_imu(self, imu):
        # Step 7: and for how long?
        if self.stick is None:
            return self.store_data_task("drive", BRAKE)
        rate_radps = self.stick["speed_mps"] / ROLLING_M
        return self.store_data_task("drive", {"mode": "speed", "values": [rate_radps] * 6})
