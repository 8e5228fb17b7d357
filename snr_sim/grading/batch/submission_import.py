"""Import of a submission: its files are checked, and copied to a private, read-only folder.

    folder or .zip -> plain files with plain names, bounded in count and size -> `into` (read-only), and notes

Links are not followed: symbolic links and devices are left out and noted; an archive with absolute names or `..` is
refused as a whole. Messages address the student, since they go into the student's report.
"""

from __future__ import annotations

import difflib
import hashlib
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from snr_sim.grading.batch.archive import Member, members_of
from snr_sim.grading.batch.descriptors import create_file, open_file, open_folder
from snr_sim.grading.batch.member_names import (
    MAX_DEPTH,
    SubmissionRejectedError,
    TakenNames,
    is_ignored,
    parts_of,
    shown,
    skip_reason,
)

MAX_FILES = 500
MAX_BYTES = 32 * 2**20
_MAX_ENTRIES = 10_000  # of a folder, including ignored ones
_CHUNK_BYTES = 2**16
_TOO_MANY = f"Your submission has more than {MAX_FILES} files."
_ONLY_REQUIRED_FILES = "hand in only what the lab asks for."
_MAX_NOTES = 20


@dataclass(frozen=True)
class ImportedSubmission:
    """What was copied."""

    folder: Path  # read-only, with the lab's files at its top
    digest: str  # over names and contents of all files: whether it is still the same submission
    notes: tuple[str, ...]  # files left out and files missing, for the student


def import_submission(given: Path, required: Sequence[str], into: Path) -> ImportedSubmission:
    """Copy a submission, a folder or a zip archive, to `into`, which must not be there yet: plain files, all read-only.

    Raises:
        SubmissionRejectedError: none of the required files is in it; the message gives the student the reason.
    """
    notes: list[str] = []
    into.mkdir(mode=0o755)
    try:
        with _members(given, required, notes) as members, open_folder(into) as place:
            count = _copy(members, place, notes)
        if count == 0:
            raise SubmissionRejectedError("Your submission is empty.", fix=f"hand in {_listed(required)}.")
        top = _top(into, required)
        missing = [name for name in required if not (top / name).is_file()]
        messages = [_missing(name, top) for name in missing]
        if len(missing) == len(required):
            what = " ".join([*messages, *notes[:_MAX_NOTES]])
            raise SubmissionRejectedError(what, fix=f"hand in {_listed(required)}.")
        if top != into:
            _move_up(top, into)
        _make_read_only(into)
        return ImportedSubmission(into, digest_of_folder(into), (*messages, *notes[:_MAX_NOTES]))
    except BaseException:
        remove(into)
        raise


def remove(folder: Path) -> None:
    """Remove a folder that was made read-only; one that is not there is no mistake."""
    for path, _, _ in os.walk(folder):
        Path(path).chmod(0o700)
    shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _members(given: Path, required: Sequence[str], notes: list[str]) -> Iterator[Iterator[Member]]:
    """Yield the members of a folder, of an archive, or of the archive that is alone in a folder."""
    if not given.is_dir():
        with open_file(given) as archive:
            yield members_of(archive, notes)
        return
    with open_folder(given) as folder:
        name = _archive_alone_in(folder, required)
        if name is None:
            yield _files_under(folder, "", notes)
        else:
            with open_file(name, folder) as archive:
                yield members_of(archive, notes)


def _archive_alone_in(folder: int, required: Sequence[str]) -> str | None:
    """Return the archive in a folder with nothing else to grade: some systems deliver such folders."""
    entries = _entries(folder)
    archives = [one.name for one in entries if one.name.endswith(".zip") and one.is_file(follow_symlinks=False)]
    has_more = any(one.name in required or one.is_dir(follow_symlinks=False) for one in entries)
    return archives[0] if len(archives) == 1 and not has_more else None


def _entries(folder: int) -> list[os.DirEntry[str]]:
    """Return the entries of a folder, in order; raise SubmissionRejectedError if that is too much."""
    with os.scandir(folder) as found:
        entries = sorted(islice(found, _MAX_ENTRIES + 1), key=lambda one: one.name)
    if len(entries) > _MAX_ENTRIES:
        raise SubmissionRejectedError(_TOO_MANY, fix=_ONLY_REQUIRED_FILES)
    return entries


