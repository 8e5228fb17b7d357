"""The pages of a node as text: what is in each, when it was stored, and by which component and task.

Texts are larger and slower to create than numbers, so there is one text of all the node's pages per second.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from snr_sim.recording.columns import MAX_LIST_PLOTTED, Batch, Ints, When, page_data
from snr_sim.recording.records import PageRecord
from snr_sim.view.view_blueprint import name_and_unit

CONTENTS_PERIOD_S = 1.0
MAX_FIELDS_SHOWN = 40  # of a page
MAX_VALUE_CHARS = 200
MAX_LEVELS = 4  # of nested values
MAX_CONTENTS_CHARS = 20_000


class PageContents:
    """Converter of pages, in batches, to texts; it keeps the newest text of each page."""

    def __init__(self) -> None:
        self._texts: dict[str, dict[str, str]] = {}

    def of(self, batch: Batch) -> Iterator[tuple[str, When, list[str]]]:
        """Yield for each node all its pages as text, at the last page of every `CONTENTS_PERIOD_S`."""
        for node, pages in batch.pages().items():
            seqs = {key: np.array([record.seq for record in records]) for key, records in pages.items()}
            when = _last_of_periods(When.of([record for records in pages.values() for record in records]))
            newest = {key: np.searchsorted(seqs[key], when.seq, side="right") - 1 for key in pages}
            new_texts = {key: _texts(batch, records, newest[key]) for key, records in pages.items()}
            texts = self._texts.setdefault(node, {})
            contents = []
            for row in range(len(when)):
                texts |= {key: new_texts[key][at[row]] for key, at in newest.items() if at[row] >= 0}
                contents.append("\n\n".join(texts.values())[:MAX_CONTENTS_CHARS])
            yield node, when, contents


def _last_of_periods(when: When) -> When:
    """Return the last row of each period; 0 s is a period of its own, so that the first text appears at once."""
    rows = when[np.argsort(when.seq)]
    periods = np.ceil(rows.t_s / CONTENTS_PERIOD_S)
    return rows[np.append(periods[1:] != periods[:-1], True)]


def _texts(batch: Batch, records: list[PageRecord], places: Ints) -> dict[int, str]:
    """Return the texts of the records at some indices."""
    rows = [int(place) for place in np.unique(places) if place >= 0]
    some = [records[place] for place in rows]
    data = page_data([record.values for record in some])
    return {place: _text(batch, *one) for place, *one in zip(rows, some, data, strict=True)}


def _text(batch: Batch, record: PageRecord, data: Any) -> str:
    """Return for example 'depth  at 1.950 s, task 731, stored by sonar (726)', and a line for each field."""
    head = (
        f"{record.name}  at {record.t:.3f} s, task {record.seq}, stored by {batch.stored_by(record)} ({record.cause})"
    )
    fields: list[str] = []
    _add_fields("", data, fields)
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
