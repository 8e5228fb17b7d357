"""What the vehicle tells the surface about itself; the pilot begins when it hears it. Needs no change of yours."""


def told(controls, wanted_m, is_stopped, imu):
    """Return the page "vehicle"."""
    is_armed = controls is not None and controls["is_armed"] and not is_stopped
    return {
        "rules": "pilot" if is_armed else "idle",
        "mode": "depth_hold",
        "is_armed": is_armed,
        "is_stopped": is_stopped,
        "number": 0 if controls is None else controls["number"],
        "age_s": None,
        "is_wet": False,
        "is_low": False,
        "refused": "",
        "depth_m": wanted_m,
        "heading_rad": None,
        "share": 1.0,
        "attitude_rad": [imu["roll_rad"], imu["pitch_rad"], imu["yaw_rad"]],
    }
