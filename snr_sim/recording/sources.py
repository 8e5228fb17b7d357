"""Copies of a program's source files in its run folder, so that a replay executes what was recorded.

    sources/files.jsonl       a line for each file: its path, its sha256, and a mark of the user who recorded it
    sources/<sha256>.py       its content; a reload that reads changed text adds another one

A path is only a name here and is never opened. The mark proves that this user recorded a run with that file on this
computer: it is made with a key that no other user has, so a user's own files can be distinguished from foreign ones.
"""

from __future__ import annotations

import hashlib
import hmac
import importlib.util
import json
import linecache
import os
import re
import secrets
import stat
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec

from snr_sim.core.reload.sources import SUFFIXES, SourceFiles, file_of, reading_from, source_files
from snr_sim.prelude.errors import TraceError
from snr_sim.prelude.user_folder import user_folder
from snr_sim.recording.atomic_files import append_whole

FOLDER = "sources"
TABLE = "files.jsonl"
MAX_FILES = 200
MAX_FILE_BYTES = 4_000_000
MAX_BYTES = 16_000_000
MAX_PATH_CHARS = 4096
_MAX_TABLE_BYTES = MAX_FILES * (MAX_PATH_CHARS + 400)
_SHA256 = re.compile(r"[0-9a-f]{64}")
_SUFFIX = re.compile(r"(\.[A-Za-z0-9]{1,8})?")
_KEY_BYTES = 32
# Windows cannot open a folder, so there names are resolved as paths.
_HAS_FOLDERS = os.open in os.supports_dir_fd


