"""The parts of the underwater vehicle in LRP programs, which run at the surface in the place of the pilot."""

from __future__ import annotations

import math
from typing import Any

from snr_sim.behaviors import Bridge, Drive, Read

ROLES = ("topside",)


def roll_pitch_yaw_deg(attitude_rad: list[float]) -> float:
    """Return the heading of an attitude [degrees], 0 to the east, positive to the left."""
    return math.degrees(attitude_rad[2])


def part_of_position(axis: int) -> Any:
    """Return a function that returns one coordinate of a position."""
    return lambda position_m: position_m[axis]


def controls(commands: dict[str, Any], number: int) -> dict[str, Any]:
    """Return the page of controls: it holds depth once a depth has been commanded; without, the pilot's hand does."""
    depth_m = commands["depth_m"]
    mode = "depth_hold" if depth_m > 0.0 else "stabilise"
    return {**commands, "number": number, "mode": mode, "depth_m": depth_m if depth_m > 0.0 else None}


# Twenty times a second, as the pilot's own sticks: without controls the vehicle surfaces.
STICKS = {
    name: Drive("controls", name, low=-1.0, high=1.0, unit="-1 to 1", repeat_s=0.05)
    for name in ("surge", "sway", "heave", "yaw")
}
BRIDGE = Bridge(
    reads={
        "depth_m": Read("depth", "depth_m", unit="m, positive down", fresh_s=1.0, low=0.0, high=100.0),
        "heading_deg": Read(
            "vehicle", "attitude_rad", to=roll_pitch_yaw_deg, unit="degrees", fresh_s=2.0, low=-180.0, high=180.0
        ),
        "is_armed": Read("vehicle", "is_armed", fresh_s=2.0, low=0, high=1),
        "is_wet": Read("vehicle", "is_leaking", fresh_s=2.0, low=0, high=1),
        "x_m": Read("position_fix", "position_m", to=part_of_position(0), unit="m", fresh_s=1.0),
        "y_m": Read("position_fix", "position_m", to=part_of_position(1), unit="m", fresh_s=1.0),
    },
    drives={
        **STICKS,
        "armed": Drive("controls", "is_armed", low=0.0, high=1.0, to=bool, unit="0 or 1", repeat_s=0.05),
        "hold_depth": Drive("controls", "depth_m", low=0.0, high=100.0, unit="m", repeat_s=0.05),
    },
    pages={"controls": controls},
)
