"""The page `health` over TCP, from any program that sends it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import msgspec
import pytest

from snr_sim import Config, Node, tasks
from snr_sim.links.sockets import SocketsListenerFactory
from snr_sim.prelude.errors import LinkError
from snr_sim.supervision.health import HEALTH, health_of
from snr_sim.supervision.health_link import ask_health, health_link
from snr_sim.testing.function_components import FunctionLoopFactory
from tests.supervision.world import World, group

pytestmark = pytest.mark.slow
WAIT_S = 60.0


@contextmanager
def served(data: Any) -> Iterator[tuple[str, int]]:
    """A node that sends a page of health again and again; its address."""
    server = health_link(("127.0.0.1", 0)).server(HEALTH, accept=())
    assert isinstance(server, SocketsListenerFactory)
    server.claim()
    sends = FunctionLoopFactory(lambda loop: loop.store_data(HEALTH, data), rate_hz=20)
    node = Node("robot", Config(factories={"robot": [server, sends]}))
    thread = threading.Thread(target=node.loop)
    thread.start()
    try:
        yield "127.0.0.1", server.address.port
    finally:
        node.enqueue_input(tasks.terminate("enough"), "test")
        thread.join()


def test_asked_page_is_that_of_the_robot() -> None:
    world = World(group("root", "drive", "gps"))
    world.pet("drive")
    health = health_of(world.tree, {}, 0.0)
    with served(msgspec.to_builtins(health)) as address:
        assert ask_health(address, WAIT_S) == health


@pytest.mark.parametrize("data", [None, {"tree": "all is well"}, [1, 2]])
def test_page_of_another_kind_raises_link_error(data: Any) -> None:
    with (
        served(data) as address,
        pytest.raises(LinkError, match="The page that arrived does not say how processes are"),
    ):
        ask_health(address, WAIT_S)


def test_silence_raises_link_error_with_its_reason() -> None:
    with served(None) as address:
        pass
    with pytest.raises(LinkError, match=rf"No health has arrived from 127.0.0.1:{address[1]} within 0.5 s: waits for"):
        ask_health(address, 0.5)
