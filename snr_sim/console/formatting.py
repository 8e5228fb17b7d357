"""Any value as a bounded, readable copy, as sent to a console.

No code of the value's class is called: a student's `__repr__` may raise, or never return.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from snr_sim.console.parsing import MAX_DEPTH, MAX_NAME_CHARS
from snr_sim.prelude.text import escaped

MAX_TEXT_CHARS = 64 * 1024  # per answer
MAX_ITEMS = 1000  # per value, all levels together
_SHORT_ITEMS = 12
_MAX_STRING_CHARS = 2000
_MAX_ALL_STRINGS_CHARS = 20_000  # per value, all strings together
_MAX_INT_BITS = 256


def truncate_value(value: Any, items: int = MAX_ITEMS) -> Any:
    """Return the value as plain numbers, text, lists and dicts, truncated to at most `items` items, with a remark.

    >>> truncate_value(list(range(1000)), items=3)
    [0, 1, 2, '... 997 more']
    """
    return _Truncator(items).cut(value, 0)


class _Truncator:
    def __init__(self, items: int) -> None:
        self._left = items
        self._chars_left = _MAX_ALL_STRINGS_CHARS

    def cut(self, value: Any, depth: int) -> Any:
        kind = type(value)
        if value is None or kind is bool or kind is float:
            return value
        if isinstance(value, str):
            return self._cut_text(str.__str__(value))
        if isinstance(value, int):
            return _cut_int(int.__int__(value))
        if isinstance(value, float):
            return float.__float__(value)
        if isinstance(value, (bytes, bytearray)):
            return self._cut_text(f"{len(value)} bytes {bytes(value[:_MAX_STRING_CHARS]).hex()}")
        if kind is complex:
            return repr(value)
        if depth >= MAX_DEPTH:
            return "... nested deeper"
        try:
            return self._cut_container(value, depth)
        except RuntimeError:  # the node changed it during the iteration
            return "... it changed while it was read"

    def _cut_container(self, value: Any, depth: int) -> Any:
        if isinstance(value, dict):
            return self._cut_fields(dict.items(value), dict.__len__(value), depth)
        if isinstance(value, (list, tuple, set, frozenset)):
            kind: Any = next(parent for parent in (list, tuple, set, frozenset) if isinstance(value, parent))
            return self._cut_items(kind.__iter__(value), kind.__len__(value), depth)
        numpy = sys.modules.get("numpy")
        if numpy is not None and isinstance(value, numpy.generic):
            return self.cut(value.item(), depth + 1)
        if numpy is not None and isinstance(value, numpy.ndarray):
            return self._cut_array(value, depth)
        return self._cut_object(value, depth)

    def _cut_text(self, text: str) -> str:
        limit = min(_MAX_STRING_CHARS, self._chars_left)
        self._chars_left -= min(len(text), limit)
        clean = text[:limit].encode(errors="backslashreplace").decode()  # half a surrogate pair is not valid UTF-8
        return clean if len(text) <= limit else f"{clean}... {len(text)} characters"

    def _cut_fields(self, fields: Iterable[tuple[Any, Any]], count: int, depth: int) -> dict[str, Any]:
        cut: dict[str, Any] = {}
        for seen, (key, item) in enumerate(fields):
            if self._left <= 0:
                cut["..."] = f"{count - seen} more"
                break
            self._left -= 1
            field = self.cut(key, depth + 1)
            cut[field if isinstance(field, str) else format_value(field)] = self.cut(item, depth + 1)
        return cut

    def _cut_items(self, items: Iterable[Any], count: int, depth: int) -> list[Any]:
        cut: list[Any] = []
        for seen, item in enumerate(items):
            if self._left <= 0:
                cut.append(f"... {count - seen} more")
                break
            self._left -= 1
            cut.append(self.cut(item, depth + 1))
        return cut

    def _cut_array(self, array: Any, depth: int) -> dict[str, Any]:
        is_whole = array.size <= self._left
        values = array.tolist() if is_whole else array.flat[: max(self._left, 0)].tolist()
        shape = " x ".join(map(str, array.shape))
        data = self.cut(values, depth + 1)
        if not is_whole:
            data.append(f"... {array.size - len(values)} more")
        return {"array": f"{array.dtype} {shape}".rstrip(), "data": data}

    def _cut_object(self, value: Any, depth: int) -> Any:
        kind = type(value)
        names = getattr(kind, "__struct_fields__", None)
        if names is not None:
            fields = {name: getattr(value, name) for name in names}
        else:
            try:
                fields = dict(object.__getattribute__(value, "__dict__"))
            except (AttributeError, TypeError):
                fields = {}
        return {"object": kind.__qualname__, **self._cut_fields(fields.items(), len(fields), depth)}


def _cut_int(number: int) -> int | str:
    """Limit an integer to the 64 bits of JSON; writing a number of a million digits takes minutes."""
    if -(2**63) <= number < 2**64:
        return number
    return str(number) if number.bit_length() <= _MAX_INT_BITS else f"a whole number of {number.bit_length()} bits"


def format_value(value: Any) -> str:
    """Return a bounded value as text on one line.

    >>> format_value({"depth_m": 1.5, "ok": True, "rates": [0.1, float("nan")], "who": "me"})
    '{depth_m: 1.5, ok: true, rates: [0.1, nan], who: "me"}'
    """
    if isinstance(value, dict):
        return "{" + ", ".join(f"{escaped(str(key))}: {format_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(format_value, value)) + "]"
    if isinstance(value, str):
        return f'"{escaped(value)}"'
    if isinstance(value, bool) or value is None:
        return {True: "true", False: "false", None: "null"}[value]
    return repr(value)


def name(text: str) -> str:
    """Return a name, truncated if it is very long."""
    return text if len(text) <= MAX_NAME_CHARS else f"{text[:MAX_NAME_CHARS]}..."


def format_short(value: Any, limit: int = 100) -> str:
    """Return a value on one short line: an extract, not all of it."""
    line = format_value(truncate_value(value, _SHORT_ITEMS))
    return line if len(line) <= limit else f"{line[: limit - 3]}..."


def table(rows: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> str:
    """Return rows as text in columns; numbers are right-aligned."""
    lines = [[_cell(row.get(column)) for column in columns] for row in rows]
    widths = [max(map(len, column)) for column in zip(columns, *lines, strict=True)]
    sides: list[Callable[..., str]] = [
        str.rjust if any(isinstance(row.get(column), (int, float)) for row in rows) else str.ljust for column in columns
    ]
    return "\n".join(
        "  ".join(side(cell, width) for side, cell, width in zip(sides, line, widths, strict=True)).rstrip()
        for line in [list(columns), *lines]
    )


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.4g}" if math.isfinite(value) else str(value)
    return escaped(str(value))


def truncate(text: str) -> str:
    """Return an answer's text, truncated with a remark if it is too long."""
    if len(text) <= MAX_TEXT_CHARS:
        return text
    return f"{text[:MAX_TEXT_CHARS]}\n... cut: {len(text)} characters"
