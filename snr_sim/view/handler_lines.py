"""Lines of handlers, for the text of pages: found in the files that a run was recorded with, not in the trace."""

from __future__ import annotations

import ast
import warnings
from collections import Counter
from contextlib import suppress
from pathlib import Path

from snr_sim.prelude.errors import TraceError
from snr_sim.recording.sources import read_kept_files


def handler_lines(run: Path) -> dict[str, str]:
    """Return where each method is defined, as "gentle.py line 14", by its name.

    Without those of a name that several classes have: the trace names the component, not its class.
    """
    places: dict[str, str] = {}
    count: Counter[str] = Counter()
    with suppress(TraceError):  # of a folder that was changed since: then there are no lines
        for kept in read_kept_files(run):
            for name, line in _methods(kept.data) if kept.path.suffix == ".py" else ():
                places[name] = f"{kept.path.name} line {line}"
                count[name] += 1
    return {name: place for name, place in places.items() if count[name] == 1}


def _methods(source: bytes) -> list[tuple[str, int]]:
    try:
        with warnings.catch_warnings():  # of the student's file, which were shown when it was executed
            warnings.simplefilter("ignore")
            tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    classes = [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    return [(one.name, one.lineno) for node in classes for one in node.body if isinstance(one, ast.FunctionDef)]
