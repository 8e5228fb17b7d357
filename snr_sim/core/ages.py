"""How old a page is: also one that a node with another clock has made.

On the wall clock each node counts from its own start, so `created_at_s` of a page from elsewhere says nothing here by
itself. A link knows how far the clocks of its two ends are apart, and its state is a page like any other: recorded,
and there again in a replay. So the answer is the same there.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from snr_sim.prelude.page import Page

if TYPE_CHECKING:
    from snr_sim.core.node import Node

LINK_PREFIX = "link_"


def age_s(node: Node, page: Page) -> float:
    """Returns how long ago a page was made [s], in doubt the older: infinite, if no link knows its maker's clock."""
    offset_s = 0.0 if node.is_in_lock_step or page.origin == node.name else clock_offset_s(node, page.origin)
    return node.get_time_s() - page.created_at_s - offset_s


def clock_offset_s(node: Node, far: str) -> float:
    """Returns what a link of ours has found to be added to the far node's times to have ours; -inf if none has."""
    for key, page in node.datastore.pages.copy().items():
        # What a far end has stored under such a key is no state of a link of ours.
        if key.startswith(LINK_PREFIX) and page.origin == node.name and isinstance(page.data, dict):
            peer = page.data.get("peers", {}).get(far, {})
            if peer.get("clock_offset_s") is not None:
                return float(peer["clock_offset_s"])
    return -math.inf
