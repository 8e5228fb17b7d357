"""Controllers that are LRP programs: `snr run lander_vertical --controller landing.lrp`.

The parts that a program may name are in the robot's file `bridge.py`, as `BRIDGE`; `ROLES` there, if the program does
not run in the robot's first role.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, TypeAlias

from snr_sim.behaviors.bridge import Bridge
from snr_sim.behaviors.endpoint import MachineFactory, machine_parts
from snr_sim.behaviors.imports import MAX_FILES, actions_of, files_named, texts_of
from snr_sim.behaviors.language import parse
from snr_sim.behaviors.program import Problem, Program, ProgramError, show_problem
from snr_sim.core.config import Config
from snr_sim.core.reload.sources import source_files
from snr_sim.core.source_location import short_path
from snr_sim.prelude.errors import ConfigError, ParameterError, SnrError

STEP_HZ = 100.0
FIX_WITHOUT_MACHINE = "--controller FILE.lrp, or a controller with a MachineFactory: docs/machines.md."
LoadModule: TypeAlias = Callable[[str], ModuleType]  # loads a Python file


def machine_controller(module: ModuleType, robot_module: str, load: LoadModule) -> None:
    """Give a module, whose `__file__` is an LRP program, the function `factories` of a controller.

    Args:
        module: with nothing in it.
        robot_module: name of the robot's package.
        load: loads a Python file.

    Raises:
        ConfigError: the program has mistakes, or the robot has no parts for programs.
    """
    bridge = bridge_of(robot_module)
    roles = getattr(sys.modules[f"{robot_module}.bridge"], "ROLES", None)
    path = Path(str(module.__file__))
    program = read_program(path, load, bridge)
    # Of its first machine, not of its file: a replay with another file finds the same component.
    name = program.spawns[0].machine.name if program.spawns else path.stem.replace("-", "_")

    pages = tuple(dict.fromkeys(part.page for part in bridge.reads.values()))

    def factories(_robot: Any) -> list[Any]:
        return [*machine_parts(program, name, step_hz=STEP_HZ, reacts_to=pages, bridge=bridge, path=path)]

    module.factories = factories  # type: ignore[attr-defined]
    if roles is not None:
        module.ROLES = roles  # type: ignore[attr-defined]


def guard_edits(config: Config, guard_s: float) -> None:
    """Put the program before an edit back when a block fails, or page `failsafe` comes, within a time after the edit.

    Args:
        config: of the robot; all its machines are guarded.
        guard_s: that time.

    Raises:
        ParameterError: the time is not valid, or there is no machine.
    """
    if not 0.0 < guard_s < math.inf:
        raise ParameterError(f"--guard must be greater than 0, not {guard_s:g}.", fix="give seconds, such as 3.")
    found = [one for role in config.factories.values() for one in role if isinstance(one, MachineFactory)]
    if not found:
        raise ParameterError("--guard is for edits of state machines, and this run has none.", fix=FIX_WITHOUT_MACHINE)
    for one in found:
        one.guard_s = guard_s


def bridge_of(robot_module: str) -> Bridge:
    """Return the parts of a robot.

    Raises:
        ConfigError: it has no file bridge.py, or no BRIDGE there.
    """
    try:
        bridge = getattr(import_module(f"{robot_module}.bridge"), "BRIDGE", None)
    except ModuleNotFoundError as error:
        if error.name != f"{robot_module}.bridge":
            raise
        bridge = None
    if not isinstance(bridge, Bridge):
        raise ConfigError(
            "This robot has no parts that an LRP program could name.",
            fix="in the robot's folder a file bridge.py with BRIDGE = Bridge(reads={...}, drives={...}).",
        )
    return bridge


def read_program(path: Path, load: LoadModule, bridge: Bridge | None = None) -> Program:
    """Return the program of a file.

    Raises:
        ConfigError: it cannot be read, or has mistakes: all of them, with their lines.
    """
    text = _text_of(path)
    place = short_path(str(path))
    files, actions = _others_of(path, text, load)
    try:
        return parse(text, None if bridge is None else bridge.parts, files, actions)
    except ProgramError as error:
        raise MachineError(place, text, error.problems) from None


def _text_of(path: Path) -> str:
    data = source_files().read(path)
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigError(
            f"{short_path(str(path))}, line {line}: byte 0x{data[error.start]:02x} is not text.",
            fix="save the file as UTF-8.",
        ) from None


def _others_of(path: Path, text: str, load: LoadModule) -> tuple[dict[str, str], dict[str, dict[str, Any]]]:
    """Return the texts that a program imports, and the functions of the Python files that it names."""

    def read_text(name: str) -> str | None:
        return _text_of(path.parent / name) if source_files().is_file(path.parent / name) else None

    files = texts_of(text, read_text)
    actions = dict[str, dict[str, Any]]()
    for name in dict.fromkeys(name for one in (text, *files.values()) for name in files_named(one)[1]):
        if len(actions) < MAX_FILES and source_files().is_file(path.parent / name):
            actions[name] = actions_of(vars(load(str(path.parent / name))))
    return files, actions


class MachineError(ConfigError):
    """An LRP file has mistakes: the message has the first with its line, and the others."""

    def __init__(self, place: str, text: str, problems: list[Problem]) -> None:
        lines = text.splitlines()
        first, *others = (show_problem(one, place, lines) for one in problems)
        SnrError.__init__(self, "\n".join([first, *others]))
        self.problems: list[Problem] = problems
