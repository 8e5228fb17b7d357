"""What the vehicle tells the surface about itself: page "vehicle", ten times a second. Needs no change of yours."""

from snr_sim import Endpoint, EndpointFactory, TaskType

EVERY = 5  # answers to "imu"


class TellingFactory(EndpointFactory):
    def get(self, parent):
        return Telling(self, parent, "telling")


class Telling(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.count = 0
        self.task_handlers = {(TaskType.process_data, "imu"): self.on_imu}

    def on_imu(self, task, task_id):
        self.count += 1
        if self.count % EVERY != 1:
            return None
        controls, imu = self.get_data("controls"), self.get_data("imu")
        is_armed = controls is not None and controls["is_armed"]
        vehicle = {
            "rules": "pilot" if is_armed else "idle",
            "mode": "heading_hold",
            "is_armed": is_armed,
            "is_stopped": False,
            "number": 0 if controls is None else controls["number"],
            "age_s": None,
            "is_wet": False,
            "is_low": False,
            "refused": "",
            "depth_m": None,
            "heading_rad": None,
            "share": 1.0,
            "attitude_rad": [imu["roll_rad"], imu["pitch_rad"], imu["yaw_rad"]],
        }
        return self.store_data_task("vehicle", vehicle)
