"""Submissions of a class: each has a unique name, which stays the same when the class is graded again."""

from __future__ import annotations

import os
import stat
import unicodedata
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from snr_sim.grading.batch.member_names import is_ignored
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.text import escaped

_MAX_ID_CHARS = 60


class Submission(NamedTuple):
    """A submission and its unique name in the class."""

    id: str
    given: Path


def name_submissions(
    given: Iterable[Path], known: Sequence[Submission] = (), required_files: Sequence[str] = ()
) -> list[Submission]:
    """Return each submission, once, with a name that is safe in paths and tables and that no other has.

    Args:
        given: folders and archives, by path.
        known: submissions named before, as by an interrupted run: keep their names.
        required_files: the lab's. If one folder alone is given, with none of them at its top but folders, it is a
            class's, though a file lies about in it.

    Raises:
        SnrError: one is not there, or has a name that is not text; or what is given cannot be read, or is a folder of
            submissions. (Among many these are one student's, who must not stop the others.)
    """
    named = {submission.given: submission for submission in known}
    taken = {submission.id.casefold() for submission in known}
    # The class's folder may have moved: then submissions missing at its old path match those at its new one.
    moved = {_safe_name(one.given): one for one in reversed(known) if not one.given.exists()}
    paths = list(dict.fromkeys(Path(os.path.abspath(path)) for path in given))
    for path in paths:
        _need_submission(path)
    _need_students(paths, required_files if len(paths) == 1 else ())
    for path in paths:
        if path not in named and (before := moved.pop(_safe_name(path), None)):
            named[path] = Submission(before.id, path)
        if path not in named:
            named[path] = Submission(_free_name(_safe_name(path), taken), path)
            taken.add(named[path].id.casefold())
    return [named[path] for path in paths]


def _need_submission(path: Path) -> None:
    try:
        str(path).encode()
        mode = path.stat().st_mode
    except UnicodeEncodeError as error:
        raise SnrError(f"The name '{escaped(path.name)}' is not text (UTF-8).", fix="rename it.") from error
    except (OSError, ValueError) as error:
        raise SnrError(f"There is no submission '{path}'.", fix="give folders and .zip files by path.") from error
    if not (stat.S_ISDIR(mode) or stat.S_ISREG(mode)):
        raise SnrError(f"'{path}' is neither a folder nor a file.", fix="give folders and .zip files by path.")


def _need_students(paths: Sequence[Path], required_files: Sequence[str]) -> None:
    """Raise SnrError if nothing is a student's: each path is a folder that cannot be read, or of submissions."""
    refusals = [_refusal(path, required_files) if path.is_dir() else None for path in paths]
    if refusals and all(refusals):
        raise next(filter(None, refusals))


def _refusal(folder: Path, required_files: Sequence[str]) -> SnrError | None:
    """Return why a folder cannot be a submission, or None."""
    try:
        inside = sorted(one for one in folder.iterdir() if not is_ignored(one.name))
    except OSError as error:
        return SnrError(f"'{folder}' cannot be read: {error.strerror}.", fix="check its permissions.")
    many = [one.name for one in inside if os.path.isdir(one) or one.name.lower().endswith(".zip")]
    is_students = any((folder / name).is_file() for name in required_files)
    if len(many) < 2 or not (len(many) == len(inside) or (required_files and not is_students)):
        return None
    return SnrError(
        f"'{folder}' is not a submission, but holds {len(many)}: {escaped(many[0])}, {escaped(many[1])}, ...",
        fix=f"give what is in it: {folder}/*.",
    )


def _safe_name(path: Path) -> str:
    """Return letters, digits and - _ . of a file's name, so that it is one folder's name everywhere.

    >>> _safe_name(Path("/class/Zoë Müller (late).zip"))
    'Zoë_Müller_late'
    >>> _safe_name(Path(".zip")), _safe_name(Path("=cmd|x"))
    ('zip', 'cmd_x')
    """
    name = path.stem if path.suffix.lower() == ".zip" else path.name
    name = unicodedata.normalize("NFC", name.encode(errors="replace").decode())
    kept = "".join(char if char.isalnum() or char in "-._" else " " for char in name)
    return "_".join(kept.split())[:_MAX_ID_CHARS].strip("-._") or "submission"


def _free_name(name: str, taken: set[str]) -> str:
    number = 1
    free = name
    while free.casefold() in taken:
        number += 1
        free = f"{name}-{number}"
    return free
