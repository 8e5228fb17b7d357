"""Failures of links of the 2021 library when they were tried, one test each: none of them occurs here.

Weakness 9 is in test_sockets.py, 15 in test_frames.py, 16 in test_hostile.py.
"""

from __future__ import annotations

import socket
import statistics
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from snr_sim import Page, SocketsPair, Task, TaskType
from snr_sim.links.frames import encode_frame
from snr_sim.prelude.errors import ConfigError
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

from .conftest import simulate

HERE = "127.0.0.1"
Start = Callable[..., Any]
Connect = Callable[..., Any]


@pytest.fixture
def pair() -> SocketsPair:
    return SocketsPair((HERE, 0), name="t", max_frame_bytes=1 << 23, queue_pages=100_000)


@pytest.fixture
def robot(start: Start, pair: SocketsPair) -> Any:
    return start("robot", [pair.server("depth")], down="t")


@pytest.mark.slow
def test_weakness_6_flood_of_pages_arrives_in_order(start: Start, robot: Any, pair: SocketsPair) -> None:
    client = start("client", [pair.client("x")], up="t")
    for value in range(20_000):
        client.node.store_data("x", value, False)
    robot.until(lambda: robot.stored["x"] and robot.stored["x"][-1] == 19_999, "the last")
    assert robot.stored["x"] == list(range(20_000))


@pytest.mark.slow
def test_weakness_7_page_of_5_mb_arrives_with_a_raised_limit(start: Start, robot: Any, pair: SocketsPair) -> None:
    client = start("client", [pair.client("x")], up="t")
    numbers = [i / 7 for i in range(300_000)]
    client.store("x", numbers)
    assert robot.until_stored("x") == [numbers]
    assert len(Page("x", numbers, "", 0.0).serialize()) > 5_000_000


@pytest.mark.slow
def test_weakness_7_page_beyond_the_limit_raises_error_at_the_sender(start: Start, pair: SocketsPair) -> None:
    small = SocketsPair((HERE, 9), name="small")
    client = start("client", [small.client("photo")])
    client.store("photo", "x" * (1 << 20))
    client.thread.join(30)
    text = str(client.failure)
    assert "more than a frame of this link may hold (1048576)" in text
    assert "raise max_frame_bytes" in text
    assert "store_page 'photo'" in text


@pytest.mark.slow
def test_weakness_7_page_beyond_the_peers_limit_is_counted_as_dropped(
    start: Start, robot: Any, pair: SocketsPair, raw: Connect
) -> None:
    far = raw(pair.port, max_frame_bytes=1000)
    robot.until_link("t")
    robot.store("depth", "x" * 2000, "short")
    assert far.messages(until=Page)[-1].data == "short"
    assert robot.until_link("t", dropped=1)["up"]


@pytest.mark.wall_clock
def test_weakness_8_round_trip_does_not_wait_for_acknowledgement(start: Start, pair: SocketsPair) -> None:
    def answer(task: Task, task_id: Any) -> Task:
        return robot.node.store_data_task("pong", task.val_list[0].data)

    robot = start("robot", [pair.server("pong"), FunctionEndpointFactory({(TaskType.store_page, "ping"): answer})])
    client = start("client", [pair.client("ping")], up="t")
    times_s = []
    for i in range(30):
        start_s = time.perf_counter()
        client.store("ping", i)
        client.until_stored("pong", i + 1)
        times_s.append(time.perf_counter() - start_s)
    assert statistics.median(times_s) < 0.03  # Nagle's algorithm and a delayed acknowledgement cost 0.04
    for node in (robot, client):
        (stream,) = node.node.components["link_t"].transport.streams
        assert stream.port._sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) != 0


@pytest.mark.slow
def test_weakness_10_connecting_and_closing_clients_keep_the_node(robot: Any, pair: SocketsPair) -> None:
    for _ in range(2):
        both = [socket.create_connection((HERE, pair.port), 30) for _ in range(2)]
        for sock in both:
            sock.close()
    robot.store("depth", 1)
    robot.until_stored("depth")
    assert robot.failure is None
    assert robot.thread.is_alive()


@pytest.mark.slow
def test_weakness_11_server_listens_at_its_host_only(robot: Any, pair: SocketsPair) -> None:
    assert robot.node.components["link_t"].transport._listener.getsockname()[0] == HERE
    with pytest.raises(OSError, match=r"."):
        socket.create_connection(("127.0.0.2", pair.port), 5)


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.2.2", "robot.local", "::"])
def test_weakness_11_server_open_to_any_client_raises_config_error(host: str) -> None:
    pair = SocketsPair((host, 9120))
    with pytest.raises(ConfigError, match=r"any computer in that network could steer(.|\n)*secret=(.|\n)*allow="):
        pair.server()
    pair.client("x")
    SocketsPair((host, 9120), secret="0123456789abcdef").server()
    SocketsPair((host, 9120), allow=["192.168.2.0/24"]).server()


