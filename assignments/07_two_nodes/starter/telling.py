"""What the vehicle tells the surface about itself. Needs no change of yours."""


def told(command, counts, imu):
    """Return the page "vehicle": the newest command, and whether it counts."""
    return {
        "rules": "pilot" if counts else "neutral",
        "mode": "manual",
        "is_armed": counts,
        "is_stopped": False,
        "number": 0 if command is None else command["number"],
        "age_s": None,
        "is_wet": False,
        "is_low": False,
        "refused": "",
        "depth_m": None,
        "heading_rad": None,
        "share": 1.0,
        "attitude_rad": [imu["roll_rad"], imu["pitch_rad"], imu["yaw_rad"]],
    }
