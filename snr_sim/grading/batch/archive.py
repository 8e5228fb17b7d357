"""Reader of an untrusted zip archive: yields its plain files one by one, with bounded memory.

Nothing in the archive is trusted: neither the sizes it claims, nor the names, nor how much an entry unpacks to.
"""

from __future__ import annotations

import io
import os
import stat
import zipfile
import zlib
from collections.abc import Iterator
from typing import Any, BinaryIO, TypeAlias, cast

from snr_sim.grading.batch.member_names import SubmissionRejectedError, is_ignored, parts_of, shown

MAX_ARCHIVE_BYTES = 32 * 2**20
MAX_DIRECTORY_BYTES = 2**19  # of the archive's list of contents, some 50 to 300 bytes a file
MAX_RATIO = 200  # unpacked to packed; text is about 5, and the densest that deflate can write is 1032
_RATIO_FROM_BYTES = 2**20  # small files of zeros cannot be a zip bomb
_ENCRYPTED = 1
Member: TypeAlias = tuple[tuple[str, ...], BinaryIO | None]
_DAMAGES = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, ValueError, OverflowError)


def members_of(file: BinaryIO, notes: list[str]) -> Iterator[Member]:
    """Yield each plain file by the parts of its path, open for reading; of a folder None in the file's place.

    Each entry left out adds a note.

    Raises:
        SubmissionRejectedError: it is not an archive, is damaged or malicious, or cannot be opened.
    """
    if os.fstat(file.fileno()).st_size > MAX_ARCHIVE_BYTES:
        raise SubmissionRejectedError(
            f"Your archive is larger than {MAX_ARCHIVE_BYTES // 2**20} MB.",
            fix="zip only what the lab asks for, without recorded runs.",
        )
    try:
        with _Bounded(io.FileIO(file.fileno(), closefd=False)) as bounded, zipfile.ZipFile(bounded) as archive:
            for info in archive.infolist():
                parts = parts_of(info.filename)
                if any(is_ignored(part) for part in parts):
                    continue
                mode = info.external_attr >> 16
                if stat.S_IFMT(mode) not in (0, stat.S_IFREG, stat.S_IFDIR):
                    what = "a symbolic link" if stat.S_ISLNK(mode) else "not a plain file"
                    notes.append(f"'{shown(info.filename)}' is {what} and was left out: hand in the file itself.")
                elif info.filename.endswith(("/", "\\")):
                    yield parts, None
                else:
                    _check_packing(info)
                    with archive.open(info) as source:
                        yield parts, cast("BinaryIO", _Measured(source, max(1, info.compress_size)))
    except _DAMAGES as error:
        raise _damaged(error) from error


def _damaged(error: Exception) -> SubmissionRejectedError:
    return SubmissionRejectedError(
        f"Your submission is not a zip archive that can be opened ({error or 'it is cut off'}).",
        fix="if it is something else, a program or another kind of archive, zip it; else zip your folder again, and "
        "look into the archive before you hand it in.",
    )


def _check_packing(info: zipfile.ZipInfo) -> None:
    if info.flag_bits & _ENCRYPTED:
        raise SubmissionRejectedError("Your archive has a password.", fix="zip it without one.")
    # The others unpack as much as they like at once, whatever one asks for.
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise SubmissionRejectedError(
            "Your archive is packed in an unusual way.", fix="zip it with the usual method (deflate)."
        )


class _Measured:
    """A file in the archive, read as long as it does not unpack to absurdly more than it was."""

    def __init__(self, source: Any, packed_bytes: int) -> None:
        self._source = source
        self._packed_bytes = packed_bytes
        self._read_bytes = 0

    def read(self, size: int) -> bytes:
        """Return the next bytes, none at the end."""
        try:
            data: bytes = self._source.read(size)
        except _DAMAGES as error:
            raise _damaged(error) from error
        self._read_bytes += len(data)
        if self._read_bytes > max(_RATIO_FROM_BYTES, MAX_RATIO * self._packed_bytes):
            raise SubmissionRejectedError(
                "Your archive unpacks to hundreds of times its size.", fix="hand in only what the lab asks for."
            )
        return data


class _Bounded(io.BufferedReader):
    """The archive's bytes, never many at a time: so a list of a million contents is refused before it is read."""

    def read(self, size: int | None = -1, /) -> bytes:
        """Return so many bytes; raise SubmissionRejectedError if no honest archive makes one read as many."""
        requested = -1 if size is None else size  # the end of the archive is read without a size
        data = super().read(requested if 0 <= requested <= MAX_DIRECTORY_BYTES else MAX_DIRECTORY_BYTES + 1)
        if max(requested, len(data)) > MAX_DIRECTORY_BYTES:
            raise SubmissionRejectedError(
                "Your archive has too many files in it.", fix="hand in only what the lab asks for."
            )
        return data

    def seek(self, target: int, whence: int = 0, /) -> int:  # plain: archaic
        """Go to a position; raise ValueError if it lies before the beginning, as in a damaged archive."""
        if whence == 0 and target < 0:
            raise ValueError("the position is before the start of the archive")
        return super().seek(target, whence)
