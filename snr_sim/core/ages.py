"""How old a page is: also one that a node with another clock has made.

On the wall clock each node counts from its own start, so `created_at_s` of a page from elsewhere says nothing here by
itself. A link knows how far the clocks of its two ends are apart, and its state is a page like any other: recorded,
and there again in a replay. So the answer is the same there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.page import Page

LINK_PREFIX = "link_"


def age_s(node: NodeApi, page: Page) -> float:
    """Return how long ago a page was made [s], in doubt the older.

    Of another node's page on the wall clock that is infinite, if no link knows its maker's clock. No page is younger
    than the time it has been here: that is known by our own clock, whatever became of the program that made it.
    """
    now_s = node.get_time_s()
    if page.origin == node.name:
        return now_s - page.created_at_s
    here_s = now_s - node.came_at_s(page.key)
    offset_s = 0.0 if node.is_in_lock_step else clock_offset_s(node, page.origin)
    return max(here_s, now_s - page.created_at_s - offset_s)


def clock_offset_s(node: NodeApi, far: str) -> float:
    """Return what our links have found to be added to the far node's times to have ours; -inf if none has.

    Where several nodes have that name, the least: then a page is older than it should be rather than younger.
    """
    offsets_s = [
        peer["clock_offset_s"]
        for key, page in node.datastore.pages.copy().items()
        # What a far end has stored under such a key is no state of a link of ours.
        if key.startswith(LINK_PREFIX) and page.origin == node.name
        for name, peer in _peers_in(page.data)
        if (name == far or str(name).startswith(f"{far}#")) and isinstance(peer, dict)
        if isinstance(peer.get("clock_offset_s"), float)
    ]
    return min(offsets_s, default=-math.inf)


def _peers_in(state: Any) -> Iterable[tuple[Any, Any]]:
    """Return name and state of each peer in a link's page; nothing, if somebody has stored something else there."""
    peers = state.get("peers") if isinstance(state, dict) else None
    return peers.items() if isinstance(peers, dict) else ()