def _files_under(folder: int, inside: str, notes: list[str]) -> Iterator[Member]:
    """Yield the plain files under a folder, each open; its folders after its files.

    Nothing is opened by a path: a folder on it may have become a link meanwhile. `inside` is its name for the notes.
    """
    folders = []
    for entry in _entries(folder):
        name = f"{inside}/{entry.name}" if inside else entry.name
        if is_ignored(entry.name):
            continue
        if len(notes) > MAX_FILES:
            raise SubmissionRejectedError(_TOO_MANY, fix=_ONLY_REQUIRED_FILES)
        if entry.is_symlink():
            notes.append(f"'{shown(name)}' is a symbolic link and was left out: hand in the file itself.")
        elif entry.is_dir(follow_symlinks=False):
            yield parts_of(name), None
            folders.append((entry.name, name))
        elif not entry.is_file(follow_symlinks=False):
            notes.append(f"'{shown(name)}' is not a plain file and was left out.")
        else:
            with _note_unreadable(f"'{shown(name)}'", notes), open_file(entry.name, folder) as file:
                yield parts_of(name), file
    for one, name in folders:
        if name.count("/") < MAX_DEPTH:  # deeper entries are left out with their folder
            with _note_unreadable(f"The folder '{shown(name)}'", notes), open_folder(one, folder) as below:
                yield from _files_under(below, name, notes)


@contextmanager
def _note_unreadable(what: str, notes: list[str]) -> Iterator[None]:
    """Note a file or folder that cannot be opened, and continue without it."""
    try:
        yield
    except OSError as error:
        notes.append(f"{what} cannot be read ({error.strerror}) and was left out.")


def _copy(members: Iterator[Member], into: int, notes: list[str]) -> int:
    """Copy the members within the limits; return the number of files."""
    count, left, seen = 0, MAX_BYTES, 0
    taken = TakenNames()
    for parts, source in members:
        seen += 1
        if seen > 2 * MAX_FILES or count >= MAX_FILES:
            raise SubmissionRejectedError(_TOO_MANY, fix=_ONLY_REQUIRED_FILES)
        reason = skip_reason(parts) if parts or source is not None else ""  # the folder itself, "./", is not a member
        if reason:
            notes.append(f"'{shown('/'.join(parts))}' was left out: {reason}.")
        if reason or source is None:  # a folder is created with the first file in it
            continue
        taken.add(parts)
        with create_file(parts, into) as copy:
            while data := source.read(_CHUNK_BYTES):
                left -= len(data)
                if left < 0:
                    what = f"Your submission is larger than {MAX_BYTES // 2**20} MB."
                    raise SubmissionRejectedError(what, fix=_ONLY_REQUIRED_FILES)
                copy.write(data)
        count += 1
    return count


def _top(into: Path, required: Sequence[str]) -> Path:
    """Return the folder that contains the lab's files: archives often have one folder around everything."""
    top = into
    while not any((top / name).is_file() for name in required):
        inside = list(os.scandir(top))
        if len(inside) != 1 or not inside[0].is_dir():
            return into
        top = Path(inside[0].path)
    return top


def _move_up(top: Path, into: Path) -> None:
    """Make the contents of a folder inside a folder the contents of that folder."""
    apart = into.with_name(f".{into.name}.top")  # no submission's name begins with a dot
    top.rename(apart)
    shutil.rmtree(into)
    apart.rename(into)


def _missing(name: str, top: Path) -> str:
    """Say that a file of the lab is not there, and which one may be meant."""
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


def _make_read_only(folder: Path) -> None:
    for inside, _, names in os.walk(folder):
        for name in names:
            Path(inside, name).chmod(0o444)
        Path(inside).chmod(0o555)


def digest_of_folder(folder: Path) -> str:
    """Return a digest over the names and contents of all files in a folder, bytecode left out."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            digest.update(f"{path.relative_to(folder)}\0{path.stat().st_size}\0".encode())
            with path.open("rb") as file:
                while data := file.read(_CHUNK_BYTES):
                    digest.update(data)
    return digest.hexdigest()


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
