"""Source files of a student's program, read from the disk or from the copies in a run folder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

SUFFIXES = (".py", ".lrp")  # of programs: Python, and state machines in text


class SourceFiles:
    """Files on the disk; `reading_from` replaces them by others."""

    @property
    def recorded(self) -> Sequence[Path]:
        """Paths of files that are not read from the disk."""
        return ()

    def is_file(self, path: Path) -> bool:
        """Return whether the file exists."""
        return path.is_file()

    def is_dir(self, path: Path) -> bool:
        """Return whether the folder exists."""
        return path.is_dir()

    def in_folder(self, folder: Path) -> list[Path]:
        """Return the programs in a folder, in order; none if it does not exist."""
        return sorted(path for path in folder.glob("*") if path.suffix in SUFFIXES)

    def read(self, path: Path) -> bytes:
        """Return the content of a file; raise an OSError if it cannot be read."""
        return path.read_bytes()

    def check(self, path: Path, source: bytes) -> None:
        """Raise a SyntaxError that shows the line of this source; Python itself would show the line on the disk."""

    def begin_node(self) -> None:
        """Set the files to their content at the start of the run, if it was recorded."""

    def begin_task(self, seq: int) -> None:
        """Set the files to their content at a recorded task, if it was recorded."""

    def close(self) -> None:
        """Release resources needed only for reading files."""


_files = SourceFiles()  # per process, not per context: a student's threads import as well


def source_files() -> SourceFiles:
    """Return the present source of files."""
    return _files


@contextmanager
def reading_from(files: SourceFiles) -> Iterator[None]:
    """Read source files from `files` while active."""
    global _files
    before, _files = _files, files
    try:
        yield
    finally:
        _files = before
        files.close()
