"""The messages of the live page: the examples are messages, and what is out of bounds is not."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from snr_sim.web.messages import FromPage, FromServer, Graph, decode_from_page

Validator = Callable[..., Callable[[Any], bool]]
SHA = "0" * 64
FORMATS = Path(__file__).parents[2] / "docs" / "formats.md"


def blocks() -> list[dict[str, Any]]:
    """The examples in section 9 of the page: what begins with a brace, up to the next empty line or example."""
    found: list[str] = []
    for line in FORMATS.read_text(encoding="utf-8").partition("## 9.")[2].splitlines():
        text = line.removeprefix("    ")
        if text.startswith("{"):
            found.append(text)
        elif line.startswith("     ") and found and not text.strip().startswith("|"):
            found[-1] += text
    whole = [one.replace("[...]", "[]").replace('"9f..."', f'"{SHA}"') for one in found]
    return [json.loads(one) for one in whole]


EXAMPLES = blocks()


def test_page_of_formats_has_an_example_of_each_message() -> None:
    kinds = {one.__struct_config__.tag for union in (FromServer, FromPage) for one in union.__args__}
    assert {one["kind"] for one in EXAMPLES if "kind" in one} == kinds


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda one: str(one.get("kind", "graph")))
def test_example_is_a_message_and_valid_by_schema(example: dict[str, Any], validator: Validator) -> None:
    data = json.dumps(example).encode()
    if "kind" not in example:
        assert msgspec.json.decode(data, type=Graph).name == "dora"
        return
    decoded = []
    for union in (FromServer, FromPage):
        try:
            decoded.append(msgspec.json.decode(data, type=union))
        except msgspec.ValidationError:
            continue
    assert len(decoded) == 1
    assert json.loads(msgspec.json.encode(decoded[0])) == example
    assert validator("live")(example)


@pytest.mark.parametrize(
    "message",
    [
        {"kind": "edit", "number": -1, "text": "", "base_sha256": SHA},
        {"kind": "edit", "number": 1, "text": "a" * 200_001, "base_sha256": SHA},
        {"kind": "edit", "number": 1, "text": "", "base_sha256": "A" * 64},
        {"kind": "edit", "number": 1, "text": "", "base_sha256": SHA, "more": 1},
        {"kind": "edit", "number": 1, "text": ""},
        {"kind": "set", "path": "a" * 501, "value": 1},
        {"kind": "set", "path": "a", "value": {}},
        {"kind": "set", "path": "a", "value": 2**60},
        {"kind": "set", "path": "a", "value": "b" * 10_001},
        {"kind": "do", "what": "terminate"},
        {"kind": "give", "signal": 5},
        {"kind": "show", "t_s": -1.0},
        {"kind": "show", "t_s": 1e10},
        {"kind": "why", "machine": "", "transition": "", "from_s": 0.0},
        {"kind": "hello"},
        {"kind": "gone", "reason": "mine"},
        {},
        [],
        "edit",
        None,
    ],
)
def test_message_out_of_bounds_is_rejected(message: Any, validator: Validator) -> None:
    with pytest.raises(msgspec.ValidationError):
        decode_from_page(json.dumps(message))
    # The server's own message; and an integer is a number, too, for a schema.
    if message not in ({"kind": "gone", "reason": "mine"}, {"kind": "set", "path": "a", "value": 2**60}):
        assert not validator("live")(message)


@pytest.mark.parametrize("data", [b"", b"{", b"\xff\xfe", b"[" * 5000, b'{"kind": "show", "t_s": 1e999}'])
def test_garbage_is_rejected(data: bytes) -> None:
    with pytest.raises((msgspec.DecodeError, UnicodeDecodeError, RecursionError)):
        decode_from_page(data)
