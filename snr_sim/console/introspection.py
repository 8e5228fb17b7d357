"""Structure and state of a node, read while it runs. Nothing here accesses devices or the system.

All this is read from a thread other than the node's: dicts are copied in one step, and values that change meanwhile
may be shown as they were just before.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import islice
from typing import Any

from snr_sim.console.formatting import MAX_ITEMS, format_short, format_value, name, table, truncate_value
from snr_sim.core.datastore import LINK_PREFIX, page_age_s
from snr_sim.core.loop import Loop
from snr_sim.core.node import Node
from snr_sim.core.profiler import Profiler
from snr_sim.prelude.task import Page

MAX_ROWS = 500

Rows = list[dict[str, Any]]
View = tuple[str, Any]  # text for a user, plain data for a program


def components(node: Node) -> View:
    """Return the name, kind, class, handlers, rate and tick of each component."""
    rows: Rows = []
    for key, component in node.components.copy().items():
        row: dict[str, Any] = {"component": name(key), "class": type(component).__name__}
        if isinstance(component, Loop):
            row |= {"kind": "loop", "rate_hz": component.max_tick_rate_hz, **_loop_state(component)}
        else:
            row |= {"kind": "endpoint", "handlers": len(component.task_handlers)}
        rows.append(row)
    return _rows(rows, ("component", "kind", "class", "handlers", "rate_hz", "ticks"), "components")


def loops(node: Node) -> View:
    """Return the rate, ticks and largest lag of each loop; for one in a process also the pages not sent to it."""
    rows: Rows = [
        {
            "loop": name(key),
            "rate_hz": loop.max_tick_rate_hz,
            **_loop_state(loop),
            "runs": "no" if loop.is_terminated() else "yes",
        }
        for key, loop in node.components.copy().items()
        if isinstance(loop, Loop)
    ]
    return _rows(rows, ("loop", "rate_hz", "ticks", "late_s", "skipped", "runs"), "loops")


def _loop_state(loop: Loop) -> dict[str, Any]:
    executor = loop.caller
    if executor is None:
        return {}
    skipped = {"skipped": executor.skipped} if hasattr(executor, "skipped") else {}
    return {"ticks": executor.ticks, "late_s": executor.late_s, **skipped}


def pages(node: Node) -> View:
    """Return the key, age, origin and shortened data of each page."""
    rows: Rows = [
        {
            "page": name(key),
            "age_s": _age_s(node, page),
            "origin": name(str(page.origin)),
            "holds": format_short(page.data),
        }
        for key, page in islice(node.datastore.pages.copy().items(), MAX_ROWS)
        if type(page) is Page
    ]
    return _rows(rows, ("page", "age_s", "origin", "holds"), "pages", len(node.datastore.pages))


def links(node: Node) -> View:
    """Return the state of each link, from the page that it stores."""
    fields = ("up", "age_s", "dropped", "rtt_s")
    rows: Rows = []
    for key, page in node.datastore.pages.copy().items():
        if key.startswith(LINK_PREFIX):
            state = page.data if isinstance(page.data, dict) else {}
            rows.append(
                {"link": name(key.removeprefix(LINK_PREFIX)), **{f: truncate_value(state.get(f), 4) for f in fields}}
            )
    return _rows(rows, ("link", *fields), "links")


def profile(node: Node) -> View:
    """Return the execution times of each handler and loop."""
    if node.profiler is None:
        return "This node has no profiler: its config has one with Mode.DEBUG (`-d` on the command line).", []
    still = Profiler()
    still.timings = node.profiler.timings.copy()
    return still.dump(), still.rows()


def page(node: Node, page: Page) -> View:
    """Return all of a page, with long data truncated."""
    data = truncate_value(page.data, MAX_ITEMS)
    fields = {
        "key": page.key,
        "data": data,
        "origin": truncate_value(page.origin),
        "created_at_s": truncate_value(page.created_at_s),
    }
    seconds = _age_s(node, page)
    when = f"{seconds:.2f} s ago" if seconds is not None else "time unknown"
    return f"{name(page.key)} = {format_value(data)}  ({when}, from {format_short(page.origin)})", fields


def _age_s(node: Node, page: Page) -> float | None:
    if type(page.created_at_s) not in (int, float):
        return None
    seconds = page_age_s(node, page)
    return seconds if math.isfinite(seconds) else None


# The names that `list` and `dump` accept.
VIEWS: dict[str, Callable[[Node], View]] = {
    "components": components,
    "endpoints": components,
    "loops": loops,
    "links": links,
    "pages": pages,
    "datastore": pages,
    "profiler": profile,
}


def views(node: Node, names: tuple[str, ...]) -> View:
    """Return several views, in order."""
    seen = {each: VIEWS[each](node) for each in names}
    return "\n\n".join(text for text, _ in seen.values()), {each: data for each, (_, data) in seen.items()}


def _rows(rows: Rows, columns: tuple[str, ...], what: str, count: int | None = None) -> View:
    if not rows:
        return f"no {what}", rows
    hidden = (len(rows) if count is None else count) - len(rows[:MAX_ROWS])
    return table(rows[:MAX_ROWS], columns) + (f"\n... {hidden} more" if hidden > 0 else ""), rows[:MAX_ROWS]
