"""The server's routes for any pages: a list of them, each with its own file and connection."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from snr_sim.web import server
from snr_sim.web.access import Access
from snr_sim.web.messages import Rights
from snr_sim.web.server import make_app
from snr_sim.web.session import Send

ACCESS = Access("127.0.0.1", 8080)


class Echo:
    """A page that sends back what it receives, and the rights with which it was opened."""

    shell = "echo.html"

    def __init__(self, path: str, title: str) -> None:
        self.path, self.title, self.closed = path, title, 0

    def open(self, rights: Rights, send: Send) -> Echo:
        self.send = send
        send(rights.encode())
        return self

    def receive(self, data: str | bytes) -> None:
        self.send(str(data).encode())

    def close(self, session: object) -> None:
        self.closed += 1

    def tick(self, now_s: float) -> None:
        raise AssertionError("the server's task calls it")

    def gone(self, reason: str) -> None:
        raise AssertionError("the server's end calls it")

    def goodbye(self, reason: str) -> bytes:
        return reason.encode()


def request(path: str, *pages: Echo) -> tuple[int, dict[str, str], str]:
    sent: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return {"type": "http.request"}

    asyncio.run(call("http", path, pages, receive, sent))
    headers = {key.decode(): value.decode() for key, value in sent[0]["headers"]}
    return sent[0]["status"], headers, b"".join(one.get("body", b"") for one in sent[1:]).decode()


async def call(
    kind: str, path: str, pages: tuple[Echo, ...], receive: Callable[[], Awaitable[Any]], sent: list[dict[str, Any]]
) -> None:
    async def send(message: Any) -> None:
        sent.append(message)

    await make_app(pages, ACCESS)(scope_of(kind, path), receive, send)


def scope_of(kind: str, path: str) -> dict[str, Any]:
    headers = {"host": ACCESS.netloc, "origin": ACCESS.origin, "cookie": f"{ACCESS.cookie}={ACCESS.token}"}
    return {
        "type": kind, "path": path, "query_string": b"", "method": "GET", "root_path": "", "scheme": "http",
        "headers": [(key.encode(), value.encode()) for key, value in headers.items()],
    }  # fmt: skip


def test_several_pages_are_listed_with_their_titles() -> None:
    status, _, text = request("/", Echo("machine/a", "a & <b>"), Echo("robots", "all robots"))
    assert status == 200
    assert '<a href="/machine/a/">a &amp; &lt;b&gt;</a>' in text
    assert '<a href="/robots/">all robots</a>' in text


def test_only_page_is_opened_at_once() -> None:
    status, headers, _ = request("/", Echo("robots", "all robots"))
    assert (status, headers["location"]) == (303, "/robots/")


def test_missing_file_of_a_page_is_named() -> None:
    status, _, text = request("/robots/", Echo("robots", "all robots"))
    assert (status, text) == (404, "echo.html is missing.")


def test_connection_is_served_by_its_page_until_it_ends() -> None:
    one, other = Echo("machine/a", "a"), Echo("robots", "all robots")
    sent: list[dict[str, Any]] = []
    coming = [{"type": "websocket.connect"}, {"type": "websocket.receive", "text": "hello"}]

    async def receive() -> dict[str, Any]:
        if coming:
            return coming.pop(0)
        while len(sent) < 3:
            await asyncio.sleep(0)
        return {"type": "websocket.disconnect", "code": 1001}

    asyncio.run(call("websocket", "/robots/socket", (one, other), receive, sent))
    assert [message.get("text") for message in sent] == [None, "change", "hello"]
    assert (one.closed, other.closed) == (0, 1)


def test_browser_that_reads_nothing_is_hung_up_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """What waits for it is bounded; then its session is closed, and its page is not sent more."""
    monkeypatch.setattr(server, "CLOSE_TIMEOUT_S", 0.01)
    page = Echo("robots", "all robots")
    accepted = asyncio.Event()

    async def receive() -> dict[str, Any]:
        if not accepted.is_set():
            return {"type": "websocket.connect"}
        return {"type": "websocket.receive", "text": "more"}

    async def send(message: Any) -> None:
        if message["type"] != "websocket.accept":
            await asyncio.Event().wait()  # its buffers are full
        accepted.set()

    async def serve() -> None:
        async with asyncio.timeout(10.0):
            await make_app([page], ACCESS)(scope_of("websocket", "/robots/socket"), receive, send)

    asyncio.run(serve())
    assert page.closed == 1


def test_unknown_page_has_no_connection() -> None:
    sent: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return {"type": "websocket.connect"}

    asyncio.run(call("websocket", "/nowhere/socket", (Echo("robots", "all robots"),), receive, sent))
    assert [message["type"] for message in sent] == ["websocket.close"]
