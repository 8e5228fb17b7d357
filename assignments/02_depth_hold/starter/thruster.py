"""The manufacturer's data of the thruster, in the manufacturer's unit: kilogram-force. Do not change this file.

1 kgf is the weight of 1 kg: 9.80665 N. Within 30 us of 1500 nothing turns. From there on thrust grows faster than the
pulse: half of the way gives about a quarter. At 1900 us, which is the most that it may be sent, it pushes with 4.8 kgf.
"""

STOP_US = 1500.0
NEWTONS_PER_KGF = 9.80665
DEAD_US, FULL_US, FULL_KGF = 30.0, 400.0, 4.8


def pulse_us(force_kgf):
    """Return the pulse for a force, in microseconds. Positive is ahead. It does not know where to stop: you do.

    >>> pulse_us(0.0), pulse_us(4.8), pulse_us(-4.8)
    (1500.0, 1900.0, 1100.0)
    """
    if abs(force_kgf) < 0.002:
        return STOP_US
    width_us = DEAD_US + (FULL_US - DEAD_US) * (abs(force_kgf) / FULL_KGF) ** 0.55
    if force_kgf > 0.0:
        return STOP_US + width_us
    return STOP_US - width_us
