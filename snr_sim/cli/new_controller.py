"""`snr new controller`: a file to begin a controller with, from the template of a scenario's robot."""

from __future__ import annotations

import re
from pathlib import Path

TEMPLATE = "controller_template.py"
_CLASS = "ControllerTemplate"


def new_controller(name: str, scenario: str) -> None:
    """Write a controller for a scenario's robot into the current folder.

    Args:
        name: of the controller, and of its file.
        scenario: one that the controller is for.

    Raises:
        ParameterError: no scenario is given, or there is a file of this name.
        UnknownNameError: there is no such scenario, or its robot has no template.
    """
    from snr_sim.prelude.errors import ParameterError, UnknownNameError
    from snr_sim.scenario.library import find, robot_of_scenario

    if not scenario:
        raise ParameterError(
            "`snr new controller` needs a scenario, which decides the robot.",
            fix=f"snr new controller {name} --scenario lander_vertical (`snr list` prints all of them).",
        )
    found = find("scenarios", scenario)
    robot = find("robots", robot_of_scenario(found))
    template = robot.path / TEMPLATE
    if not template.is_file():
        raise UnknownNameError(
            f"Robot '{robot.name}' of scenario '{found.name}' has no template for controllers.",
            fix=f"write the file {template}: a controller whose class is named {_CLASS}.",
        )
    target = Path(f"{name}.py")
    if target.exists():
        raise ParameterError(f"{target} is there already.", fix="choose another name; nothing was changed.")
    words = [word for word in re.split(r"_+", name) if word]
    class_name = "".join(word.capitalize() for word in words)
    target.write_text(template.read_text().replace(_CLASS, class_name))
    shown = scenario if found.name != Path(scenario).stem else found.name
    print(f"{target} is a controller for {found.name}. Run it: snr run {shown} --controller ./{target}")
