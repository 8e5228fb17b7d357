"""Links over a simulated network, in random histories: no order of events ends a node, or leaves anything open."""

from __future__ import annotations

import errno
import logging
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest

from snr_sim import Config, Node, SocketsPair
from snr_sim.links.frames import encode_frame
from snr_sim.links.messages import Auth, Bye, HelloMessage, Ping, encode_message
from snr_sim.links.restarting import RestartingLoop
from snr_sim.links.streams import Streams
from snr_sim.links.tcp_server import MAX_NEWCOMERS, PAUSE_S
from snr_sim.prelude.errors import ComponentFailedError

from .simulated_network import HERE, Network, SimSocket, SimTime, failure

STEPS = 120
SENT = "x" * 20_000  # every page is a part of it
SETTLED_S = 60.0  # simulated time in which an honest client has to be served again
RETRY_S = 0.25  # simulated time between two pages for it, less than between pings: what links wait for takes seconds
SECRET = "a secret of 16 bytes or more"
HELLOS = [HelloMessage("snr", 2, "x", "0" * 32, "pages", has_secret, 1 << 20) for has_secret in (True, False)]
STRANGE = [encode_frame(encode_message(one)) for one in (*HELLOS, Auth("0" * 64), Ping(1.0), Bye("x"))]
STRANGE.append(encode_frame(b"[" * 1000))
LINK = "link_t"


