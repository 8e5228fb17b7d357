"""Parsers of a student's texts, which run in the student's process, and the check of what a submission imports.

A parser can take any time and memory: 80 kB of dotted keys occupy tomllib for half a minute, and 1 MB of braces in an
f-string occupy Python's own parser for one. In a process with limits that fails the case, and no other submission.
"""

from __future__ import annotations

import ast
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from snr_sim.grading.lab.verdicts import SubmissionError
from snr_sim.grading.remote.sent_code import LAB_MODULE
from snr_sim.prelude.errors import SnrError
from snr_sim.scenario.library import LRP

if TYPE_CHECKING:  # the student's process imports this module, too
    from snr_sim.grading.remote.student_process import StudentProcess

MAX_PARSED_BYTES = 16 * 2**10  # some pages of text
_NO_NETWORK = "there is no network in the grader"
_ONE_PROCESS = "a submission has one process and one thread, which the grader starts"
_PYTHON_ONLY = "a submission is plain Python"
_GRADES_ITSELF = "a submission does not grade itself"
_MAX_SOURCE_BYTES = 1 << 20
MAX_IMPORTS_CPU_S = 10.0  # for all files that a program imports; one has as much, and there may be 500
REFUSED: dict[str, str] = {
    **dict.fromkeys(("socket", "socketserver", "ssl", "urllib", "http", "requests", "ftplib", "smtplib"), _NO_NETWORK),
    **dict.fromkeys(("subprocess", "multiprocessing", "concurrent", "pty"), _ONE_PROCESS),
    **dict.fromkeys(("ctypes", "cffi"), _PYTHON_ONLY),
    "pickle": "what is unpickled can be any program; save numbers with json or numpy",
    "snr_sim.grading": _GRADES_ITSELF,
}


def check_imports(
    folder: Path, file: str, may_import: frozenset[str], refused: Mapping[str, str], child: StudentProcess
) -> None:
    """Check the imports of a submitted file and of the submission's files that it imports; the child parses them.

    Args:
        may_import: modules of `REFUSED` that the lab allows.
        refused: further modules that the lab refuses, with the reasons.

    Raises:
        SubmissionError: it imports a refused module.
    """
    seen: set[str] = set()
    waiting = [file]
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        if (child.cpu_time_s or 0.0) > MAX_IMPORTS_CPU_S:
            raise SubmissionError(
                f"{name}: the imports of {file} took more than {MAX_IMPORTS_CPU_S:g} s to read.",
                "Hand in only what the lab asks for.",
            )
        if name.endswith(LRP):
            waiting += _parsed(folder / name, child, files_in)
            continue
        for module, line in _parsed(folder / name, child, imports_in):
            reason = _rejection_reason(module, may_import, REFUSED | dict(refused))
            if reason:
                raise SubmissionError(
                    f"{name}, line {line}: imports {module}, but {reason}.", f"Do without importing {module}: {reason}."
                )
            top = module.partition(".")[0]
            if os.path.isfile(folder / f"{top}.py"):  # of Path, a name that is too long for a file raises
                waiting.append(f"{top}.py")
            elif os.path.isdir(folder / top):
                waiting += [path.relative_to(folder).as_posix() for path in sorted((folder / top).rglob("*.py"))]


def _rejection_reason(module: str, may_import: frozenset[str], refused: Mapping[str, str]) -> str:
    if module.startswith(LAB_MODULE):
        return _GRADES_ITSELF
    parts = module.split(".")
    names = [".".join(parts[: count + 1]) for count in range(len(parts))]
    if any(name in may_import for name in names):
        return ""
    return next((refused[name] for name in names if name in refused), "")


def _parsed(path: Path, child: StudentProcess, parser: Callable[[bytes], list[Any]]) -> list[Any]:
    try:
        with path.open("rb") as opened:
            found: list[Any] = child.parse(parser, opened.read(_MAX_SOURCE_BYTES))
            return found
    except OSError:
        return []  # running it reports what is wrong


def files_in(source: bytes) -> list[str]:
    """Return the files that a state machine in LRP takes programs and functions of."""
    from snr_sim.behaviors.imports import files_named

    return [name for names in files_named(source.decode(errors="replace")) for name in names]


def imports_in(source: bytes) -> list[tuple[str, int]]:
    """Return the imports of a program with their lines."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    found: list[tuple[str, int]] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found += ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)
    return found


def toml_in(data: bytes) -> dict[str, Any]:
    """Return the content of a text in TOML; raise SnrError if it is not valid TOML."""
    import json  # here, as every process of a student's imports this module
    import tomllib

    try:
        found: dict[str, Any] = json.loads(json.dumps(tomllib.loads(data.decode()), default=str))  # dates as text
    except (ValueError, RecursionError) as error:
        raise SnrError(f"{error}.") from None
    return found
