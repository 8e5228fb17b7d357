"""The file of a trace: what the trace asks of a disk. A disk may refuse any of it, or take its time."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from snr_sim.recording.whole_files import sync_folder

_AS_IT_IS = getattr(os, "O_BINARY", 0)  # Windows would write \r\n for \n
_CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS)  # pipes, and some network file systems


class TraceFile:
    """A file that is only appended to.

    Args:
        path: of the file, which must not exist.

    Raises:
        OSError: here and in every method: the disk is full, broken or gone.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._is_named = False  # whether its name is on the disk, too
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | _AS_IT_IS, 0o644)

    def write(self, data: memoryview) -> int:
        """Append as much as the disk takes at once; return how many bytes."""
        return os.write(self._descriptor, data)

    def cut(self, length_bytes: int) -> None:
        """Cut the file to this length."""
        os.ftruncate(self._descriptor, length_bytes)

    def sync(self) -> None:
        """Return when everything that was written is on the disk and survives a loss of power."""
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
