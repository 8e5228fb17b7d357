"""The vehicle's status page. Do not change this file."""


def vehicle_status(command, counts, imu):
    """Return the page "vehicle": the newest command, and whether it counts."""
    return {
        "control_state": "pilot" if counts else "neutral",
        "mode": "manual",
        "is_armed": counts,
        "is_stopped": False,
        "number": 0 if command is None else command["number"],
        "age_s": None,
        "is_leaking": False,
        "is_battery_low": False,
        "rejected_command": "",
        "depth_m": None,
        "heading_rad": None,
        "thrust_scale": 1.0,
        "attitude_rad": [imu["roll_rad"], imu["pitch_rad"], imu["yaw_rad"]],
    }
