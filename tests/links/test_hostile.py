"""Misbehaviour of peers over TCP. None of it blocks or ends the node or fills its memory, and others are served."""

from __future__ import annotations

import gc
import os
import random
import socket
import struct
import threading
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any

import msgspec
import pytest

from snr_sim import Page, PrinterEndpointFactory, SocketsPair, Task, TaskType
from snr_sim.links.frames import encode_frame
from snr_sim.links.link import MAX_TASKS_WAITING
from snr_sim.links.messages import HelloMessage, RefusedMessage, encode_message
from snr_sim.links.streams import READ_BYTES
from snr_sim.testing.function_components import FunctionEndpointFactory
from tests.fuzz_parsers import mutated

from .test_session import HOSTILE

pytestmark = pytest.mark.slow

HERE = "127.0.0.1"
HELLO = encode_frame(encode_message(HelloMessage("snr", 2, "stranger", "0" * 32, "pages", True, 1 << 20)))
Start = Callable[..., Any]
Connect = Callable[..., Any]


@pytest.fixture
def pair() -> SocketsPair:
    return SocketsPair((HERE, 0), name="t")


@pytest.fixture
def robot(start: Start, pair: SocketsPair) -> Any:
    """Start a node that listens, accepts any page and sends its depth."""
    return start("robot", [pair.server("depth")], down="t")


def page(key: str = "x", data: Any = 1, origin: str = "raw") -> bytes:
    return Page(key, data, origin, 0.0).serialize()


def serves(robot: Any, start: Start, pair: SocketsPair) -> bool:
    """Return whether pages of an honest client are exchanged in both directions."""
    honest = start("honest", [pair.client("hi")], up="t")
    honest.store("hi", "there")
    robot.until_stored("hi")
    robot.store("depth", 1.5)
    honest.until(lambda: 1.5 in honest.stored["depth"], "depth")
    return True


SAME = ("HTTP", "a length of 4 GB", "an empty frame", "JSON that is not a page", "NaN", "deep nesting")
NONSENSE = {what: HOSTILE[what] for what in SAME} | {
    "random bytes": b"\x00\x00\x00\x03\xfe\xdc\xba",
    "an integer of 5000 digits": encode_frame(Page("x", 10**5000, "raw", 0.0).serialize()),
}


@pytest.mark.parametrize("greets", [False, True], ids=["unauthenticated", "a peer"])
@pytest.mark.parametrize("what", NONSENSE)
def test_invalid_data_is_refused_with_a_reason(
    robot: Any, start: Start, pair: SocketsPair, raw: Connect, what: str, greets: bool
) -> None:
    far = raw(pair.port, greets)
    if greets:
        far.messages(until=HelloMessage)
    far.sock.sendall(NONSENSE[what])
    last = far.messages()[-1]
    assert isinstance(last, RefusedMessage)
    assert last.reason
    assert serves(robot, start, pair)


@pytest.mark.parametrize(
    "data", [{"$": "int", "v": hex(10**5000)}, *({"a": [10**digits]} for digits in (20, 400, 4299))], ids=lambda _: ""
)
def test_long_integer_does_not_end_a_printer(start: Start, pair: SocketsPair, raw: Connect, data: Any) -> None:
    printer = PrinterEndpointFactory([(TaskType.process_data, "x"), TaskType.store_page], StringIO())
    robot = start("robot", [pair.server("depth"), printer], down="t")
    far = raw(pair.port)
    far.messages(until=HelloMessage)
    far.sock.sendall(encode_frame(page("x", 1).replace(b":1,", b":%s," % msgspec.json.encode(data))))
    assert isinstance(far.messages()[-1], RefusedMessage)
    assert robot.until_link("t", up=False, rejected=1)
    assert serves(robot, start, pair)
    assert robot.failure is None


def test_other_protocol_version_is_refused_with_the_reason(robot: Any, pair: SocketsPair, raw: Connect) -> None:
    assert "version 2, the other end snr version 7" in raw(pair.port, version=7).messages()[-1].reason


