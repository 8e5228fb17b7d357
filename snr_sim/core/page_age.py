"""Age of a page, also of a page from a node with another clock.

On the wall clock each node counts from its own start, so `created_at_s` of another node's page is not comparable with
local time. A link knows the offset between the clocks of its two ends and stores it in its state page. That page is
recorded like any other, so a replay computes the same age.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.page import Page

LINK_PREFIX = "link_"


def page_age_s(node: NodeApi, page: Page) -> float:
    """Return the age of a page [s]; if uncertain, an upper bound.

    On the wall clock, the age of another node's page is infinite if no link knows that node's clock, since a command of
    unknown age must not count as fresh. The age is at least the time since the page arrived, which this node's own
    clock measures even if the other program has ended.
    """
    now_s = node.get_time_s()
    if page.origin == node.name:
        return now_s - page.created_at_s
    here_s = now_s - node.received_at_s(page.key)
    offset_s = 0.0 if node.is_in_lock_step else clock_offset_s(node, page.origin)
    return max(here_s, now_s - page.created_at_s - offset_s)


def clock_offset_s(node: NodeApi, far: str) -> float:
    """Return the offset from the far node's clock to ours [s], as measured by our links; -inf if none has.

    If several nodes have that name, return the smallest offset: an age is then too large rather than too small.
    """
    offsets_s = [
        peer["clock_offset_s"]
        for key, page in node.datastore.pages.copy().items()
        # A page with such a key from a far end is not the state of a link of this node.
        if key.startswith(LINK_PREFIX) and page.origin == node.name
        for name, peer in _peers_in(page.data)
        if (name == far or str(name).startswith(f"{far}#")) and isinstance(peer, dict)
        if isinstance(peer.get("clock_offset_s"), float)
    ]
    return min(offsets_s, default=-math.inf)


def _peers_in(state: Any) -> Iterable[tuple[Any, Any]]:
    """Return name and state of each peer in a link's page; nothing if the page has another format."""
    peers = state.get("peers") if isinstance(state, dict) else None
    return peers.items() if isinstance(peers, dict) else ()
