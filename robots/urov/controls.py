"""What the surface tells the vehicle, twenty times a second, and what the vehicle tells back about it."""

from __future__ import annotations

import math
from typing import Any

import msgspec

from snr_sim.prelude.errors import CommandError, UnknownName, nearest
from snr_sim.prelude.structs import learned

# Each mode does what those before it do, too; "manual" is the sticks alone.
MODES = ("manual", "stabilise", "depth_hold", "heading_hold")
DEEPEST_M = 100.0  # as its maker rates it
STICKS = ("surge", "sway", "heave", "yaw")


class Controls(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One command from the surface. Made without arguments it asks for nothing, disarmed.

    Args:
        number: counts commands, so that one that was overtaken is not obeyed.
        mode: one of MODES.
        is_armed: the thrusters may push.
        is_stop: emergency stop. The vehicle keeps to it until somebody clears it.
        clears_stop: ends an emergency stop, if it comes disarmed and without a stop.
        surge, sway, heave, yaw: sticks, -1 to 1; forward, left, up and to the left are positive. In a mode that holds
            depth or heading they move what is held.
        depth_m: what depth to hold from now on, in a mode that does.
        heading_rad: what heading to hold from now on, in a mode that does.
    """

    number: int = 0
    mode: str = "manual"
    is_armed: bool = False
    is_stop: bool = False
    clears_stop: bool = False
    surge: float = 0.0
    sway: float = 0.0
    heave: float = 0.0
    yaw: float = 0.0
    depth_m: float | None = None
    heading_rad: float | None = None


def controls_of(data: Any) -> Controls:
    """Returns the command that a page holds.

    Raises:
        CommandError: it is none, or a number in it is none or out of range.
        UnknownName: there is no such mode.
    """
    try:
        controls = msgspec.convert(data, learned(Controls))
    except msgspec.ValidationError as error:
        raise CommandError(f"These are no controls: {error}.", fix="store the fields of Controls.") from error
    if controls.mode not in MODES:
        raise UnknownName(f"There is no mode '{controls.mode}'.", fix=nearest(controls.mode, MODES))
    for stick in STICKS:
        value = getattr(controls, stick)
        if not -1.0 <= value <= 1.0:
            raise CommandError(f"The stick '{stick}' is at {value!r}.", fix="-1 to 1.")
    for name in ("depth_m", "heading_rad"):
        value = getattr(controls, name)
        if value is not None and not math.isfinite(value):
            raise CommandError(f"The controls ask for {name} = {value!r}.", fix="a finite number, or None.")
    if controls.depth_m is not None and not 0.0 <= controls.depth_m <= DEEPEST_M:
        fix = f"depth is positive down, and the vehicle is made for {DEEPEST_M:g} m."
        raise CommandError(f"The controls ask for depth_m = {controls.depth_m!r}.", fix=fix)
    return controls