@pytest.mark.nightly(minutes=1)
def test_thousands_of_random_connections_leave_no_growth(robot: Any, start: Start, pair: SocketsPair) -> None:
    rng, seeds = random.Random(1), [HELLO + encode_frame(page("x", [1, {"a": 2.5}])), encode_frame(page()), b"\0" * 9]

    def connect(count: int) -> int:
        """Return the memory in use after so many connections with damaged frames."""
        for _ in range(count):
            with socket.create_connection((HERE, pair.port), 60.0) as far, suppress(OSError):
                if rng.random() < 0.3:
                    far.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # ends by a reset
                far.sendall(mutated(rng, seeds, 3000))
                far.recv(1 << 16)
        robot.stored.clear()
        gc.collect()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        before = connect(500)
        growth = connect(4000) - before
    finally:
        tracemalloc.stop()
    assert growth < 100_000, growth
    assert serves(robot, start, pair)
    assert robot.failure is None


def test_key_of_a_megabyte_is_rejected(robot: Any, pair: SocketsPair, raw: Connect) -> None:
    far = raw(pair.port)
    far.send(page("k" * 1_000_000), page("", 1), page("good", 2))
    robot.until_stored("good")
    assert robot.until_link("t", rejected=2)["up"]
    assert set(robot.stored) == {"good", "link_t"}


def test_keys_not_in_accept_are_rejected(start: Start, raw: Connect) -> None:
    pair = SocketsPair((HERE, 0), name="t")
    robot = start("robot", [pair.server(accept=["controller_input"])], down="t")
    raw(pair.port).send(page("motor"), page("controller_input"))
    robot.until_stored("controller_input")
    assert "motor" not in robot.stored


@pytest.mark.parametrize("how", ["silence", "half a greeting", "half a frame", "a drip"])
def test_silent_peer_is_closed_after_the_timeout(start: Start, raw: Connect, how: str) -> None:
    pair = SocketsPair((HERE, 0), name="t", timeout_s=0.3, keep_alive_s=0.1)
    robot = start("robot", [pair.server("depth")], down="t")
    far = raw(pair.port, greets=how == "half a frame")
    if how == "half a greeting":
        far.sock.sendall(b"\x00\x00\x00\xff{")
    elif how == "half a frame":
        robot.until_link("t")
        far.sock.sendall(encode_frame(page())[:10])
    elif how == "a drip":
        far.sock.sendall(b"\x00")
    far.messages()  # reads to the end of the stream
    reason = "nothing was heard" if how == "half a frame" else "the greeting was not completed"  # plain: hear
    robot.until(lambda: reason in robot.stored["link_t"][-1]["reason"], reason)


def test_resetting_peer_takes_the_link_down_and_keeps_the_node(
    robot: Any, start: Start, pair: SocketsPair, raw: Connect
) -> None:
    far = raw(pair.port)
    robot.until_link("t")
    far.reset()
    robot.store("depth", 1, 2, 3)
    robot.until_link("t", up=False)
    assert serves(robot, start, pair)


def test_non_reading_peer_uses_only_its_queue_and_delays_no_peer(start: Start, raw: Connect) -> None:
    pair = SocketsPair((HERE, 0), name="t", queue_pages=10)
    robot = start("robot", [pair.server("depth")], down="t")
    raw(pair.port)
    robot.until_link("t")
    text = "x" * 500_000
    for _ in range(60):  # more than any socket buffer holds
        robot.store("depth", text)
    robot.until_stored("depth", 60)
    honest = start("honest", [pair.client("hi")], up="t")
    honest.store("hi", 1)
    robot.until_stored("hi")
    peers = robot.until_link("t", up=True)["peers"]
    assert peers["raw"]["waiting"] <= 10
    robot.until(lambda: robot.stored["link_t"][-1]["peers"].get("raw", {}).get("dropped", 0) > 10, "drops")


