"""One thruster moved a little, once, on the bench: is it this one, and does it turn in the right direction?

0.5 s up, 1 s held, 0.5 s down; all other channels at neutral.
"""

from __future__ import annotations

from snr_sim.devices.pwm.pwm_backend import LIMITS_US, STOP_US
from snr_sim.prelude.errors import UnknownNameError, suggest

FRACTION = 0.05  # of the thruster's range
# The project's speed controllers stop from 1475 to 1525 us (Blue Robotics, Basic ESC): less would move nothing.
DEAD_BAND_US = 25.0
RAMP_S, HOLD_S = 0.5, 1.0
WHOLE_S = 2 * RAMP_S + HOLD_S


def top_us(limits_us: tuple[float, float] = LIMITS_US) -> float:
    """Return the longest pulse of a motor test.

    >>> top_us()
    1543.75
    """
    return STOP_US + DEAD_BAND_US + FRACTION * (limits_us[1] - STOP_US - DEAD_BAND_US)


def motor_test_pulses_us(
    channel: int, channels: int, since_s: float, limits_us: tuple[float, float] = LIMITS_US
) -> list[float] | None:
    """Return the pulses at a time after the start; None when the test is over.

    >>> [motor_test_pulses_us(1, 2, t) for t in (0.0, 0.25, 1.0, 2.0)]
    [[1500.0, 1500.0], [1500.0, 1521.875], [1500.0, 1543.75], None]
    """
    if not 0.0 <= since_s < WHOLE_S:
        return None
    fraction = min(1.0, since_s / RAMP_S, (WHOLE_S - since_s) / RAMP_S)
    pulses_us = [STOP_US] * channels
    pulses_us[channel] += fraction * (top_us(limits_us) - STOP_US)
    return pulses_us


def channel_of(name: str, names: list[str]) -> int:
    """Return the number of the channel with a name; raise an UnknownNameError if there is none."""
    if name not in names:
        raise UnknownNameError(f"There is no channel '{name}'.", fix=suggest(name, names))
    return names.index(name)
