"""The vehicle's status page; the pilot starts when it receives one. Do not change this file."""


def vehicle_status(controls, target_m, is_stopped, imu):
    """Return the page "vehicle"."""
    is_armed = controls is not None and controls["is_armed"] and not is_stopped
    return {
        "control_state": "pilot" if is_armed else "idle",
        "mode": "depth_hold",
        "is_armed": is_armed,
        "is_stopped": is_stopped,
        "number": 0 if controls is None else controls["number"],
        "age_s": None,
        "is_leaking": False,
        "is_battery_low": False,
        "rejected_command": "",
        "depth_m": target_m,
        "heading_rad": None,
        "thrust_scale": 1.0,
        "attitude_rad": [imu["roll_rad"], imu["pitch_rad"], imu["yaw_rad"]],
    }
