"""Atomic file writes: a file is complete or absent, even after a power loss during the write."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

_PART = ".part"
_NO_LINK = getattr(os, "O_NOFOLLOW", 0)  # not on Windows, where creating a link needs a privilege


def write_atomic(path: Path, data: bytes, mode: int = 0o644) -> None:
    """Write a file atomically: into a temporary file in the same folder, synced, then renamed.

    Raises:
        OSError: it cannot be written; the previous file is unchanged.
    """
    part = path.with_name(f".{path.name}{_PART}")
    try:
        descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | _NO_LINK, mode)
        with open(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
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
