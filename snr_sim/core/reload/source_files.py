"""Where the source files of a student's program are read from: the disk, or the copies in a run folder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path


class SourceFiles:
    """Files on the disk; others stand in for them while `reading_from` is entered."""

    @property
    def recorded(self) -> Sequence[Path]:
        """Paths of files that are read from somewhere else than the disk."""
        return ()

    def is_file(self, path: Path) -> bool:
        """Return whether there is such a file."""
        return path.is_file()

    def is_dir(self, path: Path) -> bool:
        """Return whether there is such a folder."""
        return path.is_dir()

    def in_folder(self, folder: Path) -> list[Path]:
        """Return the Python files in a folder, in order; none if there is no such folder."""
        return sorted(folder.glob("*.py"))

    def read(self, path: Path) -> bytes:
        """Return what is in a file.

        Raises:
            OSError: it cannot be read.
        """
        return path.read_bytes()

    def check(self, path: Path, source: bytes) -> None:
        """Raise a SyntaxError that shows the line of this source; Python itself takes it from the disk."""

    def begin_node(self) -> None:
        """Have files hold what the run began with, if it was recorded."""

    def begin_task(self, seq: int) -> None:
        """Have files hold what they held at a recorded task, if they were recorded."""

    def close(self) -> None:
        """Forget what was only needed while files were read from here."""


_files = SourceFiles()  # of the process, and not of the context: a student's threads import, too


def source_files() -> SourceFiles:
    """Return where source files are read from now."""
    return _files


@contextmanager
def reading_from(files: SourceFiles) -> Iterator[None]:
    """Read source files from elsewhere while it is entered."""
    global _files
    before, _files = _files, files
    try:
        yield
    finally:
        _files = before
        files.close()
