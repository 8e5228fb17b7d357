"""Loops in processes: speed-up on two cores, and the cost of start, communication and end.

Run by `snr bench processes`.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from statistics import median
from typing import Literal

from harness import Row

from snr_sim import Config, Loop, LoopFactory, Mode, Node, tasks

SPEED_UP = 1.8
END_LIMIT_S = 0.3
PARTS = 20_000
BIG_BYTES = 1_000_000
START_LIMIT_S = 120.0

ExecutorName = Literal["thread", "process"]


class Worker(Loop):
    """Keeps one core busy with Python."""

    def __init__(self, factory: WorkerFactory, parent: Node) -> None:
        super().__init__(factory, parent, factory.name, factory.rate_hz)
        self.executor = factory.executor

    def loop(self) -> None:
        total = 0
        for i in range(PARTS if self.max_tick_rate_hz == 0 else 1):
            total += i * i
        self.store_data(self.name, total)


class WorkerFactory(LoopFactory):
    """Makes it."""

    def __init__(self, number: int, executor: ExecutorName, rate_hz: float) -> None:
        super().__init__()
        self.name, self.executor, self.rate_hz = f"worker{number}", executor, rate_hz

    def get(self, parent: Node) -> Loop:
        return Worker(self, parent)


class Camera(Loop):
    """Stores large arrays, as often as it can."""

    executor = "process"

    def setup(self) -> None:
        import numpy as np

        self.image = np.zeros(BIG_BYTES, np.uint8)

    def loop(self) -> None:
        self.store_data("image", self.image)


class CameraFactory(LoopFactory):
    """Makes it."""

    def get(self, parent: Node) -> Loop:
        return Camera(self, parent, "camera", 0.0)


class Run:
    """Run a node during the block; all its loops have ticked before the block begins."""

    def __init__(self, factories: Sequence[LoopFactory], first_keys: Sequence[str]) -> None:
        self.node = Node("bench", Config(Mode.TEST, {"bench": list(factories)}))
        self._thread = threading.Thread(target=self.node.loop)
        self._keys = first_keys

    def __enter__(self) -> Run:
        self._thread.start()
        give_up_s = time.monotonic() + START_LIMIT_S
        while not set(self._keys) <= set(self.node.datastore.pages):
            assert time.monotonic() < give_up_s, "the loops do not start"
            time.sleep(0.01)
        return self

    def __exit__(self, *failure: object) -> None:
        self.node.enqueue_input(tasks.terminate("enough"), "bench")
        self._thread.join()

    def pages_per_s(self, wall_s: float) -> float:
        """Return how many pages the loops store."""
        before, start_s = self.node.datastore.stored, time.perf_counter()
        time.sleep(wall_s)
        return (self.node.datastore.stored - before) / (time.perf_counter() - start_s)


def work_done(executor: ExecutorName, wall_s: float, count: int = 2) -> float:
    """Return how many ticks per second of pure work the loops do together."""
    factories = [WorkerFactory(i, executor, 0.0) for i in range(count)]
    with Run(factories, [factory.name for factory in factories]) as run:
        return run.pages_per_s(wall_s)


def end_s(count: int, executor: ExecutorName) -> float:
    """Return how long a node takes to end with so many loops at 10 Hz."""
    factories = [WorkerFactory(i, executor, 10.0) for i in range(count)]
    with Run(factories, [factory.name for factory in factories]):
        start_s = time.perf_counter()
    return time.perf_counter() - start_s


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows."""
    wall_s, rounds = (0.5, 2) if is_quick else (3.0, 5)
    threads, processes = [], []
    for _ in range(rounds):
        threads.append(work_done("thread", wall_s))
        processes.append(work_done("process", wall_s))
    yield Row(
        "two loops of pure work, in processes against in threads",
        median(process / thread for process, thread in zip(processes, threads, strict=True)),
        "x",
        limit=SPEED_UP,
        more_is_better=True,
        note=f"{max(processes):.0f} ticks/s against {max(threads):.0f}; wants two idle cores",
    )
    count = 10 if is_quick else 50
    for executor in ("thread", "process"):
        yield Row(
            f"end of {count} loops at 10 Hz, in {'threads' if executor == 'thread' else 'processes'}",
            min(end_s(count, executor) for _ in range(2 if is_quick or executor == "process" else 5)),
            "s",
            limit=END_LIMIT_S,
            note="wall time, from the terminate task until loop() has returned",
        )
    with Run([CameraFactory()], ["image"]) as run:
        yield Row(
            "arrays of 1 MB out of a process",
            run.pages_per_s(wall_s) * BIG_BYTES / 1e6,
            "MB/s",
            note="copied in, copied out, and stored by the node",
        )
