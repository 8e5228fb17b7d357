"""Links over Zenoh, on this machine's own address: nodes on threads here, and in processes where it matters."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from snr_sim import LinkFaults, TaskType, Tls, ZenohNet
from snr_sim.links import zenoh_link
from snr_sim.links.queues import SHARE_BYTES
from snr_sim.prelude.errors import MissingExtraError
from snr_sim.prelude.task import Page
from snr_sim.testing.function_components import FunctionEndpointFactory

from .conftest import free_port

zenoh = pytest.importorskip("zenoh")  # part of snr_sim[dev]

Start = Callable[..., Any]
LIMIT_S = 90.0
NODE = Path(__file__).with_name("zenoh_node.py")
# The same without waiting for the link's leaving, as on an overloaded computer.
HASTY = (
    "import runpy; from snr_sim.links import zenoh_link; zenoh_link.LINGER_S = 0.0; "
    f"runpy.run_path({str(NODE)!r}, run_name='__main__')"
)


def free_address(protocol: str = "tcp") -> str:
    """Return an address that is currently unused."""
    return f"{protocol}/127.0.0.1:{free_port()}"


@pytest.fixture
def net() -> ZenohNet:
    return ZenohNet(name="fleet", listen=free_address())


def joins(net: ZenohNet, keys: Any = (), **options: Any) -> Any:
    """Return a link that connects to the address at which the net's first node listens."""
    return net.link(keys, listen=(), connect=[net.listen[0]], **options)


def names(running: Any) -> list[str]:
    """Return the peers in the newest page of a node's link."""
    pages = running.stored["link_fleet"]
    return sorted(pages[-1]["peers"]) if pages else []


class Process:
    """A node in its own process, which joins a net; see zenoh_node.py."""

    def __init__(
        self, net: ZenohNet, role: str, keys: Any = (), program: Sequence[str] = (str(NODE),), **options: Any
    ) -> None:
        where = {"name": net.name, "connect": [net.listen[0]], **options}
        command = [sys.executable, *program, role, json.dumps(where), json.dumps({"keys": keys})]
        self.popen = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.stored: dict[str, list[Any]] = {}
        self.news = threading.Condition()
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self) -> None:
        assert self.popen.stdout is not None
        for line in self.popen.stdout:
            key, data, _ = json.loads(line)
            with self.news:
                self.stored.setdefault(key, []).append(data)
                self.news.notify_all()

    def until_stored(self, key: str, count: int = 1) -> list[Any]:
        """Wait until so many pages of a key have been stored there, and return their data."""
        with self.news:
            assert self.news.wait_for(lambda: len(self.stored.get(key, ())) >= count, LIMIT_S), self.stored
            return list(self.stored[key])

    def until_peers(self, *wanted: str) -> None:
        """Wait until its link reports exactly these peers."""

        def has_peers() -> bool:
            pages = self.stored.get("link_fleet")
            return bool(pages) and sorted(pages[-1]["peers"]) == sorted(wanted)

        with self.news:
            assert self.news.wait_for(has_peers, LIMIT_S), self.stored

    def store(self, key: str, *values: Any) -> None:
        """Store values there."""
        assert self.popen.stdin is not None
        print(json.dumps([key, values]), file=self.popen.stdin, flush=True)

    def end(self) -> None:
        """End the node in good order."""
        assert self.popen.stdin is not None
        self.popen.stdin.close()
        assert self.popen.wait(LIMIT_S) == 0

    def kill(self) -> None:
        """Kill the process."""
        self.popen.kill()
        self.popen.wait()


@pytest.fixture
def process() -> Iterator[Callable[..., Process]]:
    """Start a node in a process: `process(net, "role", keys)`. All are killed after the test."""
    started: list[Process] = []

    def begin(*args: Any, **options: Any) -> Process:
        started.append(Process(*args, **options))
        return started[-1]

    yield begin
    for one in started:
        one.kill()
        one.reader.join(LIMIT_S)
        assert one.popen.stdin is not None
        assert one.popen.stdout is not None
        one.popen.stdin.close()
        one.popen.stdout.close()