def test_two_peers_with_one_name_are_both_served(robot: Any, pair: SocketsPair, raw: Connect) -> None:
    one, other = raw(pair.port, node="twin"), raw(pair.port, node="twin")
    robot.until(lambda: set(robot.stored["link_t"][-1]["peers"]) == {"twin", "twin#2"}, "both")
    robot.store("depth", 1.5)
    for far in (one, other):
        assert far.messages(until=Page)[-1].data == 1.5


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="counts descriptors in /proc")
def test_thousand_connections_leak_no_descriptors(robot: Any, start: Start, pair: SocketsPair, raw: Connect) -> None:
    assert serves(robot, start, pair)
    before = len(os.listdir("/proc/self/fd"))
    for i in range(1000):
        with socket.create_connection((HERE, pair.port), 30) as sock:
            if i % 3 == 1:
                sock.sendall(b"GET /")
            elif i % 3 == 2:
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")
    raw(pair.port, node="last")
    robot.until(lambda: "last" in robot.stored["link_t"][-1]["peers"], "the last, so all before it were accepted")
    robot.until(lambda: len(os.listdir("/proc/self/fd")) <= before + 5, "unauthenticated clients are gone")


def test_silent_unauthenticated_clients_do_not_block_an_honest_client(
    robot: Any, start: Start, pair: SocketsPair, raw: Connect
) -> None:
    for _ in range(200):
        raw(pair.port, greets=False)
    assert serves(robot, start, pair)


def flood(port: int, count: int, seed: int) -> None:
    """Open connections to a port, and send random bytes, close or reset some of them, in random order."""
    rng, held = random.Random(seed), list[socket.socket]()
    for _ in range(count):
        held.append(socket.create_connection((HERE, port), 30))
        for _ in range(rng.randrange(3)):
            sock = rng.choice(held)
            act = rng.choice(("send", "send", "close", "reset"))
            try:
                if act == "send":
                    sock.sendall(rng.choice((rng.randbytes(rng.randrange(1, 100)), HELLO)))
                    continue
            except OSError:
                pass  # the server has closed it
            if act == "reset":
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            sock.close()
            held.remove(sock)
            if not held:
                break
    for sock in held:
        sock.close()


def test_flood_of_connections_without_secret_keeps_the_node(start: Start) -> None:
    pair = SocketsPair((HERE, 0), name="t", secret="a secret of 16 bytes or more")
    robot = start("robot", [pair.server("depth")], down="t")
    for seed in range(3):
        flood(pair.port, 400, seed)
    assert serves(robot, start, pair)
    assert robot.failure is None


def until_paused(robot: Any) -> None:
    """Wait until the link is paused; the node itself is busy, so no page can report it."""
    link, pause = robot.node.components["link_t"], threading.Event()
    for _ in range(3000):
        if link.is_paused:
            return
        pause.wait(0.01)
    raise AssertionError("the link never stopped reading")


def test_weakness_16_flood_waits_at_its_sender_and_arrives_in_order(start: Start, raw: Connect) -> None:
    pair = SocketsPair((HERE, 0), name="t")
    gate = threading.Event()
    came: list[int] = []

    def slow(task: Task, task_id: Any) -> None:
        gate.wait(30)
        came.append(task.val_list[0].data)

    robot = start(
        "robot", [pair.server(), FunctionEndpointFactory({(TaskType.store_page, "x"): slow}, "slow")], down="t"
    )
    far = raw(pair.port)
    count = 60_000
    flood = threading.Thread(target=lambda: far.send(*(page("x", i) for i in range(count))))
    flood.start()
    machine = robot.node.machine
    until_paused(robot)
    max_tasks = MAX_TASKS_WAITING + READ_BYTES // len(encode_frame(page("x", 0)))
    assert machine.queued <= max_tasks
    gate.set()
    robot.until(lambda: len(came) == count, "the flood")
    flood.join(30)
    assert came == list(range(count))
    assert machine.longest_queue <= max_tasks + 100
    assert far.sock.fileno() > 0


def test_flood_of_large_pages_is_limited_by_bytes(start: Start, raw: Connect) -> None:
    pair = SocketsPair((HERE, 0), name="t")
    gate = threading.Event()

    def slow(task: Task, task_id: Any) -> None:
        gate.wait(30)

    robot = start(
        "robot", [pair.server(), FunctionEndpointFactory({(TaskType.store_page, "x"): slow}, "slow")], down="t"
    )
    far = raw(pair.port)
    large = page("x", "y" * 1_000_000)
    flood = threading.Thread(target=lambda: [far.send(large) for _ in range(150)])
    flood.start()
    until_paused(robot)
    assert robot.node.machine.queued < 80
    robot.stored.clear()
    gate.set()
    flood.join(30)
    assert not flood.is_alive()
