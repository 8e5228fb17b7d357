"""What the surface asks of the rover, twenty times a second, and what a person does to ask for it.

arcade   right stick   up and down: ahead    left and right: turn
tank     left stick    up and down: the left side; right stick: the right side
both     triggers      brake their side
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from snr_sim.errors import UnknownNameError, suggest
from snr_sim.teleop import Cue, GamepadPilotFactory, ScriptedPilotFactory, Stick, legend, read_controls

MODES = ("speed", "current", "duty")  # what sticks are shares of, as in page "drive"
LAYOUTS = {
    "arcade": {"ahead": Stick(4, "ws"), "turn": Stick(3, "ad")},
    "tank": {"left": Stick(1, "ws"), "right": Stick(4, "ik")},
}
TRIGGERS = {"brake_left": 2, "brake_right": 5}
DEADMAN_BUTTON = 4  # the left shoulder, as the triggers are brakes
LEGENDS = {
    "arcade": legend("w s ahead, astern  a d turn"),
    "tank": legend("w s left side  i k right side"),
}


class Controls(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One command from the surface. Made without arguments it asks for nothing, disarmed.

    Sticks are -1 to 1 before the curve of `sticks.py`; ahead and to the left are positive. A pilot moves those of one
    layout; if both are moved, those of the sides count.
    """

    number: int = 0  # counts commands, so that one that arrives out of order is dropped
    mode: str = "speed"  # one of MODES
    is_armed: bool = False  # the motors may turn the wheels
    is_stop: bool = False  # emergency stop; it stays in effect until it is cleared
    clears_stop: bool = False  # ends an emergency stop, if the command is disarmed and without a stop
    ahead: float = 0.0
    turn: float = 0.0
    left: float = 0.0
    right: float = 0.0
    brake_left: bool = False  # wins over its side's stick
    brake_right: bool = False


def controls_of(data: Any) -> Controls:
    """Return the command that a page holds; raise a CommandError or an UnknownNameError if it is not valid."""
    return read_controls(Controls, data, MODES, ("ahead", "turn", "left", "right"))


def layout_of(options: Mapping[str, str]) -> str:
    """Return the layout of the sticks by the option `sticks`; raise an UnknownNameError if there is no such one."""
    layout = options.get("sticks", "arcade")
    if layout not in LAYOUTS:
        raise UnknownNameError(f"--option sticks={layout}: there is no such layout.", fix=suggest(layout, LAYOUTS))
    return layout


def clamped(axis: float) -> float:
    """Return an axis of a gamepad as a stick: the curve is the rover's."""
    return min(1.0, max(-1.0, axis))


def scripted_pilot(script: Sequence[Cue], rate_hz: float) -> ScriptedPilotFactory:
    """Return what makes a pilot that follows a script."""
    return ScriptedPilotFactory(script, rate_hz, Controls(), controls_of)


def gamepad_pilot(layout: str) -> GamepadPilotFactory:
    """Return what makes controls of a gamepad or the keyboard."""
    return GamepadPilotFactory(Controls, LAYOUTS[layout], MODES, curve=clamped, triggers=TRIGGERS)
