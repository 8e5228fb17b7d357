"""Check that a program does not borrow the robot's Process_2D: it may import what is listed here, and nothing else.

The robot's other modules import its Process_2D, so it can be reached from them by many ways. So each name is listed.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

ROBOT = "snr_sim_robot_housecat"
OWN = "process_2d"
ANY = frozenset({"*"})
MODULES: dict[str, frozenset[str]] = {
    **dict.fromkeys(("__future__", "collections", "dataclasses", "enum", "functools", "itertools"), ANY),
    **dict.fromkeys(("math", "numpy", "statistics", "typing", OWN), ANY),
    "collections.abc": ANY,
    "snr_sim": frozenset({"Endpoint", "Loop", "Page", "TaskType", "handles", "tasks"}),
    "snr_sim.behaviors.flow": ANY,
    "snr_sim.behaviors.processes": ANY,
    f"{ROBOT}.driver": frozenset({"DRIVER"}),
    f"{ROBOT}.process_3d": frozenset({"PROCESS_3D"}),
    f"{ROBOT}.states": frozenset({"PROCESSES", "STATES"}),
}
WHOLE = frozenset({"collections", "dataclasses", "enum", "functools", "itertools", "math", "numpy", "statistics"})
REFUSED = frozenset({"__import__", "eval", "exec", "compile", "globals", "vars", "getattr", "open", "input"})
LEADING = frozenset({"builtins", "importlib", "inspect", "modules", "os", "sys"})  # of numpy's modules, too
SPECIAL = frozenset({"__init__", "__name__"})


def find_borrowed(source: bytes) -> str:
    """Return the first place where a program is more than plain, as "line 3: 'x'"; "" if there is none.

    A text that is not Python is in order here: the checks that run it report its error.
    """
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return ""
    found = [(getattr(node, "lineno", 0), name) for node in ast.walk(tree) for name in _borrowed(node)]
    return "line {}: '{}'".format(*min(found)) if found else ""


def _borrowed(node: ast.AST) -> Iterator[str]:
    """Yield the names in one part of a program that it may not use."""
    match node:
        case ast.Import(names=names):
            yield from (alias.name for alias in names if alias.name not in WHOLE)
        case ast.ImportFrom(module=module, names=names, level=level):
            known = MODULES.get(module or "", frozenset()) if level == 0 else frozenset()
            yield from (
                f"{module}.{alias.name}" for alias in names if alias.name == "*" or not known & {alias.name, "*"}
            )
        case ast.Name(id=name) if name in REFUSED or (_is_special(name) and name not in SPECIAL):
            yield name
        case ast.Attribute(attr=name) if name in LEADING or (_is_special(name) and name not in SPECIAL):
            yield name


def _is_special(name: str) -> bool:
    return name.startswith("__") and name.endswith("__")
