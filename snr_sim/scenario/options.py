"""Keys of `--option KEY=VALUE`: robot.py and controller declare them, and a run checks them before it writes anything.

    OPTIONS = {"port": "of the link between the roles, the same at both ends"}

Without the check, a misspelt key would start a run with other settings than requested. Robots without OPTIONS accept
any key, since only they know which ones they read.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from snr_sim.core.source_location import short_path
from snr_sim.prelude.errors import ConfigError, UnknownNameError, suggest


def check_options(given: Iterable[str], robot: ModuleType, controller: ModuleType) -> None:
    """Check that each key is one that the robot's file or the controller's has declared.

    Raises:
        UnknownNameError: a key is not declared; the message suggests the nearest.
        ConfigError: OPTIONS is not a dict of str to str.
    """
    of_robot, of_controller = _declared(robot), _declared(controller)
    if of_robot is None:
        return
    known = {**of_robot, **(of_controller or {})}
    for key in given:
        if key not in known:
            place = short_path(str(controller.__file__))
            reads_it = f'Or if {place} reads it, add there: OPTIONS = {{"{key}": "what it is for"}}.'
            choice = suggest(key, known) if known else "leave it out."
            raise UnknownNameError(f"--option {key}=...: there is no such option here.", fix=f"{choice} {reads_it}")


def written_options(path: Path) -> dict[str, str]:
    """Return the OPTIONS of a file without executing it; none if they are not literals."""
    try:
        tree = ast.parse(path.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return {}
    for node in tree.body:
        target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and isinstance(target, ast.Name) and target.id == "OPTIONS":
            try:
                value = ast.literal_eval(node.value) if node.value is not None else {}
            except (ValueError, TypeError):
                return {}
            return value if _is_options(value) else {}
    return {}


def _declared(module: ModuleType) -> Mapping[str, str] | None:
    """Return the OPTIONS of a loaded file, or None if it declares none."""
    options: Any = getattr(module, "OPTIONS", None)
    if options is None or _is_options(options):
        return options  # type: ignore[no-any-return]
    raise ConfigError(
        f"{short_path(str(module.__file__))}: OPTIONS is {options!r}, not a dict of names and texts.",
        fix='OPTIONS = {"gain": "of the depth controller"}; {} takes none.',
    )


def _is_options(value: object) -> bool:
    return isinstance(value, dict) and all(isinstance(one, str) for pair in value.items() for one in pair)
