"""The newest command page for its loop: by callback, and from the node's pages before the first callback."""

import math
from types import SimpleNamespace
from typing import Any

from snr_sim.devices.commands import CommandInput
from snr_sim.prelude.page import Page


class Store:
    """Page store of a loop's node."""

    name = "robot"

    def __init__(self) -> None:
        self.page: Page | None = None
        self.listeners: list[Any] = []
        self.time_s = 0.0

    def add_store_listener(self, key: str, callback: Any) -> None:
        self.listeners.append(callback)

    def remove_store_listener(self, key: str, callback: Any) -> None:
        self.listeners.remove(callback)

    def get_page(self, key: str) -> Page | None:
        return self.page

    def get_time_s(self) -> float:
        return self.time_s

    def store(self, data: Any) -> Page:
        self.page = Page("engine", data, self.name, self.time_s)
        for callback in self.listeners:
            callback(self.page)
        return self.page


def test_newest_page_is_the_nodes_before_and_after_begin() -> None:
    store = Store()
    wakes: list[float] = []
    loop: Any = SimpleNamespace(parent=store, wake=lambda: wakes.append(store.time_s))
    commands = CommandInput(loop, "engine")
    assert commands.newest() == (None, math.inf)
    early = store.store(1)
    store.time_s = 0.5
    assert commands.newest() == (early, 0.5)
    commands.begin()
    assert commands.newest() == (early, 0.5)
    late = store.store(2)
    assert commands.newest() == (late, 0.0)
    assert wakes == [0.5]
    commands.end()
    commands.end()
    missed = store.store(3)
    commands.begin()
    assert commands.newest() == (missed, 0.0)
    assert wakes == [0.5]
