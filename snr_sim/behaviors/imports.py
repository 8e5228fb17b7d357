"""What a program takes from other files: exported forms of LRP programs, and functions of Python files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import PurePosixPath
from typing import Any, TypeAlias, TypeVar

from snr_sim.behaviors.reader import Form, Text, Word, read

Actions: TypeAlias = Mapping[str, Mapping[str, Callable[..., Any]]]
FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])

MAX_FILES = 20
_MARK = "is_snr_action"


def action(function: FunctionT) -> FunctionT:
    """Mark a function of a Python file as one that blocks of an LRP program in the same folder may call.

        @action
        def next_turn(left_cm, right_cm): ...           # in moves.py

        (actions "moves.py")                            ; in the program: [turn = next_turn(20, 30)]

    It is given values and returns one. It must not depend on anything else, or a replay differs.
    """
    setattr(function, _MARK, True)
    return function


def actions_of(names: Mapping[str, Any]) -> dict[str, Callable[..., Any]]:
    """Return the functions of a module that are marked."""
    return {name: one for name, one in names.items() if callable(one) and getattr(one, _MARK, False)}


def files_named(text: str) -> tuple[list[str], list[str]]:
    """Return the files that a text imports, and those of which it takes actions; those with valid names."""
    found: dict[str, dict[str, None]] = {"import": {}, "actions": {}}
    for word, name in _named(read(text)[0]):
        if not why_not(name, ".py" if word == "actions" else ".lrp"):
            found[word][name] = None
    return list(found["import"]), list(found["actions"])


def texts_of(text: str, read_text: Callable[[str], str | None]) -> dict[str, str]:
    """Return the texts of the programs that a text imports, and of those that they import, by the names of their files.

    Args:
        text: of the program.
        read_text: returns the text of a file in its folder, or None if it does not exist.
    """
    found, left = dict[str, str](), [text]
    while left:
        for name in files_named(left.pop())[0]:
            one = read_text(name) if name not in found and len(found) < MAX_FILES else None
            if one is not None:
                found[name] = one
                left.append(one)
    return found


def _named(forms: list[Form]) -> Iterator[tuple[str, str]]:
    for form in forms:
        match form.items:
            case (Word("import" | "actions" as word), Text(name)):
                yield word, name


def why_not(name: str, suffix: str) -> str:
    """Return why a name cannot be that of a file in the folder of a program; empty if it can."""
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name or "\0" in name or ":" in name:
        return "it leaves the folder of the program"
    return "" if path.suffix == suffix and path.stem else f"it is not a {suffix} file"
