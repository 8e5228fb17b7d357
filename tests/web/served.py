"""A node with a live page on a thread of this process, and a client of the page."""

from __future__ import annotations

import http.client
import json
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from snr_sim import Config, Node
from snr_sim.web.access import Access
from snr_sim.web.live import LiveLoopFactory
from tests.on_thread import TIMEOUT_S, on_thread, wait_for
from tests.web.dive import parts


@contextmanager
def served(*more: Any, token: str | None = None, folder: Path | None = None) -> Iterator[tuple[Node, LiveLoopFactory]]:
    """Run a diver with a live page until the block ends; it must run until then."""
    live = LiveLoopFactory(token=token, title="a dive")
    live.folder = folder
    node = Node("r", Config(factories={"r": [live, *parts(*more)]}))
    with on_thread(node, lambda: live.port != 0):
        yield node, live


def get(access: Access, path: str, **headers: str) -> tuple[int, dict[str, str], str]:
    """Return status, headers and text of a page."""
    connection = http.client.HTTPConnection(access.host, access.port, timeout=TIMEOUT_S)
    try:
        connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
        answer = connection.getresponse()
        return answer.status, {key.lower(): value for key, value in answer.getheaders()}, answer.read().decode()
    finally:
        connection.close()


class Client:
    """A browser's WebSocket."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.received: list[dict[str, Any]] = []

    def send(self, kind: str, **fields: Any) -> None:
        self.socket.send(json.dumps({"kind": kind, **fields}))

    def receive(self) -> dict[str, Any]:
        message = json.loads(self.socket.recv(timeout=TIMEOUT_S))
        assert isinstance(message, dict)
        self.received.append(message)
        return message

    def wait(self, kind: str, is_meant: Callable[[dict[str, Any]], bool] = lambda message: True) -> dict[str, Any]:
        """Return the next message of a kind that is meant."""
        until_s = time.monotonic() + TIMEOUT_S
        while time.monotonic() < until_s:
            message = self.receive()
            if message["kind"] == kind and is_meant(message):
                return message
        raise AssertionError(f"no {kind}")


@contextmanager
def browser(access: Access, token: str = "", *, name: str = "diver", **options: Any) -> Iterator[Client]:
    """Connect as a page of the server does; options replace what it sends."""
    cookie = options.pop("cookie", f"{access.cookie}={token or access.token}")
    host = options.pop("host", None)
    headers = {"Cookie": cookie} if cookie else {}
    address = f"ws://{host or access.netloc}/machine/{name}/socket"
    given = {"origin": access.origin, "compression": None, "open_timeout": TIMEOUT_S, "proxy": None, **options}
    given["sock"] = socket.create_connection((access.host, access.port))  # whatever name is in the address
    with connect(address, additional_headers=headers, max_size=None, **given) as connected:
        yield Client(connected)


def goes_on(node: Node) -> None:
    """The robot takes its steps, and its page can be opened."""
    steps = node.machine.executed
    wait_for(lambda: node.machine.executed > steps + 20)
    assert not node.is_finished


def last_words(page: Client) -> str:
    """Return the reason in the last message, and wait for the end."""
    reason = ""
    with suppress(ConnectionClosed):
        while True:
            message = page.receive()
            if message["kind"] == "gone":
                reason = message["reason"]
    return reason
