"""Files opened part by part, by the descriptor of the folder they are in.

A path that is resolved as a whole can change between two calls: a folder becomes a link to another one, and the
second call opens `folder/file` there. A descriptor stays at the folder it was opened for.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC
# A pipe is not waited for, whatever the name has become since it was listed.
_FILE = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC


@contextmanager
def open_folder(name: str | Path, inside: int | None = None) -> Iterator[int]:
    """Yield the descriptor of a folder; raise OSError if it is not one, or cannot be read.

    `name` is a path that the caller trusts; with the descriptor of a folder `inside`, a single name in it, no link.
    """
    descriptor = os.open(name, _FOLDER if inside is None else _FOLDER | os.O_NOFOLLOW, dir_fd=inside)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


@contextmanager
def open_file(name: str | Path, inside: int | None = None) -> Iterator[BinaryIO]:
    """Yield a plain file, open for reading, named as for `open_folder`; raise OSError if there is none to read."""
    flags = _FILE if inside is not None else _FILE & ~os.O_NOFOLLOW
    with open(os.open(name, flags, dir_fd=inside), "rb") as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(0, "it is not a plain file")
        yield file


@contextmanager
def create_file(parts: tuple[str, ...], inside: int) -> Iterator[BinaryIO]:
    """Yield a new file under the folder of a descriptor, open for writing; its parent folders are created.

    Raises:
        FileExistsError: it is there already.
        ValueError: the path leads elsewhere.
        OSError: it cannot be made.
    """
    if not parts or any(part in ("", ".", "..") or "/" in part for part in parts):
        raise ValueError(f"{parts!r} does not lie inside.")
    folder = os.dup(inside)
    try:
        for part in parts[:-1]:
            with suppress(FileExistsError):
                os.mkdir(part, 0o755, dir_fd=folder)
            above, folder = folder, os.open(part, _FOLDER | os.O_NOFOLLOW, dir_fd=folder)
            os.close(above)
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
        descriptor = os.open(parts[-1], flags, 0o644, dir_fd=folder)
    finally:
        os.close(folder)
    with open(descriptor, "wb") as file:
        yield file
