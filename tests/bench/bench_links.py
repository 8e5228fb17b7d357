"""Links: round-trip time of a page to a node in another process, and one-way throughput.

Compared in the same run and in turns with the same bytes through bare TCP, ZeroMQ and Zenoh. Wall time, on loopback.
Also the cost of a shared secret: the MAC of a page at each end, and round trips with and without it.
Run by `snr bench links`.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from statistics import median, quantiles

import peers
from bench_pages import PAGE
from harness import Row

from snr_sim import (
    Config,
    Endpoint,
    EndpointFactory,
    LoopFactory,
    Mode,
    Node,
    SocketsPair,
    SomeTasks,
    Task,
    TaskId,
    tasks,
)
from snr_sim import TaskType as T
from snr_sim.links.frames import HEADER_BYTES, FrameMac, encode_frame
from snr_sim.links.options import LinkOptions
from snr_sim.links.pipes import PipeLoopFactory

ROUND_TRIP_P50_US = 80.0
ROUND_TRIP_P99_US = 300.0
MAC_US = 5.0  # of a page, at each end
MAC_RATIO = 1.15  # of a round trip with a secret to one without
SECRET = "sixteen or more bytes"
SOCKETS_PAGES_PER_S = 100e3
PIPE_PAGES_PER_S = 80e3
BURST = 100  # pages stored by one task of the flood: a handler that has much to say
WARM_UP = 200
LINK = "link_bench"


class Echo(Endpoint):
    """Answers each ping with its data."""

    def __init__(self, factory: EndpointFactory, parent: Node) -> None:
        super().__init__(factory, parent, "echo")
        self.task_handlers = {(T.process_data, "ping"): self.answer}

    def answer(self, task: Task, task_id: TaskId) -> SomeTasks:
        return self.store_data_task("pong", self.get_data("ping"))


class EchoFactory(EndpointFactory):
    """Makes it."""

    def get(self, parent: Node) -> Endpoint:
        return Echo(self, parent)


class Pinger(Endpoint):
    """Sends a page, waits for its echo, sends the next."""

    factory: PingerFactory

    def __init__(self, factory: PingerFactory, parent: Node) -> None:
        super().__init__(factory, parent, "pinger")
        self.sent_s = 0.0
        self.task_handlers = {(T.process_data, LINK): self.look, (T.process_data, "pong"): self.receive}

    def look(self, task: Task, task_id: TaskId) -> SomeTasks:
        return self.send() if self.get_data(LINK)["up"] and not self.sent_s else None

    def send(self) -> Task:
        self.sent_s = time.perf_counter()
        return self.store_data_task("ping", PAGE.data)

    def receive(self, task: Task, task_id: TaskId) -> SomeTasks:
        self.factory.times_s.append(time.perf_counter() - self.sent_s)
        return self.send() if len(self.factory.times_s) < self.factory.count else tasks.terminate("done")


class PingerFactory(EndpointFactory):
    """Makes it, and keeps its times."""

    def __init__(self, count: int) -> None:
        super().__init__()
        self.count = count
        self.times_s: list[float] = []

    def get(self, parent: Node) -> Endpoint:
        return Pinger(self, parent)


class Flood(Endpoint):
    """Stores pages as fast as it can, once the link is up."""

    factory: FloodFactory

    def __init__(self, factory: FloodFactory, parent: Node) -> None:
        super().__init__(factory, parent, "flood")
        self.stored = 0
        self.task_handlers = {(T.process_data, LINK): self.look, (T.event, "more"): self.more}

    def look(self, task: Task, task_id: TaskId) -> SomeTasks:
        return self.more(task, task_id) if self.get_data(LINK)["up"] and not self.stored else None

    def more(self, task: Task, task_id: TaskId) -> SomeTasks:
        count = min(BURST, self.factory.count - self.stored)
        first, self.stored = self.stored, self.stored + count
        pages: list[Task] = [self.store_data_task("number", i, process=False) for i in range(first, first + count)]
        return [*pages, tasks.event("more")] if count else self.store_data_task("flood_is_over", self.stored)


class FloodFactory(EndpointFactory):
    """Makes it."""

    def __init__(self, count: int) -> None:
        super().__init__()
        self.count = count

    def get(self, parent: Node) -> Endpoint:
        return Flood(self, parent)


class Counter(Endpoint):
    """Counts the pages that arrive, and checks their order."""

    factory: CounterFactory

    def __init__(self, factory: CounterFactory, parent: Node) -> None:
        super().__init__(factory, parent, "counter")
        self.task_handlers = {
            (T.store_page, "number"): self.count,
            (T.process_data, "flood_is_over"): lambda task, task_id: tasks.terminate("done"),
        }

    def count(self, task: Task, task_id: TaskId) -> SomeTasks:
        factory, number = self.factory, task.val_list[0].data
        if number <= factory.newest:
            raise AssertionError(f"page {number} came after {factory.newest}")
        factory.newest = number
        factory.last_s = time.perf_counter()
        factory.first_s = factory.first_s or factory.last_s
        factory.arrived += 1
        return None


class CounterFactory(EndpointFactory):
    """Makes it, and keeps what it counted."""

    def __init__(self) -> None:
        super().__init__()
        self.arrived, self.newest, self.first_s, self.last_s = 0, -1, 0.0, 0.0

    def get(self, parent: Node) -> Endpoint:
        return Counter(self, parent)


def run(*factories: EndpointFactory | LoopFactory) -> None:
    """Run a node of these until it ends."""
    Node("near", Config(Mode.TEST, {"near": list(factories)})).loop()


def link_round_trips_s(count: int, has_secret: bool = False) -> list[float]:
    """Return round trips from page to page [s]: stored here, handled there, stored there, handled here."""
    port, pinger = peers.free_port(), PingerFactory(count)
    with far_end("echo", port, int(has_secret)):
        run(pair(port, has_secret).server("ping"), pinger)
    return pinger.times_s


def pair(port: int, has_secret: bool) -> SocketsPair:
    """Return both ends of the link of the round trips."""
    return SocketsPair((peers.HOST, port), name="bench", secret=SECRET if has_secret else None)


def sockets_flood(count: int) -> CounterFactory:
    """Return what arrives of so many pages through TCP."""
    port, counter = peers.free_port(), CounterFactory()
    with far_end("flood", port, count):
        run(SocketsPair((peers.HOST, port), name="bench").server(), counter)
    return counter


def pipe_flood(count: int) -> CounterFactory:
    """Return what arrives of so many pages through a pipe."""
    near, far = Pipe()
    counter = CounterFactory()
    with far_end("pipe_flood", far.fileno(), count, descriptors=[far.fileno()]):
        far.close()
        run(PipeLoopFactory(near, name="bench"), counter)
    return counter


def far_end(kind: str, *numbers: int, descriptors: Sequence[int] = ()) -> peers.FarEnd:
    """Run a far end in a process of its own meanwhile."""
    return peers.FarEnd([sys.executable, __file__, "--far", kind, *map(str, numbers)], descriptors)


def be_far_end(kind: str, *numbers: int) -> None:
    """What the other process does."""
    factories: list[EndpointFactory | LoopFactory]
    if kind == "echo":
        factories = [EchoFactory(), pair(numbers[0], bool(numbers[1])).client("pong")]
    else:
        keys, count = ["number", "flood_is_over"], numbers[1]
        link: LoopFactory = (
            SocketsPair((peers.HOST, numbers[0]), name="bench", queue_pages=count + 1).client(keys)
            if kind == "flood"
            else PipeLoopFactory(Connection(numbers[0]), keys, options=LinkOptions("bench", queue_pages=count + 1))
        )
        factories = [link, FloodFactory(count)]
    Node("far", Config(Mode.TEST, {"far": factories})).loop()


def percentiles_us(times_s: Sequence[float]) -> tuple[float, float]:
    """Return the 50th and the 99th percentile [us]."""
    parts = quantiles(times_s[WARM_UP:], n=100)
    return 1e6 * parts[49], 1e6 * parts[98]


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows."""
    yield from measure_round_trips(rounds=1 if is_quick else 5, count=1_000 if is_quick else 4_000)
    yield from measure_macs(rounds=3 if is_quick else 15, count=1_000 if is_quick else 4_000)
    count = 20_000 if is_quick else 1_000_000
    for name, flood, limit in (
        ("TCP link, one way", sockets_flood, SOCKETS_PAGES_PER_S),
        ("pipe link, one way", pipe_flood, PIPE_PAGES_PER_S),
    ):
        counter = flood(count)
        pages_per_s = (counter.arrived - 1) / (counter.last_s - counter.first_s)
        note = f"{counter.arrived} of {count} pages arrived, in order"
        yield Row(name, pages_per_s, "pages/s", limit=limit, more_is_better=True, note=note)