@pytest.mark.slow
def test_weakness_13_second_client_keeps_the_first_connected(start: Start, robot: Any, pair: SocketsPair) -> None:
    first = start("first", [pair.client("one")], up="t")
    second = start("second", [pair.client("two")])
    robot.until(lambda: len(robot.stored["link_t"][-1]["peers"]) == 2, "both")
    robot.store("depth", 1.5)
    first.until_stored("depth")
    second.until_stored("depth")
    second.end()
    robot.until(lambda: set(robot.stored["link_t"][-1]["peers"]) == {"first_node"}, "one left")
    robot.store("depth", 2.5)
    assert first.until_stored("depth", 2) == [1.5, 2.5]
    first.store("one", 1)
    assert robot.until_stored("one") == [1]


@pytest.mark.slow
def test_weakness_14_key_sent_in_both_directions_does_not_echo(start: Start, pair: SocketsPair) -> None:
    robot = start("robot", [pair.server(["x", "end"])])
    client = start("client", [pair.client(["x", "end"])], up="t")
    client.store("x", "from the client")
    robot.until_stored("x")
    robot.store("x", "from the robot")
    client.until_stored("x", 2)
    # echoed pages would arrive before these, on the same streams
    robot.store("end", 1)
    client.until_stored("end")
    client.store("end", 2)
    robot.until_stored("end", 2)
    assert client.stored["x"] == robot.stored["x"] == ["from the client", "from the robot"]


def test_weakness_14_page_crosses_each_link_of_a_mesh_at_most_once() -> None:
    names = ["a", "b", "c", "d"]
    pairs = {(i, j): SocketsPair((HERE, 1), name=f"{i}{j}") for i in names for j in names if i < j}
    stored: list[str] = []
    factories: dict[str, list[Any]] = {name: [] for name in names}
    for name in names:
        keeps = {(TaskType.store_page, "x"): lambda task, task_id, name=name: stored.append(name)}
        factories[name] = [pair.server("x") for (server, _), pair in pairs.items() if server == name]
        factories[name] += [pair.client("x") for (_, client), pair in pairs.items() if client == name]
        factories[name].append(FunctionEndpointFactory(keeps))  # type: ignore[arg-type]
    factories["a"].append(FunctionLoopFactory(lambda loop: (loop.store_data("x", 1), loop.stop())))
    simulate(factories, until_s=20.0)
    assert set(stored) == set(names)
    assert len(stored) <= 1 + 2 * len(pairs)


@pytest.mark.slow
def test_payload_in_many_segments_is_one_page(robot: Any, pair: SocketsPair, raw: Connect) -> None:
    far = raw(pair.port)
    robot.until_link("t")
    for byte in encode_frame(Page("x", [1, 2, 3], "raw", 0.0).serialize()):
        far.sock.sendall(bytes([byte]))
    assert robot.until_stored("x") == [[1, 2, 3]]


@pytest.mark.slow
def test_port_in_use_raises_error_with_the_port(start: Start, robot: Any, pair: SocketsPair) -> None:
    other = start("other", [SocketsPair((HERE, pair.port)).server()])
    other.thread.join(30)
    text = str(other.failure)
    assert f"cannot listen on 127.0.0.1 port {pair.port}: Address already in use" in text
    assert f"grep {pair.port}" in text


@pytest.mark.slow
def test_client_reconnects_to_a_restarted_server(start: Start) -> None:
    pair = SocketsPair((HERE, 0), name="t")
    robot = start("robot", [pair.server()], down="t")
    client = start("client", [pair.client("x")], up="t")
    robot.end()
    assert "left" in client.until_link("t", up=False)["reason"]
    client.store("x", 1, 2, 3)
    client.until_stored("x", 3)
    again = start("robot", [pair.server()])
    client.until_link("t")
    assert again.until_stored("x") == [3]  # the newest page stored without a peer
    assert client.until_link("t", dropped=2)


@pytest.mark.slow
def test_unresolvable_host_is_reported_and_retried_without_blocking(
    start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    hang = threading.Event()

    def resolve(*args: Any, **kwargs: Any) -> Any:
        hang.wait(30)
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", resolve)
    client = start("client", [SocketsPair(("robot.invalid", 9120), name="t").client("x")])
    client.store("x", 1)
    client.until_stored("x")
    client.until_link("t", up=False)
    hang.set()
    client.until(lambda: "robot.invalid:9120: Name or" in client.stored["link_t"][-1]["reason"], "the reason")
    hang.clear()
    start_s = time.monotonic()
    client.end()
    assert time.monotonic() - start_s < 5  # it hangs for 30
    hang.set()
