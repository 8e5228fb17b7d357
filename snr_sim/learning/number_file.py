"""Files of what was learned: arrays of numbers and a line of JSON about them, so that nobody's code runs at reading."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from snr_sim.prelude.errors import RecordingError
from snr_sim.prelude.structs import learned

MOST_BYTES = 256 * 2**20  # of a file that is read: nobody's fills the memory

AnyAbout = TypeVar("AnyAbout", bound=msgspec.Struct)


def write_numbers(path: str | Path, about: msgspec.Struct, arrays: dict[str, NDArray[Any]]) -> None:
    """Writes arrays of numbers as npz, and a line of JSON about them.

    Raises:
        RecordingError: it cannot be written there.
    """
    text = np.frombuffer(msgspec.json.encode(about), np.uint8)
    try:
        with Path(path).open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, about=text, **arrays)
    except OSError as error:
        raise RecordingError(f"{path} cannot be written: {error.strerror or error}.") from error


def read_numbers(
    path: str | Path, kind: type[AnyAbout], names: tuple[str, ...], what: str, maker: str
) -> tuple[AnyAbout, dict[str, NDArray[Any]]]:
    """Returns what a file says about its arrays, and the arrays.

    Args:
        path: of the file.
        kind: of what it says.
        names: of the arrays.
        what: it should be, in words, for messages.
        maker: what has written such a file.

    Raises:
        RecordingError: there is no such file, it is none of these (a pickle is refused, not opened), or it is cut.
    """
    place = Path(path)
    try:
        size = place.stat().st_size
        with zipfile.ZipFile(place) as archive:
            unpacked = sum(info.file_size for info in archive.infolist())
        if max(size, unpacked) > MOST_BYTES:
            raise RecordingError(f"{path} holds {unpacked} bytes.", fix=f"{what} of at most {MOST_BYTES} bytes.")
        with np.load(place, allow_pickle=False) as arrays:
            about = msgspec.json.decode(arrays["about"].tobytes(), type=learned(kind))
            return about, {name: arrays[name] for name in names}
    except FileNotFoundError:
        raise RecordingError(f"There is no file {path}.", fix="save it first, or look for its path.") from None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, msgspec.MsgspecError) as error:
        raise RecordingError(f"{path} is no {what}: {error}.", fix=f"a file that {maker} has written.") from error


def check_array(path: str | Path, name: str, array: NDArray[Any], like: NDArray[Any], maker: str) -> None:
    """Looks whether an array that was read is what it should be.

    Raises:
        RecordingError: it has another shape or another kind of numbers than `like`, or some are not finite.
    """
    kind = np.floating if np.issubdtype(like.dtype, np.floating) else np.integer
    if array.shape != like.shape or not np.issubdtype(array.dtype, kind):
        raise RecordingError(
            f"{path}: '{name}' is {array.dtype} of shape {array.shape}, its edges and actions make {like.shape}.",
            fix=f"a file that {maker} has written.",
        )
    if not np.isfinite(array).all():
        raise RecordingError(f"{path} has values that are not finite.", fix="train it again, more slowly.")
