"""What the surface asks of the vehicle, twenty times a second, and what a person does to ask for it.

left stick    up and down: heave    left and right: yaw
right stick   up and down: surge    left and right: sway
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import msgspec

from snr_sim.errors import CommandError
from snr_sim.teleop import Cue, GamepadPilotFactory, ScriptedPilotFactory, Stick, legend, read_controls

# Each mode does what those before it do, too; "manual" is the sticks alone.
MODES = ("manual", "stabilise", "depth_hold", "heading_hold")
DEEPEST_M = 100.0  # as its maker rates it
STICKS = {"surge": Stick(4, "ws"), "sway": Stick(3, "ad"), "heave": Stick(1, "ik"), "yaw": Stick(0, "jl")}
LEGEND = legend("w s ahead, astern  a d left, right  i k up, down  j l turn")


class Controls(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One command from the surface. Made without arguments it asks for nothing, disarmed.

    Sticks are -1 to 1; forward, left, up and to the left are positive. In a mode that holds depth or heading they move
    the setpoint.
    """

    number: int = 0  # counts commands, so that one that arrives out of order is dropped
    mode: str = "manual"  # one of MODES
    is_armed: bool = False  # the thrusters may push
    is_stop: bool = False  # emergency stop; it stays in effect until it is cleared
    clears_stop: bool = False  # ends an emergency stop, if the command is disarmed and without a stop
    surge: float = 0.0
    sway: float = 0.0
    heave: float = 0.0
    yaw: float = 0.0
    depth_m: float | None = None  # what depth to hold from now on, in a mode that does
    heading_rad: float | None = None  # the same for the heading


def controls_of(data: Any) -> Controls:
    """Return the command that a page holds.

    Raises:
        CommandError: it is not a command, or a number in it is not valid or out of range.
        UnknownNameError: there is no such mode.
    """
    controls = read_controls(Controls, data, MODES, STICKS)
    for name in ("depth_m", "heading_rad"):
        value = getattr(controls, name)
        if value is not None and not math.isfinite(value):
            raise CommandError(f"'{name}' must be finite or None, not {value!r}.", fix="check for a division by zero.")
    if controls.depth_m is not None and not 0.0 <= controls.depth_m <= DEEPEST_M:
        fix = "depth is positive down."
        raise CommandError(f"'depth_m' must be in 0 to {DEEPEST_M:g} m, not {controls.depth_m!r}.", fix=fix)
    return controls


def manual_status(controls: dict[str, Any] | None, imu: dict[str, Any]) -> dict[str, Any]:
    """Return the page "vehicle" of a controller without failsafes and holds: sticks alone, nothing wrong.

    Pages "controls", which is None before the first, and "imu" say the rest.
    """
    is_armed = controls is not None and controls["is_armed"]
    return {
        "control_state": "pilot" if is_armed else "idle",
        "mode": MODES[0],
        "is_armed": is_armed,
        "is_stopped": False,
        "number": 0 if controls is None else controls["number"],
        "age_s": None,
        "is_leaking": False,
        "is_battery_low": False,
        "rejected_command": "",
        "depth_m": None,
        "heading_rad": None,
        "thrust_scale": 1.0,
        "attitude_rad": [imu["roll_rad"], imu["pitch_rad"], imu["yaw_rad"]],
    }


def scripted_pilot(script: Sequence[Cue], rate_hz: float, key: str = "controls") -> ScriptedPilotFactory:
    """Return what makes a pilot that follows a script; a depth or heading to hold is asked for once."""
    return ScriptedPilotFactory(script, rate_hz, Controls(), controls_of, ("depth_m", "heading_rad"), key)


def gamepad_pilot(key: str = "controls") -> GamepadPilotFactory:
    """Return what makes controls of a gamepad or the keyboard."""
    return GamepadPilotFactory(Controls, STICKS, MODES, key)