def measure_round_trips(rounds: int, count: int) -> Iterator[Row]:
    """Yield the round trips; all means take turns, and of the rounds the median counts."""
    payload = PAGE.serialize()
    found: dict[str, list[tuple[float, float]]] = {}
    for _ in range(rounds):
        found.setdefault("link", []).append(percentiles_us(link_round_trips_s(count)))
        for name, round_trips_s in peers.ROUND_TRIPS.items():
            found.setdefault(name, []).append(percentiles_us(round_trips_s(payload, count)))
    p50_us = {name: median(p50 for p50, _ in pairs) for name, pairs in found.items()}
    p99_us = {name: median(p99 for _, p99 in pairs) for name, pairs in found.items()}
    note = f"{len(payload)} bytes, {rounds} x {count} round trips"
    for percentile, values, limit in (("p50", p50_us, ROUND_TRIP_P50_US), ("p99", p99_us, ROUND_TRIP_P99_US)):
        mine = values.pop("link")
        yield Row(f"TCP link, round trip page to page, {percentile}", mine, "us", limit=limit, note=note)
        for name, theirs in values.items():
            yield Row(
                f"round trip {percentile} beside {name}",
                mine,
                "us",
                baseline=theirs,
                compared_to=name,
                ratio=mine / theirs,
                ratio_limit=None if name == "bare TCP" else 1.0,
            )


