"""The mathematics of this lab: how hard to turn, how hard to lift, and which pulses do that. Do not change it.

Nothing here remembers anything, but for `Rate`, of which each who needs one has his own.
"""

import math

STOP_US = 1500.0
MAX_TURN_NM = 8.0
MAX_LIFT_N = 70.0
ARM_M = 0.19  # how far from the middle a thruster pushes when it turns the vehicle
TURN = (1.0, -1.0, -1.0, 1.0, 0.0, 0.0, 0.0, 0.0)  # what a pulse above 1500 does, thruster by thruster: left is +
LIFT = (0.0, 0.0, 0.0, 0.0, 1.0, -1.0, -1.0, 1.0)  # up is +


def limited(value, limit):
    """Return a value brought to the range from -most to most."""
    return max(-limit, min(limit, value))


def wrap_rad(angle_rad):
    """Return an angle brought to the range from -pi to pi."""
    return math.atan2(math.sin(angle_rad), math.cos(angle_rad))


def turn_moment_nm(target_rad, yaw_rad, rate_radps):
    """Return the moment that turns the vehicle to a heading; left is positive."""
    return limited(8.0 * wrap_rad(target_rad - yaw_rad) - 4.0 * rate_radps, MAX_TURN_NM)


def lift_force_n(target_m, depth_m, rate_mps):
    """Return the force that brings the vehicle to a depth; up is positive."""
    return limited(120.0 * (depth_m - target_m) + 60.0 * rate_mps, MAX_LIFT_N)


def pulses_us(moment_nm, force_n):
    """Return the pulses of all eight thrusters."""
    return [
        pulse_us(turn * moment_nm / (4 * ARM_M) + lift * force_n / 4) for turn, lift in zip(TURN, LIFT, strict=True)
    ]


def pulse_us(thrust_n):
    """Return the pulse for a thrust: within 30 us of 1500 nothing turns, and at 1900 a thruster gives 50 N."""
    if abs(thrust_n) < 0.01:
        return STOP_US
    way_us = 30.0 + 370.0 * math.sqrt(min(50.0, abs(thrust_n)) / 50.0)
    return STOP_US + math.copysign(way_us, thrust_n)


class Rate:
    """How fast a measured value changes, smoothed."""

    def __init__(self):
        self.rate = 0.0
        self.before = None

    def update(self, value, stamp_s):
        """Takes in a value, measured at a moment; returns the rate."""
        if self.before is not None and stamp_s > self.before[1]:
            newest = (value - self.before[0]) / (stamp_s - self.before[1])
            self.rate += 0.25 * (newest - self.rate)
        self.before = (value, stamp_s)
        return self.rate
