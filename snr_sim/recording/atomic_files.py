"""Files that survive a power loss: written atomically, or appended to and synced; each operation may fail or block."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from pathlib import Path

_NO_LINK = getattr(os, "O_NOFOLLOW", 0)  # not on Windows, where creating a link needs a privilege
_BINARY_MODE = getattr(os, "O_BINARY", 0)  # Windows would write \r\n for \n
_CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS)  # pipes, and some network file systems


def write_atomic(path: Path, data: bytes, mode: int = 0o644) -> None:
    """Write a file atomically: into a temporary file in the same folder, synced, then renamed.

    Raises:
        OSError: it cannot be written; the previous file is unchanged.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | _NO_LINK, mode)
        with open(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        Path(part).replace(path)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Sync a folder's entries to the disk, where the system supports it."""
    with suppress(OSError):  # Windows cannot open a folder
        descriptor = os.open(folder, os.O_RDONLY | getattr(os, "O_DIRECTORY", 0))
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def append_whole(path: Path, data: bytes) -> None:
    """Append all data to a file, which is created if it does not exist, or nothing.

    Raises:
        OSError: it cannot be written; the file is as before.
    """
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | _NO_LINK | _BINARY_MODE, 0o644)
    before_bytes = os.fstat(descriptor).st_size
    try:
        view = memoryview(data)
        while view:
            view = view[os.write(descriptor, view) :]
    except OSError:
        os.ftruncate(descriptor, before_bytes)
        raise
    finally:
        os.close(descriptor)


class FolderSync:
    """Syncs the files of a folder that have been created, or have grown, since the last time."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._synced: dict[str, int] = {}  # sizes

    def sync(self) -> None:
        """Block until all that is new is on the disk; a folder that does not exist is skipped.

        Raises:
            OSError: the disk has failed.
        """
        with suppress(FileNotFoundError):
            sizes = {one.path: one.stat().st_size for one in os.scandir(self._folder)}
            for path in [path for path, size in sizes.items() if self._synced.get(path) != size]:
                descriptor = os.open(path, os.O_RDWR | _NO_LINK)
                try:
                    os.fsync(descriptor)
                finally:
                    os.close(descriptor)
            if self._synced != sizes:
                self._synced = sizes
                sync_folder(self._folder)
                sync_folder(self._folder.parent)


class TraceFile:
    """Append-only file, which must not exist. Every method raises an OSError if the disk is full, broken or gone."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._is_named = False  # whether its name is on the disk, too
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | _BINARY_MODE, 0o644)

    def write(self, data: memoryview) -> int:
        """Append as many bytes as one system call writes; return how many."""
        return os.write(self._descriptor, data)

    def truncate(self, length_bytes: int) -> None:
        """Truncate the file to this length."""
        os.ftruncate(self._descriptor, length_bytes)

    def sync(self) -> None:
        """Block until everything that was written is on the disk and survives a power loss."""
        try:
            os.fsync(self._descriptor)
        except OSError as error:
            if error.errno not in _CANNOT_SYNC:
                raise
        if not self._is_named:
            self._is_named = True
            sync_folder(self._path.parent)
            sync_folder(self._path.parent.parent)  # of new run folders

    def close(self) -> None:
        """Close the file."""
        os.close(self._descriptor)