def measure_macs(rounds: int, count: int) -> Iterator[Row]:
    """Yield what a secret costs. The least of the rounds counts: other programs only ever add to it."""
    frame = encode_frame(PAGE.serialize())
    sealing, opening = FrameMac(bytes(32)), FrameMac(bytes(32))
    shortest_s = [float("inf")] * 2
    for _ in range(rounds):
        start_s = time.process_time()
        payloads = [sealing.seal(frame)[HEADER_BYTES:] for _ in range(count)]
        sealed_s = time.process_time()
        assert all(opening.open(payload) is not None for payload in payloads)
        both = sealed_s - start_s, time.process_time() - sealed_s
        shortest_s = [min(pair) for pair in zip(shortest_s, both, strict=True)]
    for name, spent_s in zip(("sender", "receiver"), shortest_s, strict=True):
        note = f"{len(frame)} bytes, CPU time, the least of {rounds} rounds of {count} pages"
        yield Row(f"MAC of a page, {name}", 1e6 * spent_s / count, "us", limit=MAC_US, note=note)
    found: dict[bool, list[float]] = {False: [], True: []}
    for _ in range(rounds):
        for has_secret, p50s_us in found.items():
            p50s_us.append(percentiles_us(link_round_trips_s(count, has_secret))[0])
    without, with_secret = (min(p50s_us) for p50s_us in found.values())
    yield Row(
        "TCP link with a secret, round trip page to page, p50",
        with_secret,
        "us",
        baseline=without,
        compared_to="without",
        ratio=with_secret / without,
        ratio_limit=MAC_RATIO,
        note=f"the least of {rounds} rounds in turns",
    )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--far"]:
        be_far_end(sys.argv[2], *map(int, sys.argv[3:]))