@pytest.fixture
def zenoh_session(net: ZenohNet) -> Iterator[Callable[[], Any]]:
    """Connect a program with Zenoh and without snr_sim to the net's first node, which must run already."""
    sessions: list[Any] = []

    def connect() -> Any:
        config = zenoh.Config()
        for name, value in {
            "mode": "client",
            "connect": {"endpoints": [net.listen[0]]},
            "scouting": {"multicast": {"enabled": False}},
        }.items():
            config.insert_json5(name, json.dumps(value))
        sessions.append(zenoh.open(config))
        return sessions[-1]

    yield connect
    for session in sessions:
        session.close()


# Which nodes receive from which


@pytest.mark.slow
def test_pages_cross_in_both_directions_in_either_start_order(start: Start, net: ZenohNet) -> None:
    rov = start("rov", [joins(net, "depth")])
    assert rov.until_link("fleet", up=False)["reason"].startswith(f"waits for {net.listen[0]}")
    rov.store("depth", 1.5)  # before any node receives it
    shore = start("shore", [net.link("mission")])
    assert list(shore.until_link("fleet")["peers"]) == ["rov_node"]
    assert list(rov.until_link("fleet")["peers"]) == ["shore_node"]
    shore.store("mission", {"dive": True})
    assert rov.until_stored("mission") == [{"dive": True}]
    assert shore.until_stored("depth") == [1.5]


@pytest.mark.slow
def test_program_that_ends_before_its_link_left_is_not_aborted(
    start: Start, process: Callable[..., Process], net: ZenohNet
) -> None:
    start("shore", [net.link()])
    a = process(net, "a", "x", program=("-c", HASTY))
    a.until_peers("shore_node")
    a.end()


@pytest.mark.slow
def test_three_processes_exchange_pages_through_the_listening_one(
    start: Start, process: Callable[..., Process], net: ZenohNet
) -> None:
    shore = start("shore", [net.link()])
    a, b = process(net, "a", "x"), process(net, "b", "y")
    a.until_peers("shore_node", "b_node")
    b.until_peers("shore_node", "a_node")
    a.store("x", 1)
    b.store("y", 2)
    assert b.until_stored("x") == [1]
    assert a.until_stored("y") == [2]
    assert shore.until_stored("x") == [1]
    assert shore.until_stored("y") == [2]
    b.end()
    a.until_peers("shore_node")
    shore.until(lambda: names(shore) == ["a_node"])


@pytest.mark.slow
def test_robots_with_the_same_program_have_separate_names(start: Start, net: ZenohNet) -> None:
    shore = start("shore", [net.link("mission", namespaced=True)])
    rov1 = start("auv", [joins(net, "depth", robot="rov1", robots="shore_node")])
    rov2 = start("auv", [joins(net, "depth", robot="rov2", robots="shore_node")])
    shore.until(lambda: names(shore) == ["rov1/auv_node", "rov2/auv_node"])
    rov1.store("depth", 1.0)
    rov2.store("depth", 2.0)
    assert shore.until_stored("rov1/depth") == [1.0]
    assert shore.until_stored("rov2/depth") == [2.0]
    assert shore.node.get_page("rov1/depth").origin == "rov1/auv_node"
    shore.store("mission", "dive")
    assert rov1.until_stored("mission") == rov2.until_stored("mission") == ["dive"]
    assert rov1.stored["depth"] == [1.0]


@pytest.mark.slow
def test_nets_with_different_names_exchange_no_pages(start: Start, net: ZenohNet) -> None:
    other = ZenohNet(name="other fleet?", connect=net.listen[0])
    shore = start("shore", [net.link()])
    alien = start("alien", [other.link("x")])
    alien.store("x", "theirs")
    alien.until_link("other fleet?", up=False, reason="no other node is in the net.")  # connected, but ignored
    friend = start("friend", [joins(net, "x")], up="fleet")
    friend.store("x", "ours")
    assert shore.until_stored("x") == ["ours"]
    shore.until(lambda: names(shore) == ["friend_node"])  # the state of the link may be stored after its first page
    assert alien.stored["link_other fleet?"][-1]["up"] is False


