"""`snr new`: copies a robot, a scenario, the starter files of a lab, a template of a controller or machine; a service.

A student's robot or scenario is found and treated exactly like one of snr_sim.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Annotated

import typer

from snr_sim.cli.new_service import begin_service
from snr_sim.cli.output import print_text
from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest
from snr_sim.scenario.library import Kind, find, find_lab, robot_of_scenario

_CLASS = "ControllerTemplate"  # in the template
_LAB, _CONTROLLER, _MACHINE, _SERVICE = "lab", "controller", "machine", "service"
_SOURCES: dict[str, tuple[Kind, str]] = {"robot": ("robots", "lander"), "scenario": ("scenarios", "lander_vertical")}


def new(
    what: Annotated[str, typer.Argument(help="controller, machine, robot, scenario, lab or service.")],
    name: Annotated[
        str, typer.Argument(help="Its name: small letters, digits and _. Of a lab: which one. Of a service: of a file.")
    ],
    folder: Annotated[str, typer.Argument(help="Of a lab: the new folder, else one of the lab's name.")] = "",
    source: Annotated[str, typer.Option("--from", help="Which one to copy.")] = "",
    robot: Annotated[str, typer.Option(help="Of a machine or a scenario: which robot it is for.")] = "",
    scenario: Annotated[str, typer.Option(help="Of a controller: a scenario that it is for.")] = "",
) -> None:
    """Begin a controller, machine, robot, scenario, lab or service of your own.

    Makes a copy of one there is, or of the files that a lab begins with, under the current folder. A service is a unit
    file of systemd for the RoverProcesses in NAME.py.
    """
    if scenario and what != _CONTROLLER:
        raise ParameterError(f"--scenario does not apply to a {what}.", fix="use it with snr new controller only.")
    if what == _LAB:
        if source or robot:
            raise ParameterError("--from and --robot do not apply to a lab.", fix=f"snr new lab {name}")
        _begin_lab(name, folder)
        return
    if folder:
        raise ParameterError(f"snr new {what} takes no folder, but got '{folder}'.", fix=f"snr new {what} {name}")
    kinds = (*_SOURCES, _CONTROLLER, _MACHINE, _SERVICE)
    if what not in kinds:
        raise UnknownNameError(f"snr new cannot create a '{what}'.", fix=suggest(what, [*kinds, _LAB]))
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise ParameterError(
            f"'{name}' is not a valid {what} name.",
            fix="use lower-case letters, digits and underscores, starting with a letter.",
        )
    if what == _CONTROLLER:
        if source or robot:
            raise ParameterError(
                "A controller begins with the template of its robot.", fix=f"snr new controller {name} --scenario S"
            )
        _begin_controller(name, scenario)
        return
    if what == _SERVICE:
        if source or robot:
            raise ParameterError("--from and --robot do not apply to a service.", fix=f"snr new service {name}")
        _check_is_new(Path(f"{name}.service"))
        begin_service(name, Path(f"{name}.service"))
        return
    if what == _MACHINE:
        if source:
            raise ParameterError("--from does not apply to a machine.", fix=f"snr new machine {name} --robot dora")
        _begin_machine(name, robot)
        return
    kind, default = _SOURCES[what]
    found = find(kind, source or default)
    if robot:
        if kind == "robots":
            raise ParameterError("--robot does not apply to a robot.", fix="use it with snr new scenario only.")
        find("robots", robot)
    target = Path(kind) / (name if kind == "robots" else f"{name}.py")
    _check_is_new(target)
    target.parent.mkdir(exist_ok=True)
    if kind == "robots":
        shutil.copytree(found.path, target, ignore=shutil.ignore_patterns("__pycache__"))
        for path in target.rglob("*.py"):
            _rename(path, found.name, name)
        print_text(f"{target}/ is a copy of {found.name}; begin with {target}/robot.py.")
        print_text(f"A scenario for it: snr new scenario {name}_first --robot {name}")
    else:
        shutil.copyfile(found.path, target)
        if robot:
            _rename(target, robot_of_scenario(found), robot)
        print_text(f"{target} is a copy of {found.name}; run it: snr run {name}")


def _begin_lab(name: str, folder: str) -> None:
    """Copy a lab's starter files and its page into a new folder."""
    found = find_lab(name)
    starter = found.path / "starter"
    if not starter.is_dir():
        raise UnknownNameError(f"The lab '{found.name}' has no files to begin with.", fix="snr list assignments")
    short = found.name.partition("_")[2] or found.name
    target = Path(folder or short)
    _check_is_new(target, "continue in it, or rename it")
    try:
        shutil.copytree(starter, target, ignore=shutil.ignore_patterns("__pycache__"))
        for page in found.path.glob("*.md"):
            shutil.copy(page, target)
        if (found.path / "pictures").is_dir():
            shutil.copytree(found.path / "pictures", target / "pictures")
    except OSError as error:
        raise ParameterError(f"{target} cannot be made: {error.strerror}.", fix="name another folder.") from error
    print_text(f"{target}/ has the files that the lab begins with. What it is about: {target}/README.md")
    if (found.path / "checks.py").is_file():
        print_text(f"Try them: snr check {short} {target}")


