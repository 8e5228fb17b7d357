"""Stores what the radar would have measured on the ground."""

from falling import falling


def factories(robot):
    return falling(
        lambda pilot: pilot.store_data_task("radar", {"altitude_m": 0.0, "velocity_mps": 0.0, "stamp_s": 0.0})
    )