@pytest.mark.slow
def test_discovery_uses_only_the_given_interface(start: Start) -> None:
    # Multicast reaches the whole machine, so this net's name must be unique.
    name = f"fleet {os.getpid()}"
    rov = start("rov", [ZenohNet(name=name, discover=True, listen=free_address()).link("x")])
    shore = start("shore", [ZenohNet(name=name, discover=True, listen=free_address()).link()])
    rov.until_link(name)
    rov.store("x", 1)
    assert shore.until_stored("x") == [1]


# Content and order


@pytest.mark.slow
def test_late_node_receives_the_newest_page_of_each_key_once(start: Start, net: ZenohNet) -> None:
    rov = start("rov", [net.link(["depth", "heading"])])
    early = start("early", [joins(net)])
    rov.until_link("fleet")
    rov.store("heading", 0.5)
    rov.store("depth", *range(100))
    early.until(lambda: early.stored["depth"] and early.stored["depth"][-1] == 99)
    late = start("late", [joins(net)])
    assert late.until_stored("depth") == [99]
    assert late.until_stored("heading") == [0.5]
    rov.store("depth", 100)
    assert late.until_stored("depth", 2) == [99, 100]
    assert early.until_stored("depth", 101) == list(range(101))
    assert early.stored["heading"] == [0.5]


@pytest.mark.slow
def test_ten_thousand_pages_reach_another_process_in_order(
    start: Start, process: Callable[..., Process], net: ZenohNet
) -> None:
    shore = start("shore", [net.link()])
    rov = process(net, "rov", "x")
    rov.until_peers("shore_node")
    rov.store("x", *range(10_000))
    assert shore.until_stored("x", 10_000) == list(range(10_000))
    state = shore.until_link("fleet")
    assert state["dropped"] == 0


@pytest.mark.slow
def test_large_page_arrives_in_order_with_small_ones(start: Start, net: ZenohNet) -> None:
    photo = "p" * 1_000_000
    rov = start("rov", [net.link("x")])
    shore = start("shore", [joins(net)])
    rov.until_link("fleet")
    rov.store("x", 1, photo, 2, photo, 3)
    assert shore.until_stored("x", 5) == [1, photo, 2, photo, 3]


@pytest.mark.slow
def test_any_text_may_be_a_key(start: Start, net: ZenohNet) -> None:
    keys = ["depth/of rov", "*", "**", "$x?#", "@me", "Tiefe ü", "a" * 256]
    rov = start("rov", [net.link(keys)])
    shore = start("shore", [joins(net, accept=keys)])
    rov.until_link("fleet")
    for number, key in enumerate(keys):
        rov.store(key, number)
    assert [shore.until_stored(key) for key in keys] == [[number] for number in range(len(keys))]


@pytest.mark.slow
def test_only_accepted_pages_are_stored(start: Start, net: ZenohNet) -> None:
    rov = start("rov", [net.link(["x", "y"])])
    shore = start("shore", [joins(net, accept=["y"])])
    rov.until_link("fleet")
    rov.store("x", 1)
    rov.store("y", 2)
    assert shore.until_stored("y") == [2]
    assert shore.stored["x"] == []


@pytest.mark.slow
def test_link_reports_rtt_and_age(start: Start, net: ZenohNet) -> None:
    start("rov", [net.link("x")])
    shore = start("shore", [joins(net)])
    shore.until(lambda: shore.stored["link_fleet"] and shore.stored["link_fleet"][-1]["rtt_s"] is not None)
    state = shore.stored["link_fleet"][-1]
    assert 0 < state["rtt_s"] < LIMIT_S
    assert 0 <= state["age_s"] < LIMIT_S


