"""The pages of a node as text: what is in each, when it was stored, and by which component and task.

Texts are larger and slower to create than numbers, so there is one text of all the node's pages per second.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import lru_cache
from itertools import zip_longest
from typing import Any

import numpy as np

from snr_sim.recording.columns import MAX_LIST_PLOTTED, Batch, When, page_data
from snr_sim.recording.records import PageRecord
from snr_sim.view.view_blueprint import name_and_unit

CONTENTS_PERIOD_S = 1.0
MAX_FIELDS_SHOWN = 40  # of a page
MAX_VALUE_CHARS = 200
MAX_LEVELS = 4  # of nested values
MAX_CONTENTS_CHARS = 20_000


class PageContents:
    """Converter of pages, in batches, to texts; it keeps the newest text of each page.

    `lines` are file and line of handlers by name, where they are known.
    """

    def __init__(self, lines: Mapping[str, str] | None = None) -> None:
        self._lines = lines or {}
        self._texts: dict[str, dict[str, str]] = {}

    def of(self, batch: Batch) -> Iterator[tuple[str, When, list[str]]]:
        """Yield for each node all its pages as text, at the last page of every `CONTENTS_PERIOD_S`."""
        for node, pages in batch.pages():
            texts = self._texts.setdefault(node, {})
            newest: dict[str, PageRecord] = {}
            last_ones, contents = [], []
            for page, following in zip_longest(pages, pages[1:]):
                newest[page.name] = page
                if following is None or _period(page) != _period(following):
                    texts |= {key: _text(batch, one, self._lines) for key, one in newest.items()}
                    newest.clear()
                    last_ones.append(page)
                    contents.append("\n\n".join(texts.values())[:MAX_CONTENTS_CHARS])
            yield node, When.of(last_ones), contents


def _period(page: PageRecord) -> int:
    """Return the number of a page's period; 0 s is a period of its own, so that the first text appears at once."""
    return math.ceil(page.t / CONTENTS_PERIOD_S)


def _text(batch: Batch, record: PageRecord, lines: Mapping[str, str]) -> str:
    """Return for example 'depth  at 1.950 s, task 731, stored by sonar (726)', and a line for each field.

    The handler that stored it is followed by its line, if that is known: 'gentle.on_radar, gentle.py line 14, in ...'.
    """
    source = batch.stored_by(record)
    handler, _, task = source.partition(" in ")
    line = lines.get(handler.rpartition(".")[2])
    if line is not None:
        source = f"{handler}, {line}{f', in {task}' if task else ''}"
    head = f"{record.name}  at {record.t:.3f} s, task {record.seq}, stored by {source} ({record.cause})"
    fields: list[str] = []
    _add_fields("", page_data([record.values])[0], fields)
    if len(fields) > MAX_FIELDS_SHOWN:
        fields[MAX_FIELDS_SHOWN:] = [f"    ... and {len(fields) - MAX_FIELDS_SHOWN} more"]
    return "\n".join([head, *fields])


def _add_fields(name: str, value: Any, fields: list[str], level: int = 0) -> None:
    if isinstance(value, dict) and value and level < MAX_LEVELS:
        for key, inner in value.items():
            _add_fields(f"{name}.{key}" if name else str(key), inner, fields, level + 1)
        return
    unit = "" if value is None else _unit(name)
    fields.append(f"    {name:<20} {_format_value(value)[:MAX_VALUE_CHARS]} {unit}".rstrip())


@lru_cache(4096)
def _unit(name: str) -> str:
    return name_and_unit((name,))[1]


def _format_value(value: Any, level: int = 0) -> str:
    """Return a value as one line of text: numbers with six digits, long or deep values only as their size."""
    if type(value) is float:
        return f"{value:.6g}"
    if isinstance(value, np.ndarray):
        return f"array of {' x '.join(map(str, value.shape))}, {value.dtype}"
    if isinstance(value, (list, tuple, dict)):
        if len(value) > MAX_LIST_PLOTTED or level == MAX_LEVELS:
            return f"{{{len(value)} fields}}" if isinstance(value, dict) else f"[{len(value)} values]"
        if isinstance(value, dict):
            return f"{{{', '.join(f'{key}: {_format_value(inner, level + 1)}' for key, inner in value.items())}}}"
        return f"[{', '.join(_format_value(inner, level + 1) for inner in value)}]"
    return repr(value)
