"""Files of vehicles: TOML whose mistakes are reported with their line."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from snr_sim.prelude.errors import ParameterError


def read_tables(path: Path, who: str, example: str) -> dict[str, Any]:
    """Return the tables of a file.

    Args:
        path: of it.
        who: what it describes, for messages: "The vehicle".
        example: name of a file to compare it with.

    Raises:
        ParameterError: it cannot be read, is not UTF-8 or not TOML.
    """
    try:
        return tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise ParameterError(
            f"{who} in {path} cannot be read: line {line} has the byte 0x{error.object[error.start]:02x}, which "
            "is not UTF-8.",
            fix="save the file as UTF-8.",
        ) from error
    except (OSError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise ParameterError(f"{who} in {path} cannot be read: {error}", fix=f"compare it with {example}.") from error
