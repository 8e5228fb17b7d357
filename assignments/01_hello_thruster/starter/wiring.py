"""Puts your endpoint into the vehicle, beside one that tells the surface what you do. Needs no change of yours.

Nothing in here is a secret: read it when your lab is done. A *factory* makes an endpoint for a node; `snr run` asks
`factories` in your file for them.
"""

from snr_sim import Endpoint, EndpointFactory, TaskType


def wired(endpoint_class):
    """Return the factories of a vehicle that runs this endpoint."""
    return [OneFactory(endpoint_class, "hello_thruster"), OneFactory(Teller, "teller")]


class OneFactory(EndpointFactory):
    def __init__(self, endpoint_class, name):
        super().__init__()
        self.endpoint_class = endpoint_class
        self.name = name

    def get(self, parent):
        return self.endpoint_class(self, parent, self.name)


class Teller(Endpoint):
    """Tells the pilot, who begins when the vehicle is heard of. It has no say in what the thrusters do."""

    def on_imu(self, task, task_id):
        controls = self.get_data("controls") or {"is_armed": False, "number": 0}
        imu = self.get_data("imu")
        vehicle = {
            "rules": "pilot" if controls["is_armed"] else "idle",
            "mode": "manual",
            "is_armed": controls["is_armed"],
            "is_stopped": False,
            "number": controls["number"],
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

    task_handlers = {(TaskType.process_data, "imu"): on_imu}
