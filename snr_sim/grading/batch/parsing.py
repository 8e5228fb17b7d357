"""Texts of a student's with a form, such as findings.toml: read in the student's process, never in the grader's.

A parser can take any time and memory: 80 kB of dotted keys hold tomllib for half a minute, and 1 MB of braces in an
f-string hold Python's own parser for one. In a process with limits that costs the case, and no other submission.
"""

from __future__ import annotations

import json
import tomllib
from typing import Any

from snr_sim.prelude.errors import SnrError

MAX_PARSED_BYTES = 16 * 2**10  # some pages of text


def toml_in(data: bytes) -> dict[str, Any]:
    """Return what a text in TOML holds.

    Raises:
        SnrError: it is no TOML.
    """
    try:
        found: dict[str, Any] = json.loads(json.dumps(tomllib.loads(data.decode()), default=str))  # dates as text
    except (ValueError, RecursionError) as error:
        raise SnrError(f"{error}.") from None
    return found
