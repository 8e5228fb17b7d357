"""Add your endpoint and a status publisher to the vehicle's node. Do not change this file.

You can read it when your lab is done. A *factory* creates an endpoint for a node; `snr run` gets the factories from
`factories` in your file.
"""

from snr_sim import Endpoint, handles


def wired(endpoint_class):
    """Return the factories of a vehicle that runs this endpoint."""
    return [endpoint_class.factory("hello_thruster"), StatusPublisher.factory()]


class StatusPublisher(Endpoint):
    """Publish the vehicle's status, which the pilot waits for. It does not control the thrusters."""

    @handles("imu")
    def on_imu(self, imu):
        controls = self.get_data("controls") or {"is_armed": False, "number": 0}
        vehicle = {
            "control_state": "pilot" if controls["is_armed"] else "idle",
            "mode": "manual",
            "is_armed": controls["is_armed"],
            "is_stopped": False,
            "number": controls["number"],
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
