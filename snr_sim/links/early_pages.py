"""EarlyPages: what is stored before a link is first up: all of it is kept, up to the bound of the link's queue."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from snr_sim.links.send_queue import Policy, SendQueue
from snr_sim.prelude.page import DataKey, Page

SHOWN_KEYS = 5


@dataclass(frozen=True, slots=True)
class Kept:
    """A page, and the frame that it is sent in; as long as that."""

    page: Page
    frame: bytes

    def __len__(self) -> int:
        return len(self.frame)


class EarlyPages(SendQueue[Kept]):
    """Counts for each key what had to go."""

    def __init__(self, max_pages: int, policy: Policy) -> None:
        super().__init__(max_pages, policy)
        self.gone: Counter[DataKey] = Counter()

    def _drop(self, frame: Kept) -> None:
        super()._drop(frame)
        self.gone[frame.page.key] += 1

    @property
    def loss(self) -> str:
        """What had to go, in words; empty if nothing had to."""
        if not self.gone:
            return ""
        most = ", ".join(f"{key} {count}" for key, count in self.gone.most_common(SHOWN_KEYS))
        more = f" and {len(self.gone) - SHOWN_KEYS} keys more" if len(self.gone) > SHOWN_KEYS else ""
        which = "oldest" if self.policy == "drop_oldest" else "newest"
        return (
            f"the {which} {self.dropped} pages that were stored before anybody had connected were dropped "
            f"({most}{more}); queue_pages={self.max_pages} keeps no more."
        )