@pytest.mark.slow
def test_faults_delay_and_lose_pages_and_count_them(start: Start, net: ZenohNet) -> None:
    bad = ZenohNet(name="fleet", connect=net.listen[0], faults=LinkFaults(latency_s=0.2, loss=0.5, seed=1))
    shore = start("shore", [net.link()])
    rov = start("rov", [bad.link("x")], seed=1, up="fleet")
    rov.store("x", *range(40), "last?")
    rov.until(lambda: rov.stored["link_fleet"][-1]["sent"] + rov.stored["link_fleet"][-1]["dropped"] == 41)
    state = rov.stored["link_fleet"][-1]
    assert 5 < state["dropped"] < 35
    assert len(shore.until_stored("x", state["sent"])) == state["sent"]
    rov.until(lambda: rov.stored["link_fleet"][-1]["rtt_s"] is not None)
    assert rov.stored["link_fleet"][-1]["rtt_s"] >= 0.2


# Joining and leaving


@pytest.mark.slow
def test_killed_process_and_its_successor_are_reported(
    start: Start, process: Callable[..., Process], net: ZenohNet
) -> None:
    shore = start("shore", [net.link("mission")])
    rov = process(net, "rov", "x")
    shore.until_link("fleet")
    rov.kill()
    assert shore.until_link("fleet", up=False)["reason"] == "'rov_node' left."
    shore.store("mission", "come back")
    again = process(net, "rov", "x")
    assert again.until_stored("mission") == ["come back"]
    shore.until_link("fleet")
    again.store("x", 1)
    assert shore.until_stored("x") == [1]


@pytest.mark.slow
def test_killed_listening_node_is_reconnected_after_restart(
    start: Start, process: Callable[..., Process], net: ZenohNet
) -> None:
    rov = start("rov", [joins(net, "x")])
    listens = {"listen": [net.listen[0]], "connect": []}
    shore = process(net, "shore", **listens)
    rov.until_link("fleet")
    shore.kill()
    rov.until_link("fleet", up=False)
    rov.store("x", 1)
    again = process(net, "shore", **listens)
    assert again.until_stored("x") == [1]
    rov.until_link("fleet")


@pytest.mark.wall_clock
@pytest.mark.skipif(os.name == "nt", reason="stops a process, as POSIX does")
def test_hanging_process_delays_neither_a_node_nor_its_end(
    start: Start, process: Callable[..., Process], net: ZenohNet
) -> None:
    shore = start("shore", [net.link("x")])
    rov, friend = process(net, "rov"), process(net, "friend")
    shore.until(lambda: names(shore) == ["friend_node", "rov_node"])
    os.kill(rov.popen.pid, signal.SIGSTOP)
    text = "x" * 1000
    shore.store("x", *([text] * 20_000), "last")  # far more than the system buffers for a peer that does not read
    shore.until(lambda: shore.stored["x"] and shore.stored["x"][-1] == "last")
    shore.until(lambda: names(shore) == ["friend_node"])
    shore.store("x", "after")
    with friend.news:
        assert friend.news.wait_for(lambda: friend.stored.get("x", [""])[-1] == "after", LIMIT_S)
    assert len(friend.stored["x"]) > 10_000  # nearly all, if not all: this machine may be slow, too
    began_s = time.monotonic()
    shore.end()
    assert time.monotonic() - began_s < 3.0  # 0.3 s, plus this machine's load; Zenoh itself takes 6 s and more


@pytest.mark.slow
def test_twenty_links_leave_neither_threads_nor_descriptors_behind(start: Start, net: ZenohNet) -> None:
    def left() -> tuple[int, int]:
        return len(os.listdir("/proc/self/task")), len(os.listdir("/proc/self/fd"))

    shore = start("shore", [net.link("x")])
    counts = []
    for number in range(20):
        rov = start("rov", [joins(net)], up="fleet")
        shore.store("x", number)
        rov.until(lambda number=number, rov=rov: rov.stored["x"] and rov.stored["x"][-1] == number)
        rov.end()
        shore.until_link("fleet", up=False)
        counts.append(left())
    # The counts fluctuate, so compare the minima of each half: if each link left one behind, they would be 10 more.
    for before, after in zip(*(map(min, zip(*half, strict=True)) for half in (counts[:10], counts[10:])), strict=True):
        assert after <= before + 3


# Programs outside of the net


