"""Nodes that run on threads of their own, as long as a test lasts, and waiting for what they store."""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest

from snr_sim import Config, Node, Task, TaskType, tasks
from snr_sim.core.config import AnyFactory
from snr_sim.testing.parts import PartFactory

LIMIT_S = 30.0  # of any wait: long, because a loaded machine must not fail a test


class Running:
    """A node on a thread; every page it stores is kept in `stored`."""

    def __init__(self, role: str, factories: Sequence[AnyFactory], seed: int = 0) -> None:
        self.stored: defaultdict[str, list[Any]] = defaultdict(list)
        self.news = threading.Condition()
        probe = PartFactory({TaskType.process_data: lambda task, task_id: self._tell()}, "probe")
        self.keep = PartFactory({TaskType.store_page: self._keep}, "keep")
        self.node = Node(role, Config(factories={role: [*factories, self.keep, probe]}), seed=seed)
        self.failure: BaseException | None = None
        self.thread = threading.Thread(target=self._run, daemon=True)

    def _keep(self, task: Task, task_id: Any) -> None:
        self.stored[task.name].append(task.val_list[0].data)

    def _tell(self) -> None:
        with self.news:
            self.news.notify_all()

    def _run(self) -> None:
        try:
            self.node.loop()
        except BaseException as error:
            self.failure = error
        self._tell()

    def until(self, is_so: Callable[[], Any], what: str = "") -> None:
        """Waits until something has become true."""
        with self.news:
            assert self.news.wait_for(lambda: is_so() or self.failure, LIMIT_S), (what, dict(self.stored))
        assert self.failure is None or is_so()

    def until_link(self, name: str, up: bool = True, **wanted: Any) -> dict[str, Any]:
        """Waits until the link's page says so, and returns what it says."""
        key = f"link_{name}"

        def state() -> dict[str, Any]:
            return self.stored[key][-1] if self.stored[key] else {}

        def is_so() -> bool:
            said = state()
            return said.get("up") is up and all(said[field] == value for field, value in wanted.items())

        self.until(is_so, f"{key} up={up} {wanted}")
        return state()

    def until_stored(self, key: str, count: int = 1) -> list[Any]:
        """Waits until so many pages of a key have been stored, and returns their data."""
        self.until(lambda: len(self.stored[key]) >= count, f"{count} of {key}")
        return self.stored[key]

    def store(self, key: str, *values: Any) -> None:
        """Stores values from outside."""
        for value in values:
            self.node.store_data(key, value)

    def end(self) -> None:
        """Ends the node, and returns when it has."""
        self.node.enter(tasks.terminate("test is over"), "test")
        self.thread.join(LIMIT_S)
        assert not self.thread.is_alive()


Start = Callable[..., Running]


@pytest.fixture
def start() -> Iterator[Start]:
    """Starts a node: `start("role", [factories])`. All are ended after the test."""
    started: list[Running] = []

    def begin(role: str, factories: Sequence[AnyFactory], seed: int = 0) -> Running:
        running = Running(role, factories, seed)
        started.append(running)
        running.thread.start()
        return running

    yield begin
    for running in started:
        running.end()
