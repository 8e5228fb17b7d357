"""Names of the files in a submission: the only module that turns one into a path.

A student chose them, so each is split into parts and checked before anything is opened: no name leads out of the
submission, and none has invisible characters. Archives and folders are treated alike.
"""

from __future__ import annotations

import re
import unicodedata

from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.text import escaped

MAX_DEPTH = 8
MAX_NAME_CHARS = 200
_DRIVE = re.compile(r"[A-Za-z]:")
# Files that editors, Python and macOS create, and the runs that the labs' pages record next to the program:
# not part of the submission.
_IGNORED = {"__pycache__", "__MACOSX", "venv", "node_modules", "Thumbs.db", "trace.jsonl", "result.json"}
_IGNORED_SUFFIXES = (".pyc", ".pyo", "~", ".rrd")


class SubmissionRejectedError(SnrError):
    """A submission that cannot be graded. The message addresses the student."""


def parts_of(name: str) -> tuple[str, ...]:
    """Return the parts of a member's path; none of them is empty, "." or "..", or contains a separator.

    Args:
        name: as the archive or the folder has it, with / or \\ between its parts.

    Raises:
        SubmissionRejectedError: the name leads out of the submission.

    >>> parts_of("./lab2//a/./depth_hold.py"), parts_of("lab2\\\\depth_hold.py"), parts_of("./")
    (('lab2', 'a', 'depth_hold.py'), ('lab2', 'depth_hold.py'), ())
    """
    parts = name.replace("\\", "/").split("/")
    if (parts[0] == "" and len(parts) > 1) or ".." in parts or _DRIVE.match(name):
        raise SubmissionRejectedError(
            f"Your submission names a file outside itself: '{shown(name)}'.",
            fix="zip the folder with your files, by their names alone.",
        )
    return tuple(part for part in parts if part not in ("", "."))


def skip_reason(parts: tuple[str, ...]) -> str:
    """Return why a file of this path is left out, or an empty text."""
    name = "/".join(parts)
    if not name:
        return "it has no name"
    try:
        name.encode()
    except UnicodeEncodeError:
        return "its name is not text"
    if any(unicodedata.category(char) in ("Cc", "Cf", "Zl", "Zp") for char in name):
        return "its name has characters that cannot be seen"
    if len(name) > MAX_NAME_CHARS or any(len(part.encode()) > MAX_NAME_CHARS for part in parts):
        return f"its name is longer than {MAX_NAME_CHARS} characters"
    if len(parts) > MAX_DEPTH:
        return f"it lies more than {MAX_DEPTH} folders deep"
    return ""


def is_ignored(name: str) -> bool:
    """Return whether a part of a path marks the file as left out."""
    return name.startswith(".") or name in _IGNORED or name.endswith(_IGNORED_SUFFIXES)


def shown(name: str) -> str:
    """Return a printable form of a name: bytes and characters that are not text as escapes, with bounded length.

    >>> shown("a\\x1b[2J\\udcff.py")
    'a\\\\x1b[2J\\\\udcff.py'
    """
    return escaped(name[:MAX_NAME_CHARS])


class TakenNames:
    """Paths used so far, to find two that a file system may treat as the same."""

    def __init__(self) -> None:
        self._taken: dict[str, tuple[str, bool]] = {}  # name, and whether of a file; by the name as systems compare it

    def add(self, parts: tuple[str, ...]) -> None:
        """Take the path of a file.

        Raises:
            SubmissionRejectedError: it is there already, or differs only in capitals or in the encoding of its letters.
        """
        for count in range(1, len(parts) + 1):
            name, is_file = "/".join(parts[:count]), count == len(parts)
            # The form of a name that macOS and Windows compare.
            key = unicodedata.normalize("NFC", unicodedata.normalize("NFD", name).casefold())
            if key not in self._taken:
                self._taken[key] = name, is_file
                continue
            taken, is_taken_by_file = self._taken[key]
            if not (is_file or is_taken_by_file):
                continue  # they are in the same folder
            if taken == name:
                raise SubmissionRejectedError(f"Your submission has '{shown(taken)}' twice.", fix="zip each file once.")
            raise SubmissionRejectedError(
                f"Your submission has '{shown(taken)}' and '{shown(name)}', which are the same name on many computers.",
                fix="rename one of them.",
            )