class History:
    """A robot with a server, an operator's node with its client, and attackers, in one thread; all from one seed."""

    def __init__(self, seed: int, patch: pytest.MonkeyPatch) -> None:
        self.network = network = Network(seed)
        network.install(patch)
        self.rng = network.rng
        # A secret or the address excludes unauthenticated clients.
        self.pair = SocketsPair((HERE, 0), name="t", secret=SECRET, queue_pages=20)
        if seed % 4 == 0:
            self.pair = SocketsPair(("0.0.0.0", 0), name="t", allow=["10.0.0.0/8"], queue_pages=20)
        self.expected: dict[str, int] = {}  # pages that each node's link had to send, once per peer
        self.robot = self.node("robot", self.pair.server("depth"))
        self.operator = self.node("operator", self.pair.client("stick"))
        self.nodes = (self.robot, self.operator)
        self.attackers: list[SimSocket] = []
        self.mark = 0  # number of the newest page that marks the end of `settle`
        self.acts: list[Callable[[], None]] = [self.round] * 8 + [self.store] * 3 + [self.connect] * 6
        self.acts += [
            self.send,
            self.send,
            self.hang_up,
            self.hang_up,
            self.break_line,
            self.crowd,
            self.fill,
            self.wait,
        ]
        if self.pair.secret:
            self.acts.append(self.tamper)
        self.has_bugs = seed % 2 == 1
        if self.has_bugs:
            self.acts += [self.bug_of_stream, self.bug_of_link]

    def node(self, role: str, factory: Any) -> Node:
        node = Node(role, Config(factories={role: [factory]}), clock=SimTime(self.network))
        node.begin()
        link: Any = node.components[LINK]
        carry, self.expected[node.name] = link._carry, 0

        def count(*args: Any) -> None:
            self.expected[node.name] += max(1, len(link.transport.peers.up))
            carry(*args)

        link._carry = count
        return node

    def link(self, node: Node) -> Any:
        return node.components[LINK]

    def run(self) -> None:
        for _ in range(STEPS):
            self.rng.choice(self.acts)()
        self.settle()
        self.end()

    # Events

    def round(self) -> None:
        for node in self.nodes:
            if self.rng.random() < 0.7:
                self.link(node).caller.step()
            if self.rng.random() < 0.7:
                self.serve(node)

    def serve(self, node: Node) -> None:
        """Do what the node's thread does: all queued tasks, and one poll of readable streams."""
        node.run_ready()
        node.inbox.wait(0.0)
        if node.inbox.waiting:
            node.run_ready()
        for key in ("depth", "stick"):
            data = node.datastore.pages[key].data if key in node.datastore.pages else 0
            assert isinstance(data, int) or data == SENT[: len(data)], "a page was changed on its way"
        assert node.inbox.failure is None
        assert not node.is_terminated

    def store(self) -> None:
        size = self.rng.choice((1, 100, 3000, len(SENT)))
        self.robot.store_data("depth", SENT[:size])
        self.operator.store_data("stick", SENT[:size])

    def connect(self) -> None:
        sock = self.network.connect_if_possible(self.pair.port, "192.0.2.1")
        if sock is not None:
            self.attackers.append(sock)

    def crowd(self) -> None:
        for _ in range(self.rng.randrange(MAX_NEWCOMERS + 10)):
            self.connect()

    def send(self) -> None:
        for sock in self.rng.sample(self.attackers, min(len(self.attackers), 5)):
            data = b"".join(self.rng.choices(STRANGE, k=self.rng.randrange(1, 4)))
            with suppress(OSError):
                sock.send(data if self.rng.random() < 0.7 else self.rng.randbytes(20))

    def hang_up(self) -> None:
        for sock in self.rng.sample(self.attackers, min(len(self.attackers), self.rng.choice((1, 5, 50)))):
            with suppress(OSError):
                self.rng.choice((sock.close, sock.reset, sock.reset, lambda sock=sock: sock.shutdown(1)))()
            if sock.descriptor < 0:
                self.attackers.remove(sock)

    def break_line(self) -> None:
        """Break an honest stream: reset at one end, at both, or cut without notice."""
        for stream in self.link(self.operator).transport.streams:
            sock = stream.port._sock
            how = self.rng.randrange(3)
            if how == 2:
                sock.cut()
                continue
            sock.is_reset = True
            if how and sock.far:
                sock.far.is_reset = True

    def tamper(self) -> None:
        """Change, add or remove bytes of an honest stream in transit."""
        for stream in self.link(self.rng.choice(self.nodes)).transport.streams:
            come = stream.port._sock.come
            i = self.rng.randrange(len(come) + 1)
            come[i : i + self.rng.randrange(3)] = self.rng.randbytes(self.rng.randrange(3))

    def fill(self) -> None:
        self.network.is_full = not self.network.is_full

    def wait(self) -> None:
        self.network.now_s += self.rng.choice((0.01, 0.5, 4.0))

    def bug_of_stream(self) -> None:
        for stream in self.link(self.rng.choice(self.nodes)).transport.streams[:1]:
            bugs = (RuntimeError("a bug"), OSError(errno.EIO, os.strerror(errno.EIO)))
            stream.port._sock.bug = self.rng.choice(bugs)

    def bug_of_link(self) -> None:
        if self.rng.random() < 0.3:
            self.link(self.rng.choice(self.nodes)).transport._selector.bug = RuntimeError("a bug")

    # Conditions afterwards

    def settle(self) -> None:
        """Disconnect the attackers, and require that the honest client is served."""
        self.network.is_full = False
        for sock in self.attackers:
            sock.close()
        give_up_s, is_served = self.network.now_s + SETTLED_S, False
        while not is_served:
            assert self.network.now_s < give_up_s, (self.robot.get_data(LINK), self.operator.get_data(LINK))
            self.mark += 1
            self.robot.store_data("depth", self.mark)
            self.operator.store_data("stick", self.mark)
            self.rounds(2)
            is_served = self.robot.get_data("stick") == self.operator.get_data("depth") == self.mark
            self.network.now_s += RETRY_S
        for node in self.nodes:
            self.check_known(node)

    def rounds(self, count: int) -> None:
        for node in self.nodes * count:
            self.link(node).caller.step()
            self.serve(node)
        self.network.now_s += 0.01

    def check_known(self, node: Node) -> None:
        """Check that each stream of a link is open, and that its selector has no other descriptor."""
        link = self.link(node)
        assert self.has_bugs or not link.failures, link.failures
        transport = link.transport
        own = {stream.descriptor for stream in transport.streams} | {transport._wake_out.fileno()}
        if node is self.robot:
            own.add(transport._listener.fileno())
        assert own <= self.network.open.keys()
        assert {key.fd for key in transport._selector.get_map().values()} <= own

    def end(self) -> None:
        """End both nodes: each page was sent, dropped or kept, and no descriptor is left."""
        for node in self.nodes:
            node.end("the history is over")
            link = self.link(node)
            assert link.sent + link.dropped + link.transport.peers.unsent == self.expected[node.name]
        assert not self.network.open


def play(seeds: range) -> None:
    logging.getLogger("snr").setLevel(logging.CRITICAL + 1)
    for seed in seeds:
        with pytest.MonkeyPatch.context() as patch:
            try:
                History(seed, patch).run()
            except BaseException as error:
                error.add_note(f"seed {seed}")
                raise


NIGHTLY = [pytest.param(range(i, i + 5_000), marks=pytest.mark.nightly(minutes=1.2)) for i in range(0, 100_000, 5_000)]


@pytest.mark.parametrize(
    "seeds", [range(50), pytest.param(range(2000), marks=[pytest.mark.slow, pytest.mark.unmeasured]), *NIGHTLY], ids=str
)
def test_links_in_random_histories_keep_node_and_honest_client(seeds: range) -> None:
    play(seeds)


