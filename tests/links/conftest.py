"""Nodes that run on threads of their own during a test, and waiting for the pages they store."""

from __future__ import annotations

import itertools
import random
import socket
import struct
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

import msgspec
import pytest

from snr_sim import Config, Node, SimRunner, Task, TaskType, tasks
from snr_sim.core.clocks import WallClock
from snr_sim.core.config import AnyFactory
from snr_sim.links.frames import LengthPrefixedReader, encode_frame
from snr_sim.links.messages import Ping, Pong, decode_message
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

LIMIT_S = 90.0  # of any wait: long, because a busy machine must not fail a test


def free_port() -> int:
    """Return an unused port, below the range that systems use for outgoing connections."""
    while True:
        port = random.randrange(20_000, 32_000)
        with socket.socket() as sock, suppress(OSError):
            sock.bind(("127.0.0.1", port))
            return port


def collector(came: list[Any], key: str | None = "x", field: str = "data") -> FunctionEndpointFactory:
    """Collect a field of each page stored under a key, or under any key."""
    what: Any = TaskType.store_page if key is None else (TaskType.store_page, key)
    return FunctionEndpointFactory({what: lambda task, task_id: came.append(getattr(task.val_list[0], field))}, "ear")


def ticks(key: str, rate_hz: float = 10.0) -> FunctionLoopFactory:
    """Store 0, 1, 2, ... at a rate."""
    values = itertools.count()
    return FunctionLoopFactory(lambda loop: loop.store_data(key, next(values)), f"ticks_{key}", rate_hz)


def simulate(roles: Mapping[str, Sequence[AnyFactory]], until_s: float | None = None, **options: Any) -> SimRunner:
    """Run roles in lock step, and return the runner."""
    runner = SimRunner(Config(factories=dict(roles)), until_s=until_s, **options)
    runner.run()
    return runner


class Running:
    """A node on a thread; every page it stores is kept in `stored`."""

    def __init__(
        self, role: str, factories: Sequence[AnyFactory], seed: int = 0, clock: WallClock | None = None
    ) -> None:
        self.stored: defaultdict[str, list[Any]] = defaultdict(list)
        self.news = threading.Condition()
        probe = FunctionEndpointFactory({TaskType.process_data: lambda task, task_id: self._notify()}, "probe")
        self.keep = FunctionEndpointFactory({TaskType.store_page: self._keep}, "keep")
        self.node = Node(role, Config(factories={role: [*factories, self.keep, probe]}), seed=seed, clock=clock)
        self.failure: BaseException | None = None
        self.thread = threading.Thread(target=self._run, daemon=True)

    def _keep(self, task: Task, task_id: Any) -> None:
        self.stored[task.name].append(task.val_list[0].data)

    def _notify(self) -> None:
        with self.news:
            self.news.notify_all()

    def _run(self) -> None:
        try:
            self.node.loop()
        except BaseException as error:
            self.failure = error
        self._notify()

    def until(self, is_so: Callable[[], Any], what: str = "") -> None:
        """Wait until a condition is true, including those that no page reports."""
        end_s = time.monotonic() + LIMIT_S
        with self.news:
            while not (is_so() or self.failure):
                assert time.monotonic() < end_s, (what, dict(self.stored))
                self.news.wait(0.1)
        assert self.failure is None or is_so()

    def until_link(self, name: str, up: bool = True, **expected: Any) -> dict[str, Any]:
        """Wait until the link's page has these values, and return its data."""
        key = f"link_{name}"

        def newest() -> dict[str, Any]:
            return self.stored[key][-1] if self.stored[key] else {}

        def is_so() -> bool:
            state = newest()
            return state.get("up") is up and all(state[field] == value for field, value in expected.items())

        self.until(is_so, f"{key} up={up} {expected}")
        return newest()

    def until_stored(self, key: str, count: int = 1) -> list[Any]:
        """Wait until so many pages of a key have been stored, and return their data."""
        self.until(lambda: len(self.stored[key]) >= count, f"{count} of {key}")
        return self.stored[key]

    def store(self, key: str, *values: Any) -> None:
        """Store values from outside the node."""
        for value in values:
            self.node.store_data(key, value)

    def end(self) -> None:
        """End the node, and wait for its end."""
        self.node.enqueue_input(tasks.terminate("test is over"), "test")
        self.thread.join(LIMIT_S)
        assert not self.thread.is_alive()