@pytest.mark.slow
def test_non_page_is_counted_as_rejected(start: Start, net: ZenohNet, zenoh_session: Callable[[], Any]) -> None:
    shore = start("shore", [net.link(accept=["x", "y", "last"])], down="fleet")
    session, place = zenoh_session(), "snr/fleet/evil/evil/1"
    page = Page("x", 1, "evil", 0.0).serialize()
    hostile = [
        (f"{place}/page/x", b""),
        (f"{place}/page/x", b"not a page"),
        (f"{place}/page/x", b'{"$":"bytes","data":"="}'),
        (f"{place}/page/x", b"[" * 100_000),
        (f"{place}/page/x", page.replace(b":1,", b":%d," % 10**400)),
        (f"{place}/page/x", page.replace(b":1,", b':{"$":"int","v":"0x%x"},' % 10**5000)),
        (f"{place}/page/x", page[:-1]),
        (f"{place}/page/x", b"\xff" * 1000),
        (f"{place}/page/y", page),  # of another key than in its address
        ("snr/fleet/**", page),  # to all addresses at once
        (f"{place}/more/page/x", page),
        (f"{place}/page/x", Page("x", 1, "shore_node", 0.0).serialize()),  # pretends to be the node's own
        (f"{place}/page/x", Page("x", "x" * (1 << 20), "evil", 0.0).serialize()),  # longer than the limit of pages
    ]
    for key, payload in hostile:
        session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)
    session.put(f"{place}/page/x", page, attachment=b"long" * 1000, congestion_control=zenoh.CongestionControl.BLOCK)
    assert shore.until_stored("x") == [1]
    shore.until(lambda: shore.stored["link_fleet"][-1]["rejected"] >= 10)
    assert shore.stored["y"] == []
    assert shore.stored["link_fleet"][-1]["received"] == 1
    assert shore.failure is None
    friend = start("friend", [joins(net, "last")])
    friend.store("last", True)
    assert shore.until_stored("last") == [True]


