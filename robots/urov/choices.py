"""Options of this robot (`--option`): each value is checked before there is a run, and the error shows what to type."""

from __future__ import annotations

from snr_sim.prelude.errors import ParameterError, UnknownName, nearest
from snr_sim.prelude.scenario import Rig
from snr_sim.teleop.button_panel import presses_of

PILOTS = ("scripted", "hands")
BUTTONS = ("stop", "reset")  # of the panel


def check_choices(rig: Rig) -> None:
    """Check what depends on the options alone.

    Raises:
        UnknownName: a value is not one of the possible ones.
        ParameterError: a value has no effect in this run, so it is a mistake.
    """
    options = rig.robot.options
    pilot = options.get("pilot", PILOTS[0])
    if pilot not in PILOTS:
        raise UnknownName(f"--option pilot={pilot}: there is no such pilot.", fix=nearest(pilot, PILOTS))
    deadman = options.get("deadman", "no")
    if deadman not in ("yes", "no"):
        raise UnknownName(f"--option deadman={deadman}: it is yes or no.", fix="--option deadman=yes")
    if deadman == "yes" and pilot != "hands":
        raise ParameterError(
            f"--option deadman=yes, but the pilot is {pilot}, who holds no trigger.",
            fix="--option pilot=hands beside it, or leave it out.",
        )
    power = options.get("power", "board")
    if power != "board":
        raise UnknownName(f"--option power={power}: there is no such place to measure.", fix=nearest(power, ["board"]))
    if "power" in options and rig.io != "mcu":
        raise ParameterError(
            f"--option power=board goes with --io mcu:PORT; with --io {rig.io} it changes nothing.",
            fix="leave it out, or --io mcu:/dev/ttyUSB0.",
        )
    presses_of(options, BUTTONS)
    for button in BUTTONS:
        if button in options and not (rig.crew.get("topside") and rig.robot.parameters.route and pilot == "scripted"):
            raise ParameterError(
                f"--option {button}=..., but nobody looks at the panel in this run.",
                fix="leave it out, or name a controller for the surface (its ROLES) in a scenario with a route.",
            )
