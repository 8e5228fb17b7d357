"""File of a trace: all disk operations of a trace. Each may fail or block."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from snr_sim.recording.atomic_files import sync_folder

_BINARY_MODE = getattr(os, "O_BINARY", 0)  # Windows would write \r\n for \n
_CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS)  # pipes, and some network file systems


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
