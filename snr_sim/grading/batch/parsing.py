"""Parsers of a student's structured texts, such as findings.toml: run in the student's process, never in the grader's.

A parser can take any time and memory: 80 kB of dotted keys occupy tomllib for half a minute, and 1 MB of braces in an
f-string occupy Python's own parser for one. In a process with limits that fails the case, and no other submission.
"""

from __future__ import annotations

import json
import tomllib
from typing import Any

from snr_sim.prelude.errors import SnrError

MAX_PARSED_BYTES = 16 * 2**10  # some pages of text


def toml_in(data: bytes) -> dict[str, Any]:
    """Return the content of a text in TOML.

    Raises:
        SnrError: it is not valid TOML.
    """
    try:
        found: dict[str, Any] = json.loads(json.dumps(tomllib.loads(data.decode()), default=str))  # dates as text
    except (ValueError, RecursionError) as error:
        raise SnrError(f"{error}.") from None
    return found