def act_unguarded(streams: Streams, stream: Any, act: Callable[..., object], *args: object) -> None:
    """Act as an earlier version of `Streams._for`: also on closed streams, and with errors passed on."""
    act(stream, *args)


def test_campaign_without_stream_error_handling_finds_a_failed_link(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Streams, "_for", act_unguarded)
    with pytest.raises(AssertionError):
        play(range(0, 100, 2))  # no other bugs


def test_campaign_without_restart_finds_a_node_that_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Streams, "_for", act_unguarded)
    monkeypatch.setattr(RestartingLoop, "loop", lambda self: self._round())
    with pytest.raises(ComponentFailedError, match=r"list\.remove\(x\): x not in list"):
        play(range(0, 100, 2))


@pytest.fixture
def history(monkeypatch: pytest.MonkeyPatch) -> Iterator[History]:
    """Provide both ends up, with nothing in transit."""
    history = History(2, monkeypatch)
    history.settle()
    yield history
    history.has_bugs = True
    history.settle()
    history.end()


def test_failed_link_shows_down_with_the_reason_and_is_up_again(history: History) -> None:
    link = history.link(history.robot)
    link.transport._selector.bug = RuntimeError("a bug")
    history.rounds(1)
    page = history.robot.get_data(LINK)
    assert not page["up"]
    assert page["reason"] == "'link_t' failed and starts again: RuntimeError: a bug"
    assert page["failures"] == 1
    assert not history.network.listeners
    history.has_bugs = True
    history.settle()
    assert history.robot.get_data(LINK)["up"]


def test_repeatedly_failing_link_waits_longer_and_logs_once(
    history: History, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    link = history.link(history.robot)
    with monkeypatch.context() as patch, caplog.at_level(logging.ERROR):
        patch.setattr(link, "_round", lambda: 1 / 0)
        for _ in range(2000):
            history.rounds(1)
    assert 5 <= link.failures <= 30  # in 20 s
    assert len([record for record in caplog.records if "ZeroDivisionError" in record.message]) == 1


def test_bug_of_one_stream_closes_only_that_stream(history: History, caplog: pytest.LogCaptureFixture) -> None:
    (honest,) = history.link(history.robot).transport.streams
    for count in (1, 2):
        history.connect()
        history.rounds(2)
        other = next(stream for stream in history.link(history.robot).transport.streams if stream is not honest)
        other.port._sock.bug = RuntimeError("a bug")
        history.attackers[-1].send(b"x")
        history.rounds(2)
        assert history.link(history.robot).transport.streams == [honest]
        assert history.link(history.robot).failures == count
        assert not history.link(history.robot).is_shut
    stacks = [bool(record.exc_info) for record in caplog.records if record.message.startswith("192.0.2.1")]
    assert stacks == [True, False]  # a line each
    assert not any(record.exc_info for record in caplog.records[len(caplog.records) // 2 :])


def test_unauthenticated_client_that_resets_keeps_the_honest_client_up(monkeypatch: pytest.MonkeyPatch) -> None:
    history = History(4, monkeypatch)  # unauthenticated clients are refused by their address
    history.settle()
    (honest,) = history.link(history.robot).transport.streams
    history.connect()
    history.attackers[0].reset()
    history.rounds(2)
    assert history.link(history.robot).transport.streams == [honest]
    assert not honest.session.is_closed
    assert not history.link(history.robot).failures


@pytest.mark.parametrize(("number", "pauses"), [(errno.EMFILE, True), (errno.ECONNABORTED, False)])
def test_server_that_cannot_accept_pauses_only_without_a_descriptor(
    history: History, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, number: int, pauses: bool
) -> None:
    transport = history.link(history.robot).transport

    def fail() -> None:
        transport._listener.waiting.clear()  # as if the client had gone: `select` no longer shows it
        raise failure(number)

    history.connect()
    with monkeypatch.context() as patch, caplog.at_level(logging.WARNING, "snr"):
        patch.setattr(transport._listener, "accept", fail)
        history.rounds(1)
    assert caplog.messages == ["cannot take a connection: Too many open files"] * pauses
    is_registered = any(key.fileobj is transport._listener for key in transport._selector.get_map().values())
    assert is_registered is not pauses, "or the selector would return at once every time"
    history.network.now_s += PAUSE_S
    history.connect()
    history.rounds(2)
    assert any(stream.where.startswith("192.0.2.1") for stream in transport.streams)


def test_paused_server_closes_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    history = History(2, monkeypatch)
    history.settle()
    history.network.is_full = True
    history.connect()
    history.rounds(1)
    history.attackers[0].close()
    history.end()
