"""Generate the schemas of traces, links, consoles, live pages and health from the classes that read and write them.

The others are written by hand. Run `python -m snr_sim.schemas --write` after a change of such a class; a test compares
the files.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from snr_sim.console.wire import CommandMessage, CompleteMessage, CompletionsMessage, Reply
from snr_sim.links.messages import VERSION, Control
from snr_sim.recording.records import SCHEMA, Header, Line, TraceInfo
from snr_sim.schemas import SUFFIX
from snr_sim.supervision.health import Health
from snr_sim.web.messages import FromPage, FromServer

DRAFT = "https://json-schema.org/draft/2020-12/schema"
PAGE = {"$ref": f"page{SUFFIX}"}


def generated() -> dict[str, str]:
    """Return the text of each generated schema by its name."""
    health = _definitions([Health])[1]
    return {
        "console": _text(
            f"A message between a node and a console, protocol version {VERSION}",
            "The content of one frame, after its four bytes of length.",
            _schema_of(Control | CommandMessage | CompleteMessage | Reply | CompletionsMessage),
        ),
        "health": _text(
            "health.json",
            "What each supervised process does.",
            {"anyOf": [{"$ref": "#/$defs/Health"}], "$defs": health},
        ),
        "live": _text(
            "A message between the live page of a state machine and its server",
            "The content of one text frame of the WebSocket.",
            _schema_of(FromServer, FromPage),
        ),
        "trace": _text(
            f"A line of trace.jsonl, format {SCHEMA}",
            "The first line is of kind trace, the second of kind header; all others are records.",
            _schema_of(TraceInfo | Header | Line),
        ),
        "wire": _text(
            f"A message between two nodes, protocol version {VERSION}",
            "The content of one frame, after its four bytes of length.",
            _schema_of(Control),
            PAGE,
        ),
    }


def write(folder: Path) -> None:
    """Write the generated schemas."""
    for name, text in generated().items():
        (folder / f"{name}{SUFFIX}").write_text(text, encoding="utf-8")


def _schema_of(*unions: Any) -> dict[str, Any]:
    """Return the schema of messages of several unions; each of them may have the same tags."""
    schemas, definitions = _definitions(unions)
    return {"anyOf": [one for schema in schemas for one in schema["anyOf"]], "$defs": definitions}


def _definitions(types: Sequence[Any]) -> tuple[Sequence[dict[str, Any]], dict[str, Any]]:
    schemas, definitions = msgspec.json.schema_components(types, ref_template="#/$defs/{name}")
    for definition in definitions.values():
        definition["description"] = inspect.cleandoc(definition["description"])
    return schemas, definitions


def _text(title: str, description: str, schema: dict[str, Any], *others: dict[str, Any]) -> str:
    whole = {
        "$schema": DRAFT,
        "title": title,
        "description": description,
        "anyOf": [*schema["anyOf"], *others],
        "$defs": schema["$defs"],
    }
    return json.dumps(whole, indent=2, ensure_ascii=False) + "\n"