Start = Callable[..., Running]


@pytest.fixture
def start() -> Iterator[Start]:
    """Start a node, `start("role", [factories])`, and wait until its link is `down`, or `up`. Ends all of them."""
    started: list[Running] = []

    def begin(role: str, factories: Sequence[AnyFactory], *, down: str = "", up: str = "", **options: Any) -> Running:
        running = Running(role, factories, **options)
        started.append(running)
        running.thread.start()
        if down or up:
            running.until_link(down or up, up=bool(up))
        return running

    yield begin
    for running in started:
        running.end()


class Raw:
    """A scripted peer that does nothing by itself, to send what no node would."""

    def __init__(self, port: int, greets: bool = True, node: str = "raw", **fields: Any) -> None:
        self.sock = socket.create_connection(("127.0.0.1", port), LIMIT_S)
        self.reader = LengthPrefixedReader(1 << 26)
        if greets:
            self.send(hello(node, **fields))

    def send(self, *payloads: bytes) -> None:
        """Send payloads, each in a frame."""
        self.sock.sendall(b"".join(encode_frame(payload, 1 << 30) for payload in payloads))

    def messages(self, until: type | None = None) -> list[Any]:
        """Read until a message of a type has arrived, or to the end; return all but pings."""
        came: list[Any] = []
        while not (until and came and type(came[-1]) is until):
            try:
                data = self.sock.recv(1 << 16)
            except ConnectionResetError:
                return came
            if not data:
                return came
            came += [
                message for raw in self.reader.feed(data) if type(message := decode_message(raw)) not in (Ping, Pong)
            ]
        return came

    def close(self) -> None:
        """Close the socket."""
        self.sock.close()

    def reset(self) -> None:
        """Close it with a reset: the other end receives a RST."""
        self.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.sock.close()


def hello(node: str = "raw", **fields: Any) -> bytes:
    """Return a greeting."""
    usual = {"protocol": "snr", "version": 2, "node": node, "nonce": "0" * 32, "purpose": "pages", "auth": False}
    return msgspec.json.encode({"$": "hello", "max_frame_bytes": 1 << 26, **usual, **fields})


@pytest.fixture
def raw() -> Iterator[Callable[..., Raw]]:
    """Connect a scripted peer: `raw(port)`. All are closed after the test."""
    made: list[Raw] = []

    def connect(port: int, greets: bool = True, node: str = "raw", **fields: Any) -> Raw:
        made.append(Raw(port, greets, node, **fields))
        return made[-1]

    yield connect
    for one in made:
        one.close()


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Create certificates of a robot, of a student, of an authority, and of an untrusted authority."""
    trustme = pytest.importorskip("trustme")  # part of snr_sim[dev]
    folder = tmp_path_factory.mktemp("tls")
    authority, other_authority = trustme.CA(), trustme.CA()
    robot, student = authority.issue_cert("127.0.0.1"), authority.issue_cert("student@pool.example")
    evil = other_authority.issue_cert("evil@pool.example")
    paths = {}
    for name, cert in (("robot", robot), ("student", student), ("evil", evil)):
        for kind, blob in (("cert", cert.cert_chain_pems[0]), ("key", cert.private_key_pem)):
            paths[f"{name}_{kind}"] = str(folder / f"{name}.{kind}")
            blob.write_to_path(paths[f"{name}_{kind}"])
    for name, ca in (("authority", authority), ("other_authority", other_authority)):
        paths[name] = str(folder / f"{name}.pem")
        ca.cert_pem.write_to_path(paths[name])
    return paths