class TableLine(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A line of the table."""

    path: str
    sha256: str
    mark: str


_decode_line = msgspec.json.Decoder(TableLine).decode


@dataclass(frozen=True)
class KeptFile:
    """A file that a run was recorded with."""

    path: Path  # where it was; never opened
    sha256: str  # of its bytes
    is_own: bool  # whether this user has recorded a run with it on this computer
    data: bytes


class KeepingFiles(SourceFiles):
    """Files on the disk; those of the user's own program are copied into the run folder when they are read.

    A failed copy does not end the run: a replay then requires the file, or `--with`.
    """

    def __init__(self, run: Path, is_kept: Callable[[Path], bool]) -> None:
        self.left_out: list[str] = []  # reasons why files were not copied
        self._folder = run / FOLDER
        self._is_kept = is_kept
        self._key = _own_key()
        self._lines: set[tuple[str, str]] = set()
        self._bytes = 0
        self._lock = threading.Lock()  # threads import, too

    def read(self, path: Path) -> bytes:
        """Return the content of a file; keep a copy if it belongs to the user's program."""
        data = super().read(path)
        if self._is_kept(path):
            self.keep(path, data)
        return data

    def keep(self, path: Path, data: bytes) -> None:
        """Keep a copy of a file."""
        line = (str(path), hashlib.sha256(data).hexdigest())
        with self._lock:
            if line in self._lines:
                return
            self._lines.add(line)
            if len(self._lines) > MAX_FILES or len(data) > MAX_FILE_BYTES or self._bytes + len(data) > MAX_BYTES:
                self.left_out.append(f"{path.name} was not kept for a replay: it is too large, or there are too many.")
                return
            self._bytes += len(data)
            try:
                self._write(path, line[1], data)
            except OSError as error:
                self.left_out.append(f"{path.name} could not be kept for a replay: {error.strerror}.")

    def _write(self, path: Path, sha256: str, data: bytes) -> None:
        self._folder.mkdir(exist_ok=True)
        copy = self._folder / _name_of(sha256, path)
        if not copy.exists() or not copy.stat().st_size:  # empty: a full disk had no room for it
            append_whole(copy, data)
        line = {"path": str(path), "sha256": sha256, "mark": _mark_of(sha256, self._key)}
        append_whole(self._folder / TABLE, f"{json.dumps(line)}\n".encode())


class RecordedFiles(SourceFiles):
    """Files as recorded with a run, instead of those on the disk.

    Args:
        kept: the copies; the first one of a path is the version at the start of the run.
        reloads: by the seq of the task that reloaded: sha256 of each file that was read, by its name and its folder's.
        is_of_kit: whether a file belongs to snr_sim; these are read from the disk.
        folders: files in these that were not recorded are read from the disk, too: the user has just named them.
    """

    def __init__(
        self,
        kept: Iterable[KeptFile],
        reloads: Mapping[int, Mapping[str, str]],
        is_of_kit: Callable[[Path], bool],
        folders: Sequence[Path] = (),
    ) -> None:
        self._at_first: dict[Path, bytes] = {}
        self._data: dict[str, bytes] = {}
        for one in kept:
            self._at_first.setdefault(one.path, one.data)
            self._data[one.sha256] = one.data
        self._reloads = reloads
        self._is_of_kit = is_of_kit
        self._folders = folders
        self._shown: set[str] = set()
        self._now = dict(self._at_first)

    @property
    def recorded(self) -> Sequence[Path]:
        """Paths of the files that were recorded."""
        return tuple(self._at_first)

    def is_file(self, path: Path) -> bool:
        """Return whether the file was recorded."""
        return super().is_file(path) if self._is_on_disk(path) else path in self._now

    def is_dir(self, path: Path) -> bool:
        """Return whether files in the folder or its subfolders were recorded."""
        return super().is_dir(path) if self._is_on_disk(path) else any(path in one.parents for one in self._now)

    def in_folder(self, folder: Path) -> list[Path]:
        """Return the programs in a folder that were recorded."""
        if self._is_on_disk(folder):
            return super().in_folder(folder)
        return sorted(one for one in self._now if one.parent == folder and one.suffix in SUFFIXES)

    def read(self, path: Path) -> bytes:
        """Return a program's recorded content, whose lines messages show; other files are read from disk."""
        if path.suffix not in SUFFIXES or self._is_on_disk(path):
            return super().read(path)
        if path not in self._now:
            raise FileNotFoundError(2, "it was not recorded with this run", str(path))
        data = self._now[path]
        with suppress(SyntaxError, UnicodeDecodeError):  # the error is raised when the file is compiled
            lines = importlib.util.decode_source(data).splitlines(keepends=True)
            linecache.cache[str(path)] = (len(data), None, lines, str(path))
            self._shown.add(str(path))
        return data

    def check(self, path: Path, source: bytes) -> None:
        """Raise a SyntaxError that shows the recorded line, without opening a file."""
        if self._is_on_disk(path):
            return
        try:
            compile(source, "<recorded>", "exec", dont_inherit=True)
        except SyntaxError as error:
            error.filename = str(path)
            raise

    def _is_on_disk(self, path: Path) -> bool:
        whole = Path(os.path.normpath(path))
        is_named = path not in self._now and any(whole.is_relative_to(folder) for folder in self._folders)
        return is_named or self._is_of_kit(path)

    def begin_node(self) -> None:
        """Go back to the files at the start of the run."""
        self._now = dict(self._at_first)

    def begin_task(self, seq: int) -> None:
        """Switch to the files that this task read in the recording, if it was a reload."""
        read_then = self._reloads.get(seq, {})
        for path in self._now:
            sha256 = read_then.get("/".join(path.parts[-2:]))
            if sha256 in self._data:
                self._now[path] = self._data[sha256]

    def close(self) -> None:
        """Let messages show the current content of the files again."""
        for name in self._shown:
            linecache.cache.pop(name, None)


@contextmanager
def keep_copies(run: Path, files: Iterable[Path], is_own: Callable[[Path], bool]) -> Iterator[KeepingFiles]:
    """Keep copies in a run folder of the user's own files among these, and of files read while active."""
    kept = KeepingFiles(run, is_own)
    for path in files:
        with suppress(OSError):  # it was deleted after it was loaded
            kept.read(path)
    with reading_from(kept):
        yield kept


def sha256_of(path: Path) -> str:
    """Return the sha256 of a file."""
    return hashlib.sha256(source_files().read(path)).hexdigest()


def program_sources(path: Path) -> dict[str, str]:
    """Return the sha256 of a program's file, by its name in a trace."""
    return {f"program/{path.name}": sha256_of(path)}


def program_files(program: Path) -> list[Path]:
    """Return a program's file, and the files in its folder and below that this process has imported."""
    files = [file for module in list(sys.modules.values()) if (file := file_of(module)) is not None]
    siblings = [file for file in files if file.is_absolute() and file.is_relative_to(program.parent)]
    return [program, *sorted(set(siblings) - {program})]


def read_kept_files(run: Path) -> list[KeptFile]:
    """Return the copies in a run folder, checked, in the order of its table; none if it has no table.

    Raises:
        TraceError: a copy does not match the table, is a link or too large, or the table is damaged.
    """
    if not _HAS_FOLDERS:
        return _read_table(run, None) if (run / FOLDER).is_dir() else []
    try:
        folder = os.open(run / FOLDER, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except FileNotFoundError:
        return []
    except OSError as error:
        raise _unusable(run, f"{FOLDER} is not a folder ({error.strerror})") from error
    try:
        return _read_table(run, folder)
    finally:
        os.close(folder)


def copy_of(run: Path, kept: KeptFile) -> Path:
    """Return the path of a copy in its run folder."""
    return run / FOLDER / _name_of(kept.sha256, kept.path)


def _read_table(run: Path, folder: int | None) -> list[KeptFile]:
    key = _own_key()
    kept: list[KeptFile] = []
    left_bytes = MAX_BYTES
    lines = _read(run, folder, TABLE, _MAX_TABLE_BYTES).splitlines()
    if len(lines) > MAX_FILES:
        raise _unusable(run, f"{TABLE} names {len(lines)} files, of at most {MAX_FILES}")
    for number, text in enumerate(lines, 1):
        try:
            line = _decode_line(text)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            if number == len(lines) and not text.endswith(b"}"):
                break  # truncated when the run was killed
            raise _unusable(run, f"line {number} of {TABLE} is damaged ({error})") from error
        if not (_is_plain_path(line.path) and _SHA256.fullmatch(line.sha256)):
            raise _unusable(run, f"line {number} of {TABLE} does not name a file: {line.path[:100]!r}")
        path = Path(line.path)
        name = _name_of(line.sha256, path)
        data = _read(run, folder, name, min(MAX_FILE_BYTES, left_bytes))
        left_bytes -= len(data)
        if hashlib.sha256(data).hexdigest() != line.sha256:
            raise _unusable(run, f"{name} does not hold what its name says")
        is_own = bool(key) and hmac.compare_digest(_mark_of(line.sha256, key).encode(), line.mark.encode())
        kept.append(KeptFile(path, line.sha256, is_own, data))
    return kept


def _read(run: Path, folder: int | None, name: str, max_bytes: int) -> bytes:
    """Return the content of a file in the folder, which must be a regular file of at most `max_bytes`."""
    try:
        if folder is None:
            descriptor = os.open(run / FOLDER / name, os.O_RDONLY)
        else:
            descriptor = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=folder)
    except OSError as error:
        raise _unusable(run, f"{name} cannot be read ({error.strerror})") from error
    with open(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise _unusable(run, f"{name} is not a plain file")
        data = file.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise _unusable(run, f"{name} is too large")
    return data


def _is_plain_path(text: str) -> bool:
    """Return whether a text is an absolute path without "..", of printable characters."""
    is_whole = Path(text).is_absolute() and os.path.normpath(text) == text
    return is_whole and len(text) <= MAX_PATH_CHARS and text.isprintable()


def _name_of(sha256: str, path: Path) -> str:
    return sha256 + (path.suffix if _SUFFIX.fullmatch(path.suffix) else "")


def _unusable(run: Path, what: str) -> TraceError:
    return TraceError(
        f"The sources in {run} cannot be used: {what}.",
        fix="take an untouched copy of the run; or name the code to replay it with: --with FILE.",
    )


def _own_key() -> bytes:
    """Return the key of this user, created at first use; empty where it cannot be stored."""
    path = user_folder() / "key"
    with suppress(OSError):
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        part = path.with_name(f"key.{os.getpid()}.{secrets.token_hex(4)}")
        if not path.exists():
            descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with open(descriptor, "wb") as file:
                file.write(secrets.token_bytes(_KEY_BYTES))
            with suppress(FileExistsError):
                os.link(part, path)  # atomic, and never replaces the key of another process
            part.unlink()
        key = path.read_bytes()
        return key if len(key) == _KEY_BYTES else b""
    return b""


def _mark_of(sha256: str, key: bytes) -> str:
    return hmac.new(key, f"snr source {sha256}".encode(), hashlib.sha256).hexdigest() if key else ""
