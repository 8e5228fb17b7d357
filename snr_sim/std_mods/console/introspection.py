"""What a node is made of and how it does, read while it runs. Nothing here asks the machine for anything.

All this is read from another thread than the node's: copies of dicts are taken in one step, and what changes while
it is read is shown as it was a moment ago.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from snr_sim.core.loop import Loop
from snr_sim.core.profiler import Profiler
from snr_sim.prelude.page import Page
from snr_sim.std_mods.console.readable import ITEMS_MAX, bounded, first, in_words, short, table

if TYPE_CHECKING:
    from snr_sim.core.node import Node

LINK_PREFIX = "link_"  # a link stores its state as a page: link_<name>
ROWS_MAX = 500

Rows = list[dict[str, Any]]
View = tuple[str, Any]  # text for a person, plain data for a program


def components(node: Node) -> View:
    """Returns each component's name, kind, class, handlers, rate and ticks."""
    rows: Rows = []
    for name, component in node.components.copy().items():
        row: dict[str, Any] = {"component": name, "class": type(component).__name__}
        if isinstance(component, Loop):
            row |= {"kind": "loop", "rate_hz": component.max_tick_rate_hz, **_pulse(component)}
        else:
            row |= {"kind": "endpoint", "handlers": len(component.task_handlers)}
        rows.append(row)
    return _rows(rows, ("component", "kind", "class", "handlers", "rate_hz", "ticks"), "components")


def loops(node: Node) -> View:
    """Returns each loop's rate, ticks and largest lag."""
    rows: Rows = [
        {
            "loop": name,
            "rate_hz": loop.max_tick_rate_hz,
            **_pulse(loop),
            "runs": "no" if loop.is_terminated() else "yes",
        }
        for name, loop in node.components.copy().items()
        if isinstance(loop, Loop)
    ]
    return _rows(rows, ("loop", "rate_hz", "ticks", "late_s", "runs"), "loops")


def _pulse(loop: Loop) -> dict[str, Any]:
    backing = loop.backing
    return {} if backing is None else {"ticks": backing.ticks, "late_s": backing.late_s}


def pages(node: Node) -> View:
    """Returns each page's key, age, origin, and what it holds in short."""
    now_s = node.clock.now_s()
    rows: Rows = [
        {"page": key, "age_s": now_s - page.created_at_s, "origin": page.origin, "holds": short(page.data)}
        for key, page in first(node.datastore.pages.copy().items(), ROWS_MAX)
        if type(page) is Page and type(page.created_at_s) in (int, float)
    ]
    return _rows(rows, ("page", "age_s", "origin", "holds"), "pages", len(node.datastore.pages))


def links(node: Node) -> View:
    """Returns the state of each link, as it stores it itself."""
    fields = ("up", "age_s", "dropped", "rtt_s")
    rows: Rows = []
    for key, page in node.datastore.pages.copy().items():
        if key.startswith(LINK_PREFIX):
            state = page.data if isinstance(page.data, dict) else {}
            rows.append({"link": key.removeprefix(LINK_PREFIX), **{f: bounded(state.get(f), 4) for f in fields}})
    return _rows(rows, ("link", *fields), "links")


def profile(node: Node) -> View:
    """Returns what each handler and loop took."""
    if node.profiler is None:
        return "This node has no profiler: its config has one with Mode.DEBUG (`-d` on the command line).", []
    still = Profiler()
    still.timings = node.profiler.timings.copy()
    return still.dump(), still.rows()


def page(page: Page, now_s: float) -> View:
    """Returns all of a page, cut where it is long."""
    data = bounded(page.data, ITEMS_MAX)
    fields = {"key": page.key, "data": data, "origin": page.origin, "created_at_s": page.created_at_s}
    return f"{page.key} = {in_words(data)}  ({now_s - page.created_at_s:.2f} s ago, from {page.origin})", fields


# What `list` and `dump` know by name.
VIEWS: dict[str, Callable[[Node], View]] = {
    "components": components,
    "loops": loops,
    "links": links,
    "pages": pages,
    "datastore": pages,
    "profiler": profile,
}


def views(node: Node, names: tuple[str, ...]) -> View:
    """Returns several views, one after another."""
    seen = {name: VIEWS[name](node) for name in names}
    return "\n\n".join(text for text, _ in seen.values()), {name: data for name, (_, data) in seen.items()}


def _rows(rows: Rows, columns: tuple[str, ...], what: str, count: int | None = None) -> View:
    if not rows:
        return f"no {what}", rows
    hidden = (len(rows) if count is None else count) - len(rows[:ROWS_MAX])
    return table(rows[:ROWS_MAX], columns) + (f"\n... {hidden} more" if hidden > 0 else ""), rows[:ROWS_MAX]
