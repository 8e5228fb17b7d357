"""What a student handed in: looked through, and copied to a private, read-only place.

    folder or .zip -> plain files with plain names, bounded in count and size -> `into` (read-only), and notes

Nothing that points elsewhere is followed: symbolic links and devices are left out and told, an archive with absolute
names or `..` is refused whole. What is wrong is said in the student's words, for it goes into the student's report.
"""

from __future__ import annotations

import difflib
import hashlib
import os
import shutil
import stat
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TypeAlias

from snr_sim.grading.archive import Refused, entries_of

MAX_FILES = 500
MAX_BYTES = 32 * 2**20
MAX_DEPTH = 8
MAX_NAME_CHARS = 200
_CHUNK_BYTES = 2**16
_TOO_MANY = f"Your submission has more than {MAX_FILES} files."
_ONLY_WHAT_IS_ASKED = "hand in only what the lab asks for."
_MAX_NOTES = 20
# What editors, Python and macOS leave lying about, and the runs that the labs' pages have recorded beside the program:
# not part of what was handed in.
_LITTER = {"__pycache__", "__MACOSX", "venv", "node_modules", "Thumbs.db", "trace.jsonl", "result.json"}
_LITTER_SUFFIXES = (".pyc", ".pyo", "~", ".rrd")

Member: TypeAlias = tuple[str, "BinaryIO | None"]


@dataclass(frozen=True)
class TakenIn:
    """What was copied.

    Args:
        folder: read-only, with the lab's files at its top.
        digest: over names and contents of all files: whether it is still the same submission.
        notes: what was left out and what is missing, for the student.
    """

    folder: Path
    digest: str
    notes: tuple[str, ...]


def take_in(given: Path, wanted: Sequence[str], into: Path) -> TakenIn:
    """Copies a submission to `into`, which must not be there yet.

    Args:
        given: a folder or a zip archive.
        wanted: the lab's files, by name.
        into: becomes a folder of plain files, all read-only.

    Raises:
        Refused: nothing in it can be graded; says why, to the student.
    """
    notes: list[str] = []
    if given.is_dir():
        archives = sorted(path for path in given.glob("*.zip") if not path.is_symlink())
        is_wrapped = len(archives) == 1 and not any(_is_there(given, name) for name in wanted)
        if is_wrapped and not any(path.is_dir() for path in given.iterdir()):  # some systems hand out such folders
            given = archives[0]
    members = _files_under(given, notes) if given.is_dir() else entries_of(given, notes, is_litter)
    into.mkdir(mode=0o755)
    try:
        count = _copy(members, into, notes)
        if count == 0:
            raise Refused("Your submission is empty.", fix=f"hand in {_listed(wanted)}.")
        top = _top(into, wanted)
        missing = [name for name in wanted if not (top / name).is_file()]
        said = [_missing(name, into, top) for name in missing]
        if len(missing) == len(wanted):
            raise Refused(" ".join([*said, *notes[:_MAX_NOTES]]), fix=f"hand in {_listed(wanted)}.")
        if top != into:
            _lift(top, into)
        return TakenIn(into, _make_read_only(into), (*said, *notes[:_MAX_NOTES]))
    except BaseException:
        remove(into)
        raise


def remove(folder: Path) -> None:
    """Removes a folder that was made read-only; one that is not there is no mistake."""
    for path, _, _ in os.walk(folder):
        os.chmod(path, 0o700)
    shutil.rmtree(folder, ignore_errors=True)


def _is_there(folder: Path, name: str) -> bool:
    return os.path.lexists(folder / name)


def is_litter(name: str) -> bool:
    """Returns whether a part of a path says that a file does not count."""
    return name.startswith(".") or name in _LITTER or name.endswith(_LITTER_SUFFIXES)


def _files_under(folder: Path, notes: list[str]) -> Iterator[Member]:
    """Yields the plain files of a folder by relative name, each open."""
    waiting = [""]
    while waiting:
        inside = waiting.pop()
        try:
            entries = sorted(os.scandir(folder / inside), key=lambda one: one.name)
        except OSError as error:
            notes.append(f"The folder '{shown(inside)}' cannot be read ({error.strerror}) and was left out.")
            continue
        for entry in entries:
            name = f"{inside}/{entry.name}" if inside else entry.name
            if is_litter(entry.name):
                continue
            if len(notes) > MAX_FILES:
                raise Refused(_TOO_MANY, fix=_ONLY_WHAT_IS_ASKED)
            if entry.is_symlink():
                notes.append(f"'{shown(name)}' is a symbolic link and was left out: hand in the file itself.")
            elif entry.is_dir():
                yield name, None
                if name.count("/") < MAX_DEPTH:  # what lies deeper is told by the folder's name
                    waiting.append(name)
            elif not entry.is_file(follow_symlinks=False):
                notes.append(f"'{shown(name)}' is not a plain file and was left out.")
            else:
                yield from _opened(entry, name, notes)


