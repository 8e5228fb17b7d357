"""The parts of Dora in LRP programs."""

from __future__ import annotations

from snr_sim.behaviors import Bridge, Drive, Read


def to_cm(distance_m: float) -> float:
    """Return a distance in centimetres, the unit of the brick's own display."""
    return 100.0 * distance_m


BRIDGE = Bridge(
    reads={
        "ultra": Read("range", "distance_m", to=to_cm, unit="cm", fresh_s=0.5, low=0.0, high=255.0),
        "left_touch": Read("touch", "left", to=int, unit="0 or 1", fresh_s=0.5, low=0, high=1),
        "right_touch": Read("touch", "right", to=int, unit="0 or 1", fresh_s=0.5, low=0, high=1),
    },
    # The motors take a command for a limited time.
    drives={
        name: Drive("motors", field, low=-100.0, high=100.0, unit="%", repeat_s=0.2)
        for name, field in (("motor_a", "a"), ("motor_d", "d"))
    },
)
