"""Publishes the vehicle's status: page "vehicle", ten times a second. Do not change this file."""

from snr_sim import Endpoint, handles

IMU_PAGES_PER_STATUS = 5  # answers to "imu"


class StatusPublisher(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.count = 0

    @handles("imu")
    def on_imu(self, imu):
        self.count += 1
        if self.count % IMU_PAGES_PER_STATUS != 1:
            return None
        controls = self.get_data("controls")
        is_armed = controls is not None and controls["is_armed"]
        vehicle = {
            "control_state": "pilot" if is_armed else "idle",
            "mode": "heading_hold",
            "is_armed": is_armed,
            "is_stopped": False,
            "number": 0 if controls is None else controls["number"],
            "age_s": None,
            "is_leaking": False,
            "is_battery_low": False,
            "rejected_command": "",
            "depth_m": None,
            "heading_rad": None,
            "thrust_scale": 1.0,
            "attitude_rad": [imu["roll_rad"], imu["pitch_rad"], imu["yaw_rad"]],
        }
        return self.store_data_task("vehicle", vehicle)
