"""A zip archive that a stranger made: its plain files, one after the other, never more than was agreed in memory.

Nothing in the archive is believed: not the sizes it claims, not the names, not how much a piece unpacks to.
"""

from __future__ import annotations

import io
import stat
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, cast

from snr_sim.prelude.errors import SnrError

MAX_ARCHIVE_BYTES = 32 * 2**20
MAX_DIRECTORY_BYTES = 2**19  # of the archive's list of contents, some 50 to 300 bytes a file
MAX_RATIO = 200  # unpacked to packed; text is about 5, and the densest that deflate can write is 1032
_RATIO_FROM_BYTES = 2**20  # small files of zeros are nobody's bomb
_ENCRYPTED = 1
_DAMAGES = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, ValueError, OverflowError)


class Refused(SnrError):
    """A submission with nothing in it that can be graded. Its words are for the student."""


def entries_of(path: Path, notes: list[str], is_litter: Callable[[str], bool]) -> Iterator[tuple[str, BinaryIO | None]]:
    """Yields each plain file by its name in the archive, open for reading; of a folder None in the file's place.

    Args:
        path: the archive.
        notes: what is left out is told here.
        is_litter: which part of a name says that a file does not count.

    Raises:
        Refused: it is no archive, a damaged one, one that means harm, or one that cannot be opened.
    """
    if path.stat().st_size > MAX_ARCHIVE_BYTES:
        raise Refused(
            f"Your archive is larger than {MAX_ARCHIVE_BYTES // 2**20} MB.",
            fix="zip only what the lab asks for, without recorded runs.",
        )
    try:
        with path.open("rb") as file, zipfile.ZipFile(cast(Any, _Bounded(file))) as archive:
            for info in archive.infolist():
                name = _checked_name(info)
                if any(is_litter(part) for part in name.split("/")):
                    continue
                mode = info.external_attr >> 16
                if stat.S_IFMT(mode) not in (0, stat.S_IFREG, stat.S_IFDIR):
                    what = "a symbolic link" if stat.S_ISLNK(mode) else "not a plain file"
                    notes.append(f"'{name}' is {what} and was left out: hand in the file itself.")
                elif info.is_dir() or name.endswith("/"):
                    yield name.rstrip("/"), None
                else:
                    _check_packing(info)
                    with archive.open(info) as source:
                        yield name, cast(BinaryIO, _Measured(source, max(1, info.compress_size)))
    except _DAMAGES as error:
        raise _damaged(error) from error


def _damaged(error: Exception) -> Refused:
    return Refused(
        f"Your submission is not a zip archive that can be opened ({error or 'it is cut off'}).",
        fix="if it is something else, a program or another kind of archive, zip it; else zip your folder again, and "
        "look into the archive before you hand it in.",
    )


def _checked_name(info: zipfile.ZipInfo) -> str:
    """Returns the entry's name with / between its parts.

    Raises:
        Refused: it leads out of the archive.
    """
    name = info.filename.replace("\\", "/")
    parts = name.split("/")
    if name.startswith("/") or ":" in parts[0] or ".." in parts:
        raise Refused(
            f"Your archive names a file outside itself: {info.filename!r}.",
            fix="zip the folder with your files, by their names alone.",
        )
    return "/".join(part for part in parts[:-1] if part not in ("", ".")) + ("/" if len(parts) > 1 else "") + parts[-1]


def _check_packing(info: zipfile.ZipInfo) -> None:
    if info.flag_bits & _ENCRYPTED:
        raise Refused("Your archive has a password.", fix="zip it without one.")
    # The others unpack as much as they like at once, whatever one asks for.
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise Refused("Your archive is packed in an unusual way.", fix="zip it with the usual method (deflate).")


class _Measured:
    """A file in the archive, read as long as it does not unpack to absurdly more than it was."""

    def __init__(self, source: Any, packed_bytes: int) -> None:
        self._source = source
        self._packed_bytes = packed_bytes
        self._read_bytes = 0

    def read(self, size: int) -> bytes:
        """Returns the next bytes, none at the end."""
        try:
            data: bytes = self._source.read(size)
        except _DAMAGES as error:
            raise _damaged(error) from error
        self._read_bytes += len(data)
        if self._read_bytes > max(_RATIO_FROM_BYTES, MAX_RATIO * self._packed_bytes):
            raise Refused(
                "Your archive unpacks to hundreds of times its size.", fix="hand in only what the lab asks for."
            )
        return data


class _Bounded(io.RawIOBase):
    """The archive's bytes, never many at a time: so a list of a million contents is refused before it is read."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def read(self, size: int = -1) -> bytes:
        """Returns so many bytes.

        Raises:
            Refused: they are more than any honest archive makes one read at once.
        """
        wanted = size if size >= 0 else MAX_DIRECTORY_BYTES + 1  # the end of the archive is read without a size
        data = b"" if wanted > MAX_DIRECTORY_BYTES + 1 else self._file.read(wanted)
        if max(size, len(data)) > MAX_DIRECTORY_BYTES:
            raise Refused("Your archive has too many files in it.", fix="hand in only what the lab asks for.")
        return data

    def seek(self, offset: int, whence: int = 0) -> int:
        """Goes to a place.

        Raises:
            ValueError: it lies before the beginning, as in a damaged archive.
        """
        if whence == 0 and offset < 0:
            raise ValueError("a place before its beginning")
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """Returns the place."""
        return self._file.tell()

    def seekable(self) -> bool:
        """It is."""
        return True

    def readable(self) -> bool:
        """It is."""
        return True
