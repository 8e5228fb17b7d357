"""From sticks to pulses: the four thrusters that push ahead and turn. Do not change it."""

STOP_US = 1500.0
FULL_US = 200.0  # from stop to a full stick
SURGE = (1.0, 1.0, -1.0, -1.0)  # of the thrusters 0 to 3: what a pulse above 1500 does
YAW = (1.0, -1.0, -1.0, 1.0)


def neutral_us():
    """Return the pulses at which nothing turns."""
    return [STOP_US] * 8


def pulses_us(surge, yaw):
    """Return the pulses of all eight thrusters for two sticks, -1 to 1 each."""
    pulses = neutral_us()
    for i in range(4):
        share = SURGE[i] * surge + YAW[i] * yaw
        pulses[i] = STOP_US + FULL_US * max(-1.0, min(1.0, share))
    return pulses