@pytest.mark.slow
def test_page_waits_for_one_round_of_a_flood_that_arrived_before_it(
    start: Start, net: ZenohNet, zenoh_session: Callable[[], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    order: list[str] = []
    handlers = {(TaskType.store_page, key): lambda task, task_id: order.append(task.name) for key in ("x", "stick")}
    shore = start("shore", [net.link(accept=["x", "stick"]), FunctionEndpointFactory(handlers)], down="fleet")
    pilot = start("pilot", [joins(net, "stick")], up="fleet")
    link = shore.node.components["link_fleet"]
    monkeypatch.setattr(link, "check_back_pressure", lambda: True)  # nothing is read until all is there
    session, page = zenoh_session(), Page("x", "x" * 1000, "evil", 0.0).serialize()
    for _ in range(2000):
        session.put("snr/fleet/evil/evil/1/page/x", page, congestion_control=zenoh.CongestionControl.BLOCK)
    shore.until(lambda: len(link.transport._inbox) >= 2000)
    pilot.store("stick", 0.5)
    shore.until(lambda: len(link.transport._inbox) >= 2001)
    monkeypatch.undo()
    link.transport.wake()
    assert shore.until_stored("stick") == [0.5]
    assert order.index("stick") < 2 * SHARE_BYTES / len(page)


@pytest.mark.slow
def test_page_far_beyond_the_limit_is_not_stored(start: Start, net: ZenohNet, zenoh_session: Callable[[], Any]) -> None:
    shore = start("shore", [net.link()], down="fleet")
    session, place = zenoh_session(), "snr/fleet/evil/evil/1"
    session.put(f"{place}/page/x", bytes(1 << 26), congestion_control=zenoh.CongestionControl.BLOCK)
    friend = start("friend", [joins(net, "y")])
    friend.store("y", 1)
    assert shore.until_stored("y") == [1]
    assert shore.stored["x"] == []
    assert shore.failure is None


@pytest.mark.slow
def test_listening_node_forwards_only_keys_of_the_net(
    start: Start, net: ZenohNet, zenoh_session: Callable[[], Any]
) -> None:
    start("shore", [net.link()], down="fleet")
    came: list[str] = []
    news = threading.Condition()

    def take(sample: Any) -> None:
        with news:
            came.append(str(sample.key_expr))
            news.notify_all()

    subscriber, publisher = zenoh_session(), zenoh_session()
    for keys in ("**", "foreign/**", "snr/other/**", "snr/fleet/**"):
        subscriber.declare_subscriber(keys, take)

    def has_received_last() -> bool:
        # Repeated, because a subscription takes time to propagate.
        for key in ("foreign/x", "snr/other/a/a/1/page/x", "snr/fleet/a/a/1/page/x"):
            publisher.put(key, b"hello", congestion_control=zenoh.CongestionControl.BLOCK)
        return "snr/fleet/a/a/1/page/x" in came

    with news:
        assert any(has_received_last() or (news.wait(0.1) and has_received_last()) for _ in range(int(LIMIT_S / 0.1)))
    assert set(came) == {"snr/fleet/a/a/1/page/x"}


@pytest.mark.slow
def test_only_nodes_signed_by_the_authority_join_the_net(start: Start, files: dict[str, str]) -> None:
    address = free_address("tls")
    ours = {"authority": files["authority"], "client_authority": files["authority"]}
    shore_tls = Tls(certificate=files["robot_cert"], key=files["robot_key"], **ours)
    shore = start("shore", [ZenohNet(name="fleet", listen=address, tls=shore_tls).link("x")], down="fleet")

    def connects(role: str, **certificates: str) -> Any:
        tls = Tls(**certificates)
        return start(role, [ZenohNet(name="fleet", connect=address, tls=tls).link("y")])

    student = {"client_certificate": files["student_cert"], "client_key": files["student_key"]}
    evil = {"client_certificate": files["evil_cert"], "client_key": files["evil_key"]}
    intruder = connects("intruder", authority=files["authority"], **evil)
    doubter = connects("doubter", authority=files["other_authority"], **student)
    rov = connects("rov", authority=files["authority"], **student)
    rov.until_link("fleet")
    rov.store("y", 1)
    shore.store("x", 2)
    assert shore.until_stored("y") == [1]
    assert rov.until_stored("x") == [2]
    for other in (intruder, doubter):
        other.store("y", "evil")
        assert other.until_link("fleet", up=False)["reason"].startswith(f"waits for {address}: ")
    assert names(shore) == ["rov_node"]
    assert shore.stored["y"] == [1]


@pytest.mark.slow
def test_port_in_use_raises_error_at_begin(start: Start, net: ZenohNet) -> None:
    start("shore", [net.link()]).until_link("fleet", up=False)
    second = start("second", [net.link()])
    second.until(lambda: second.failure)
    assert "The net 'fleet' cannot be opened" in str(second.failure)


@pytest.mark.slow
def test_missing_package_raises_error_with_its_extra(net: ZenohNet, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zenoh", None)
    with pytest.raises(MissingExtraError, match=r"eclipse-zenoh(.|\n)*snr_sim\[zenoh\]"):
        zenoh_link._zenoh()


@pytest.mark.slow
def test_failed_link_is_down_with_the_reason_and_joins_again(start: Start, net: ZenohNet) -> None:
    one = start("one", [net.link("x")])
    other = start("other", [joins(net, "y")])
    for running in (one, other):
        running.until_link("fleet")
        link = running.node.components["link_fleet"]
        transport = link.transport
        transport._deliver_due = lambda way=transport: (way.__dict__.pop("_deliver_due"), 1 / 0)  # once
        running.until(lambda running=running: running.stored["link_fleet"][-1]["failures"] == 1)
        down = next(page for page in running.stored["link_fleet"] if page["failures"] == 1)
        assert not down["up"]
        assert down["reason"] == "'link_fleet' failed and starts again: ZeroDivisionError: division by zero"
        running.until_link("fleet")
        assert link.failures == 1
    one.store("x", 1)
    other.store("y", 2)
    assert other.until_stored("x")[-1] == 1
    assert one.until_stored("y")[-1] == 2
