"""Links over TCP, on this machine's own address, each with a free port."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from typing import Any

import pytest

from snr_sim import SocketsPair, TaskType, tasks
from snr_sim.links.restarting import error_text
from snr_sim.links.tcp_client import Connector, connect
from snr_sim.testing.function_components import FunctionEndpointFactory

from .conftest import free_port, simulate, ticks

HERE = "127.0.0.1"


@pytest.mark.slow
@pytest.mark.parametrize("order", ["robot first", "topside first"])
def test_weakness_9_two_way_links_start_in_either_order(start: Callable[..., Any], order: str) -> None:
    down, up = SocketsPair((HERE, free_port()), name="down"), SocketsPair((HERE, free_port()), name="up")
    roles = {
        "topside": [down.client("controller_input"), up.server()],
        "robot": [down.server(), up.client(["depth"])],
    }
    names = ["robot", "topside"] if order == "robot first" else ["topside", "robot"]
    first = start(names[0], roles[names[0]], down="down")
    running = {names[0]: first, names[1]: start(names[1], roles[names[1]])}
    for node in running.values():
        node.until_link("down")
        node.until_link("up")
    running["topside"].store("controller_input", {"axis": 0.5})
    running["robot"].store("depth", 1.5)
    assert running["robot"].until_stored("controller_input") == [{"axis": 0.5}]
    assert running["topside"].until_stored("depth") == [1.5]


def test_config_runs_in_lock_step_without_sockets() -> None:
    pair = SocketsPair((HERE, 1), name="tether")
    runner = simulate({"robot": [ticks("x"), pair.client("x")], "topside": [pair.server()]}, until_s=1.95)
    assert runner.nodes["topside"].get_data("x") == 19
    assert runner.nodes["topside"].get_data("link_tether")["received"] >= 10


@pytest.mark.slow
def test_busy_node_receives_pages_of_its_links(start: Callable[..., Any]) -> None:
    """A node reads its links while it waits in its inbox; if it never waits, the link's thread reads them."""
    pair = SocketsPair(("127.0.0.1", 0), name="wire")
    busy = FunctionEndpointFactory({(TaskType.event, "again"): lambda task, task_id: tasks.event("again")}, "busy")
    server = start("server", [pair.server(), busy], down="wire")
    server.node.schedule(tasks.event("again"))
    client = start("client", [pair.client("depth")], up="wire")
    client.store("depth", *range(2_000))
    assert server.until_stored("depth", 2_000) == list(range(2_000))


@pytest.mark.slow
def test_long_handler_keeps_the_link_up(start: Callable[..., Any]) -> None:
    """The link's thread keeps it alive meanwhile: for longer than the peer's limit of silence."""
    pair = SocketsPair(("127.0.0.1", 0), name="wire", keep_alive_s=0.05, timeout_s=1.0)
    done = threading.Event()
    slow = FunctionEndpointFactory(
        {(TaskType.process_data, "depth"): lambda task, task_id: done.wait(30.0) and None}, "slow"
    )
    start("server", [pair.server(), slow], down="wire")
    client = start("client", [pair.client("depth")], up="wire")
    client.store("depth", 1)
    reports = len(client.stored["link_wire"])
    client.until(lambda: len(client.stored["link_wire"]) >= reports + 3, "three reports, one a second")
    done.set()
    assert all(report["up"] for report in client.stored["link_wire"][reports:])


@pytest.mark.parametrize("error", [OSError(1, "broken"), UnicodeError("a name"), RuntimeError("a bug"), MemoryError()])
def test_connector_returns_an_error_of_any_type(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def fail(host: str, port: int) -> socket.socket:
        raise error

    notified: list[None] = []
    calls = Connector(lambda: notified.append(None))
    monkeypatch.setattr("snr_sim.links.tcp_client.connect", fail)
    calls._connect(HERE, 1)
    assert calls.results.get_nowait() == error_text(error)
    assert notified


@pytest.mark.slow
def test_invalid_server_name_keeps_the_client_reconnecting(
    start: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*args: object) -> None:
        "".join(["x" * 70]).encode("idna")

    monkeypatch.setattr("snr_sim.links.tcp_client.SocketPort", refuse)
    with socket.create_server((HERE, 0)) as server:
        client = start("client", [SocketsPair(server.getsockname(), name="t").client("depth")])
        client.until(lambda: any("label" in report["reason"] for report in client.stored["link_t"]))
        assert client.stored["link_t"][-1]["failures"] == 0


@pytest.mark.slow
def test_connection_to_itself_raises_connection_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def call_oneself(address: tuple[str, int], timeout_s: float) -> socket.socket:
        sock = socket.socket()
        sock.bind((HERE, 0))
        sock.connect(sock.getsockname())  # as happens to a client by chance when both ports are the same
        return sock

    monkeypatch.setattr(socket, "create_connection", call_oneself)
    with pytest.raises(ConnectionRefusedError, match="no server is listening"):
        connect(HERE, 1)
