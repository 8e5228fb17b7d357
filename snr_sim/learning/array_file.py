"""Files of learned values: arrays of numbers with JSON metadata, so that reading executes no code from the file.

A file may be damaged or malicious. So everything is checked before memory is allocated for it: the type of the file,
its size, and the header of each array. Reading returns arrays as the owner requires them, or raises the one error.
"""

from __future__ import annotations

import io
import math
import stat
import struct
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, TypeVar

import msgspec
import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from snr_sim.prelude.errors import ParameterError, RecordingError
from snr_sim.prelude.task import ensure_type_info
from snr_sim.recording.atomic_files import write_atomic

FORMAT = 1
MAX_BYTES = 256 * 2**20  # of a file that is read, so that none fills the memory
MAX_TEXT_BYTES = 4 * 2**20  # bytes of its metadata
ABOUT = "about"
PACKINGS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)

# Raised by zipfile, zlib, numpy's header reader (which also warns) and msgspec for malformed bytes.
_DAMAGED = (
    *(OSError, EOFError, ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError, MemoryError),
    *(NotImplementedError, RuntimeError, SyntaxError, zipfile.BadZipFile, zlib.error, tokenize.TokenError),
    *(ParameterError, msgspec.MsgspecError, struct.error, Warning),
)


class FileMetadata(msgspec.Struct, frozen=True, kw_only=True):
    """Metadata that every such file has.

    Args:
        environment: what it was learned in, such as 'snr_sim/LanderVertical-v0'.
        made_by: method and numbers of the training.
        version: of this format.
    """

    environment: str
    made_by: str = ""
    version: int = FORMAT


AnyMetadata = TypeVar("AnyMetadata", bound=FileMetadata)
AnyOwner = TypeVar("AnyOwner")


def write_arrays(path: str | Path, about: FileMetadata, arrays: dict[str, NDArray[Any]]) -> None:
    """Write arrays of numbers as npz, with JSON metadata.

    Raises:
        RecordingError: the file cannot be written; an existing file is then unchanged.
    """
    text = np.frombuffer(msgspec.json.encode(about), np.uint8)
    packed = io.BytesIO()
    np.savez_compressed(packed, allow_pickle=False, about=text, **arrays)
    try:
        write_atomic(Path(path), packed.getvalue())
    except OSError as error:
        raise RecordingError(
            f"{path} cannot be written: {error.strerror or error}.", fix="name a file in a folder that is there."
        ) from error


def read_arrays(
    path: str | Path,
    kind: type[AnyMetadata],
    owner: Callable[[AnyMetadata], tuple[AnyOwner, dict[str, NDArray[Any]]]],
    what: str,
    maker: str,
    environment: str = "",
    max_bytes: int = MAX_BYTES,
) -> AnyOwner:
    """Return the owner made from a file's metadata, with the arrays of the file.

    Args:
        path: of the file.
        kind: type of the metadata.
        owner: makes from the metadata the object that the arrays are for, and returns those of its arrays that are
            read. It must not allocate more memory than a file may hold; it may raise ParameterError.
        what: description of such a file, for messages.
        maker: name of what writes such files, for messages.
        environment: required environment; any if empty.
        max_bytes: of the file, and of what it unpacks to.

    Raises:
        RecordingError: the file is missing, of another kind (a pickle is refused, not opened), truncated or damaged,
            too large, for something else, or an array differs in dtype or shape from the owner's.
    """
    place = Path(path)
    try:
        if not stat.S_ISREG(place.stat().st_mode):  # a FIFO would be waited for, and a device never ends
            raise RecordingError(f"{path} is not a regular file.", fix=f"a file that {maker} has written.")
        _check_size(path, place.stat().st_size, what, max_bytes)
        with zipfile.ZipFile(place) as archive:
            _check_size(path, sum(info.file_size for info in archive.infolist()), what, max_bytes)
            text = _array(archive, ABOUT, None).tobytes()
            found = msgspec.json.decode(text, type=ensure_type_info(FileMetadata))
            if environment and found.environment != environment:
                raise RecordingError(
                    f"{path} was learned in {found.environment}, not in {environment}.",
                    fix=f"train one for it: a {what}, which {maker} writes.",
                )
            if found.version != FORMAT:
                raise RecordingError(
                    f"{path} has version {found.version}; this kit reads {FORMAT}.", fix="train it again."
                )
            made, arrays = owner(msgspec.json.decode(text, type=ensure_type_info(kind)))
            for name, array in arrays.items():
                array[:] = _array(archive, name, array)
            return made
    except FileNotFoundError:
        raise RecordingError(f"There is no file {path}.", fix="save it first, or look for its path.") from None
    except _DAMAGED as error:
        raise RecordingError(
            f"{path} is not a {what}, or is damaged: {str(error) or type(error).__name__}.",
            fix=f"a file that {maker} has written.",
        ) from error


def check_memory(count: int) -> None:
    """Raise ParameterError if so many numbers are beyond the limit, before they are allocated."""
    if 8 * count > MAX_BYTES:
        raise ParameterError(f"{count} numbers are more than {MAX_BYTES} bytes hold.", fix="fewer cells.")


def _check_size(path: str | Path, size: int, what: str, max_bytes: int) -> None:
    if size > max_bytes:
        raise RecordingError(f"{path} holds {size} bytes.", fix=f"{what} of at most {max_bytes} bytes.")


def _array(archive: zipfile.ZipFile, name: str, like: NDArray[Any] | None) -> NDArray[Any]:
    """Return an array of a file, with the dtype and shape of `like`; without that the text, which is bytes.

    Its header is looked at before its numbers are read.

    Raises:
        ValueError: it is not so; many more where the file is damaged.
    """
    info = archive.getinfo(f"{name}.npy")
    if info.compress_type not in PACKINGS:
        raise ValueError(f"'{name}' is packed in another way")
    with archive.open(info) as member:
        shape, is_by_columns, dtype = _header(member)
        expected_dtype = np.dtype(np.uint8) if like is None else like.dtype
        if dtype != expected_dtype or (len(shape) != 1 if like is None else shape != like.shape):
            expected = (
                "a text is bytes"
                if like is None
                else f"its edges and actions make {expected_dtype} of shape {like.shape}"
            )
            raise ValueError(f"'{name}' is {dtype} of shape {shape}, {expected}")
        size = math.prod(shape) * expected_dtype.itemsize
        if not 0 <= size <= (MAX_TEXT_BYTES if like is None else MAX_BYTES):
            raise ValueError(f"'{name}' asks for {size} bytes")
        data = member.read(size + 1)  # with the byte after it, so that the check sum is looked at
    if len(data) != size:
        raise ValueError(f"'{name}' has {len(data)} bytes, not {size}")
    array: NDArray[Any] = np.frombuffer(data, expected_dtype).reshape(shape, order="F" if is_by_columns else "C").copy()
    if not np.isfinite(array).all():
        raise ValueError(f"'{name}' has values that are not finite")
    return array


def _header(member: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return shape, whether the order is Fortran's, and the dtype. numpy warns when it repairs a header."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        version = npy.read_magic(member)
        if version == (1, 0):
            return npy.read_array_header_1_0(member)
        if version == (2, 0):
            return npy.read_array_header_2_0(member)
    raise ValueError(f"its arrays have the format {version}")
