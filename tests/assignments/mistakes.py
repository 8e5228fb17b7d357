"""Wrong solutions of the labs: each is a small change of the reference.

    assignments/<lab>/starter --> tests/assignments/<lab>/reference --> a Mistake of tests/assignments/<lab>/mistakes.py

`write_solution` writes these over each other into a folder, as a student would submit it.
"""

import importlib
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
LABS = sorted(folder.name for folder in (HERE.parents[1] / "assignments").glob("[0-9]*"))

Change = Callable[[Path], None]  # changes the files in a folder


class MistakeError(Exception):
    """A mistake that cannot be applied to its reference."""


@dataclass(frozen=True)
class Mistake:
    """A wrong solution.

    Args:
        what: what it does wrong, in one sentence.
        lost: by name of the check, the points that it loses.
        hint: a part of what the grader must print for it.
        changes: of the reference, applied in this order.
    """

    what: str
    lost: Mapping[str, float]
    hint: str
    changes: Sequence[Change]


def replace(file: str, old: str, new: str) -> Change:
    """Return a change that replaces a text which must occur exactly once in a file."""

    def change(folder: Path) -> None:
        text = _existing(folder / file).read_text()
        if text.count(old) != 1:
            raise MistakeError(f"{file} must contain this text once, not {text.count(old)} times: {old!r}")
        (folder / file).write_text(text.replace(old, new))

    return change


def write(file: str, content: str | bytes) -> Change:
    """Return a change that writes a whole file, for content unrelated to the reference's file."""
    data = content.encode() if isinstance(content, str) else content

    def change(folder: Path) -> None:
        (folder / file).write_bytes(data)

    return change


def remove(file: str) -> Change:
    """Return a change that removes a file."""
    return lambda folder: _existing(folder / file).unlink()


def mistakes_of(lab: str) -> dict[str, Mistake]:
    """Return the mistakes of a lab such as "02_depth_hold" by their names."""
    module = importlib.import_module(f"tests.assignments.{lab.partition('_')[2]}.mistakes")
    table: dict[str, Mistake] = module.MISTAKES
    return table


def write_starter(lab: str, folder: Path) -> Path:
    """Write what students of a lab begin with into a folder, and return the folder."""
    return _copy(HERE.parents[1] / "assignments" / lab / "starter", folder)


def write_solution(lab: str, folder: Path, mistake: str = "", *, starter: bool = True) -> Path:
    """Write a lab's starter, its reference and a mistake into a folder.

    Args:
        lab: such as "02_depth_hold".
        folder: is created if it does not exist.
        mistake: name of one in the lab's table; empty for the reference as it is.
        starter: whether to include the files of the starter that the reference does not have.

    Returns:
        The folder.

    Raises:
        MistakeError: a change of the mistake does not fit the reference.
    """
    if starter:
        write_starter(lab, folder)
    _copy(HERE / lab.partition("_")[2] / "reference", folder)
    if mistake:
        try:
            apply(mistakes_of(lab)[mistake], folder)
        except MistakeError as error:
            raise MistakeError(f"Lab {lab}, mistake {mistake}: {error}") from error
    return folder


def apply(mistake: Mistake, folder: Path) -> None:
    """Apply the changes of a mistake to a folder that contains the reference.

    Raises:
        MistakeError: a text that is to be replaced does not occur exactly once, or a file does not exist.
    """
    for change in mistake.changes:
        change(folder)


def _copy(source: Path, folder: Path) -> Path:
    ignored = shutil.ignore_patterns("__pycache__")
    return Path(shutil.copytree(source, folder, dirs_exist_ok=True, ignore=ignored))


def _existing(path: Path) -> Path:
    if not path.is_file():
        raise MistakeError(f"{path.name} is neither in the starter nor in the reference.")
    return path
