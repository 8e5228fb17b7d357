"""JSON Schemas (draft 2020-12) of the text formats of snr_sim.

There is one for traces, pages, links, consoles, the live page of a machine, results, grades, and health of processes.
They ship in this folder, for programs in any language; docs/formats.md has the rules that schemas cannot express. The
code does not use them: it does its own validation, and tests compare the two.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent
SUFFIX = ".schema.json"
NAMES = ("console", "graded", "health", "live", "page", "result", "trace", "value", "wire")


def read_schema(name: str) -> dict[str, Any]:
    """Return a schema by its name, such as "trace". They refer to each other by their files' names.

    >>> read_schema("page")["title"]
    'Page'
    """
    schema: dict[str, Any] = json.loads((FOLDER / f"{name}{SUFFIX}").read_text(encoding="utf-8"))
    return schema
