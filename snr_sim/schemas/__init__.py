"""JSON Schemas (draft 2020-12) of what leaves this kit as text: traces, pages, links, consoles, results, marks.

They ship beside this file, for programs in any language; docs/formats.md says what schemas cannot. The code does not
need them: it refuses by itself what they refuse, and tests hold the two against each other.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent
SUFFIX = ".schema.json"
NAMES = ("console", "graded", "page", "result", "trace", "value", "wire")


def read_schema(name: str) -> dict[str, Any]:
    """Return a schema by its name, such as "trace". They refer to each other by their files' names.

    >>> read_schema("page")["title"]
    'Page'
    """
    schema: dict[str, Any] = json.loads((FOLDER / f"{name}{SUFFIX}").read_text(encoding="utf-8"))
    return schema