def _begin_controller(name: str, scenario: str) -> None:
    """Write a controller of this name for a scenario's robot into the current folder, from the robot's template."""
    if not scenario:
        raise ParameterError(
            "`snr new controller` needs a scenario, which decides the robot.",
            fix=f"snr new controller {name} --scenario lander_vertical (`snr list` prints all of them).",
        )
    found = find("scenarios", scenario)
    robot = find("robots", robot_of_scenario(found))
    template = robot.path / "controller_template.py"
    if not template.is_file():
        raise UnknownNameError(
            f"Robot '{robot.name}' of scenario '{found.name}' has no template for controllers.",
            fix=f"write the file {template}: a controller whose class is named {_CLASS}.",
        )
    target = Path(f"{name}.py")
    _check_is_new(target)
    class_name = "".join(word.capitalize() for word in name.split("_"))
    target.write_text(template.read_text().replace(_CLASS, class_name))
    shown = scenario if found.name != Path(scenario).stem else found.name
    print_text(f"{target} is a controller for {found.name}. Run it: snr run {shown} --controller ./{target}")


def _begin_machine(name: str, robot: str) -> None:
    """Write a program in LRP of this name for a robot into the current folder."""
    from snr_sim.behaviors.starter import starter_of
    from snr_sim.scenario.library import LRP, bridge_of_robot, list_available, robot_of_scenario

    if not robot:
        raise ParameterError(
            "A machine needs a robot, whose parts it names.", fix=f"snr new machine {name} --robot dora"
        )
    text, target = starter_of(name, robot, bridge_of_robot(robot)), Path(f"{name}{LRP}")
    _check_is_new(target)
    target.write_text(text, encoding="utf-8")
    scenario = next((one.name for one in list_available("scenarios") if robot_of_scenario(one) == robot), "SCENARIO")
    print_text(f"{target} is a state machine for {robot}. Check it: snr machine check {target} --robot {robot}")
    print_text(f"Run it: snr run {scenario} --controller ./{target}")


def _check_is_new(target: Path, what_to_do: str = "choose another name") -> None:
    if target.exists():
        raise ParameterError(f"{target} is there already.", fix=f"{what_to_do}; nothing was changed.")


def _rename(path: Path, old: str, robot: str) -> None:
    """Replace the original robot's name in a copied file, in module names and `ROBOT`, by the new one."""
    text = path.read_text()
    renamed = text.replace(f"snr_sim_robot_{old}", f"snr_sim_robot_{robot}")
    renamed = re.sub(rf'^ROBOT = "{old}"$', f'ROBOT = "{robot}"', renamed, flags=re.MULTILINE)
    if renamed != text:
        path.write_text(renamed)
