"""Datastore: the newest page of each key, and the one before it under `<key>_prev`."""

from __future__ import annotations

from snr_sim.prelude.errors import TaskError
from snr_sim.prelude.page import DataKey, Page

PREVIOUS = "_prev"


class Datastore:
    """Pages by key. Written on the node's thread only; read from any.

    >>> store = Datastore()
    >>> store.put(Page("depth", 1.0, "urov_node", 0.0))
    >>> store.put(Page("depth", 2.0, "urov_node", 0.1)).data
    1.0
    >>> store.get("depth").data, store.get("depth_prev").data, store.get("heading")
    (2.0, 1.0, None)
    """

    def __init__(self) -> None:
        self.pages: dict[DataKey, Page] = {}
        self.previous: dict[DataKey, Page] = {}
        self.missed: dict[DataKey, None] = {}  # requested too early, in order; reported if never stored
        self.stored: int = 0

    def put(self, page: Page) -> Page | None:
        """Make `page` the newest of its key; return the previous newest, if any.

        Raises:
            TaskError: it is not a page, or its key is not text.
        """
        try:
            key = page.key
            old = self.pages.get(key)
        except (AttributeError, TypeError):
            raise TaskError(
                f"A store_page task carries {page!r}, which is not a page.",
                fix="self.store_data_task(key, data) makes a right one.",
            ) from None
        if old is not None:
            self.previous[key] = old
        elif not isinstance(key, str):
            raise TaskError(f"A page has the key {key!r}, which is not text.", fix="give it a name: 'depth'.")
        self.pages[key] = page
        self.stored += 1
        return old

    def get(self, key: DataKey) -> Page | None:
        """Return the newest page of the key, or None if nothing has stored it (yet)."""
        page = self.pages.get(key)
        if page is None and isinstance(key, str) and key.endswith(PREVIOUS):
            key = key.removesuffix(PREVIOUS)
            page = self.previous.get(key)
            if page is None and key in self.pages:
                return None  # only one page so far, which is not an error
        if page is None:
            self.missed[key] = None
        return page