def _opened(entry: os.DirEntry[str], name: str, notes: list[str]) -> Iterator[Member]:
    try:
        # Not followed and not waited for, also if it has become something else since we looked.
        descriptor = os.open(entry.path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError as error:
        notes.append(f"'{shown(name)}' cannot be read ({error.strerror}) and was left out.")
        return
    with open(descriptor, "rb") as file:
        if stat.S_ISREG(os.fstat(descriptor).st_mode):
            yield name, file


def _copy(members: Iterator[Member], into: Path, notes: list[str]) -> int:
    """Copies what comes, as long as it is not too much; returns how many files that were."""
    count, left, seen = 0, MAX_BYTES, 0
    for name, source in members:
        seen += 1
        if seen > 2 * MAX_FILES or count >= MAX_FILES:
            raise Refused(_TOO_MANY, fix=_ONLY_WHAT_IS_ASKED)
        why = _bad_name(name)
        if why:
            notes.append(f"'{shown(name)}' was left out: {why}.")
            continue
        if source is None:  # a folder is made when a file in it comes
            continue
        target = into / name
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            with target.open("xb") as copy:
                while data := source.read(_CHUNK_BYTES):
                    left -= len(data)
                    if left < 0:
                        raise Refused(
                            f"Your submission is larger than {MAX_BYTES // 2**20} MB.",
                            fix=_ONLY_WHAT_IS_ASKED,
                        )
                    copy.write(data)
        except (FileExistsError, NotADirectoryError) as error:
            raise Refused(f"Your submission has '{shown(name)}' twice.", fix="zip each file once.") from error
        count += 1
    return count


def _bad_name(name: str) -> str:
    """Returns why a name is not taken, or nothing."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return "its name is not text"
    if any(unicodedata.category(char) in ("Cc", "Cf", "Zl", "Zp") for char in name):
        return "its name has characters that cannot be seen"
    if len(name) > MAX_NAME_CHARS or any(len(part.encode()) > MAX_NAME_CHARS for part in name.split("/")):
        return f"its name is longer than {MAX_NAME_CHARS} characters"
    if name.count("/") >= MAX_DEPTH:
        return f"it lies more than {MAX_DEPTH} folders deep"
    return ""


def shown(name: str) -> str:
    """Returns a name as it can be printed: what is not text is written as an escape, and length is bounded.

    >>> shown("a\\x1b[2J\\udcff.py")
    'a\\\\x1b[2J\\\\udcff.py'
    """
    plain = name[:MAX_NAME_CHARS].encode("ascii" if not name.isprintable() else "utf-8", "backslashreplace").decode()
    return "".join(char if char.isprintable() else f"\\x{ord(char):02x}" for char in plain)


def _top(into: Path, wanted: Sequence[str]) -> Path:
    """Returns the folder that holds the lab's files: archives often have one folder around everything."""
    top = into
    while not any((top / name).is_file() for name in wanted):
        inside = list(os.scandir(top))
        if len(inside) != 1 or not inside[0].is_dir():
            return into
        top = Path(inside[0].path)
    return top


def _lift(top: Path, into: Path) -> None:
    """Makes the contents of a folder inside a folder the contents of that folder."""
    apart = into.with_name(f".{into.name}.top")  # no submission's name begins with a dot
    top.rename(apart)
    shutil.rmtree(into)
    apart.rename(into)


def _missing(name: str, into: Path, top: Path) -> str:
    """Says that a file of the lab is not there, and which one may be meant."""
    files = sorted(str(path.relative_to(top)) for path in top.rglob("*") if path.is_file())
    elsewhere = [file for file in files if Path(file).name == name]
    if elsewhere:
        return f"The lab wants {name}; yours is in a folder: {elsewhere[0]}. Put it at the top."
    bare = {Path(file).name.casefold().replace("_", "").replace("-", "").replace(" ", ""): file for file in files}
    near = difflib.get_close_matches(name.replace("_", ""), list(bare), n=1, cutoff=0.75)
    if near and Path(bare[near[0]]).suffix == ".ipynb":
        return f"You gave {shown(bare[near[0]])}; the lab wants {name}, a plain Python file: copy its cells into one."
    if near:
        return f"You gave {shown(bare[near[0]])}; the lab wants {name}. Rename it."
    if files and all(file.lower().endswith(".zip") for file in files):
        return f"You gave {shown(files[0])}, an archive in an archive; the lab wants {name}: zip the files themselves."
    there = ", ".join(shown(file) for file in files[:5]) + (", ..." if len(files) > 5 else "")
    return f"The lab wants {name}, which is not there. You gave: {there}."


def _make_read_only(folder: Path) -> str:
    """Takes away every right to write, and returns the digest of what is there."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            digest.update(f"{path.relative_to(folder)}\0{path.stat().st_size}\0".encode())
            with path.open("rb") as file:
                while data := file.read(_CHUNK_BYTES):
                    digest.update(data)
            path.chmod(0o444)
    for inside, _, _ in os.walk(folder):
        os.chmod(inside, 0o555)
    return digest.hexdigest()


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
