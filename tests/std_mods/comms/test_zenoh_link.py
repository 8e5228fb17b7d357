"""Links over Zenoh, on this machine's own address: nodes on threads here, and in processes where that matters."""

from __future__ import annotations

import socket
from collections.abc import Callable
from typing import Any

import pytest

from snr_sim import Config, SimRunner, ZenohNet
from snr_sim.testing.parts import TickerFactory

zenoh = pytest.importorskip("zenoh")  # part of snr_sim[dev]

Start = Callable[..., Any]


def free_address() -> str:
    """An address that nobody has just now."""
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{sock.getsockname()[1]}"


@pytest.fixture
def net() -> ZenohNet:
    return ZenohNet(name="fleet", listen=free_address())


def joins(net: ZenohNet, keys: Any = (), **options: Any) -> Any:
    """A link that connects to where the net's first node listens."""
    return net.link(keys, listen=(), connect=[net.listen[0].text], **options)


def test_pages_go_both_ways_and_either_node_starts_first(start: Start, net: ZenohNet) -> None:
    rov = start("rov", [joins(net, "depth")])
    assert rov.until_link("fleet", up=False)["reason"] == "nobody else is in the net."
    rov.store("depth", 1.5)  # before anybody hears it
    shore = start("shore", [net.link("mission")])
    assert list(shore.until_link("fleet")["peers"]) == ["rov_node"]
    assert list(rov.until_link("fleet")["peers"]) == ["shore_node"]
    shore.store("mission", {"dive": True})
    assert rov.until_stored("mission") == [{"dive": True}]
    assert shore.until_stored("depth") == [1.5]


def test_nodes_that_only_connect_hear_each_other_through_the_one_that_listens(start: Start, net: ZenohNet) -> None:
    shore = start("shore", [net.link()])
    a, b = start("a", [joins(net, "x")]), start("b", [joins(net, "y")])
    a.until(lambda: len(a.until_link("fleet")["peers"]) == 2)
    b.until(lambda: len(b.until_link("fleet")["peers"]) == 2)
    a.store("x", 1)
    b.store("y", 2)
    assert b.until_stored("x") == [1]
    assert a.until_stored("y") == [2]
    assert shore.until_stored("x") == [1]
    b.end()
    a.until(lambda: list(a.until_link("fleet")["peers"]) == ["shore_node"])


def test_who_comes_late_hears_the_newest_of_each_key_and_nobody_hears_it_twice(start: Start, net: ZenohNet) -> None:
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


def test_ten_thousand_pages_arrive_in_order(start: Start, net: ZenohNet) -> None:
    rov = start("rov", [net.link("x")])
    shore = start("shore", [joins(net)])
    rov.until_link("fleet")
    rov.store("x", *range(10_000))
    assert shore.until_stored("x", 10_000) == list(range(10_000))


def test_the_same_config_runs_in_lock_step_without_zenoh() -> None:
    net = ZenohNet(name="fleet", listen="tcp/127.0.0.1:7447")
    values = iter(range(100))
    config = Config(
        factories={
            "a": [TickerFactory(lambda loop: loop.store_data("x", next(values)), rate_hz=10), net.link("x")],
            "b": [net.link("y")],
            "c": [net.link(accept=["y"])],
        }
    )
    runner = SimRunner(config, until_s=1.95)
    runner.run()
    assert runner.nodes["b"].get_data("x") == 19
    assert runner.nodes["c"].get_data("x") is None
    state = runner.nodes["a"].get_data("link_fleet")
    assert state["up"]
    assert sorted(state["peers"]) == ["b_node", "c_node"]
    assert runner.nodes["c"].get_data("link_fleet")["unwanted"] >= 10
