"""Options of this robot (`--option`): each value is checked before there is a run, and the error shows what to type."""

from __future__ import annotations

from snr_sim.errors import ParameterError, UnknownNameError, suggest
from snr_sim.scenario import RobotContext
from snr_sim.teleop import pilot_of, presses_of

BUTTONS = ("stop", "reset")  # of the panel


def check_options(context: RobotContext) -> None:
    """Check what depends on the options alone.

    Raises:
        UnknownNameError: a value is not one of the possible ones.
        ParameterError: a value has no effect in this run, so it is a mistake.
    """
    options = context.robot.options
    pilot = pilot_of(options)
    power = options.get("power", "board")
    if power != "board":
        raise UnknownNameError(f"--option power={power} is not a valid source.", fix=suggest(power, ["board"]))
    if "power" in options and context.io != "mcu":
        raise ParameterError(
            f"--option power=board goes with --io mcu:PORT; with --io {context.io} it changes nothing.",
            fix="leave it out, or --io mcu:/dev/ttyUSB0.",
        )
    presses_of(options, BUTTONS)
    for button in BUTTONS:
        if button in options and not (
            context.extra_components.get("topside") and context.robot.parameters.route and pilot == "scripted"
        ):
            raise ParameterError(
                f"--option {button}=... has no effect: no component reads the button panel in this run.",
                fix="leave it out, or name a controller for the surface (its ROLES) in a scenario with a route.",
            )
