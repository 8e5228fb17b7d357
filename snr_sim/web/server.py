"""Serves pages on a socket until it is to end. The only module that imports Starlette and uvicorn.

    /                  the page, if there is one only; otherwise their list
    /<path>/           the HTML file of a page
    /<path>/socket     its WebSocket; of programs that need no page: /
    /static/<file>     scripts and styles

Every page has the same access (`access.py`); a page is added by adding it to the list.
"""

from __future__ import annotations

import asyncio
import socket
import time
from collections import deque
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from html import escape
from pathlib import Path
from typing import Any, TypeAlias

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState
from uvicorn.protocols.http.h11_impl import H11Protocol

from snr_sim.links.newcomers import largest_group, source_of
from snr_sim.web.access import Access, AccessCheck, App
from snr_sim.web.messages import MAX_MESSAGE_BYTES, HungUpError
from snr_sim.web.ros_session import RosbridgePage
from snr_sim.web.session import MachinePage

TICK_PERIOD_S = 1.0 / 30.0

MAX_REQUESTS = 128  # at once; beyond it, status 503
MAX_IDLE = 64  # connections that request nothing: each takes a descriptor of the robot's process
LAST_WORDS_S = 0.05  # for the last messages to leave
STATIC = Path(__file__).with_name("static")
MAX_CONNECTIONS = 32  # of all pages
MAX_WAITING = 64  # messages that a browser has not read
SEND_TIMEOUT_S = 10.0
CLOSE_TIMEOUT_S = 1.0
ServedPage: TypeAlias = MachinePage | RosbridgePage
Answer: TypeAlias = Callable[[Request], Awaitable[Response]]
POLICY_VIOLATION = 1008  # RFC 6455, section 7.4.1


def make_app(pages: Sequence[ServedPage], access: Access, static: Path = STATIC) -> App:
    """Return the application that serves pages.

    Args:
        pages: what it serves.
        access: who may use it.
        static: folder of the HTML files, scripts and styles.
    """
    connections: set[_Connection] = set()
    shown = [one for one in pages if not isinstance(one, RosbridgePage)]
    routes: list[BaseRoute] = [Route("/", _index(shown))] if shown else []
    routes += [WebSocketRoute("/", _socket(one, connections)) for one in pages if isinstance(one, RosbridgePage)]
    for page in shown:
        routes.append(Route(f"/{page.path}/", _shell(page, static)))
        routes.append(WebSocketRoute(f"/{page.path}/socket", _socket(page, connections)))
    routes.append(Mount("/static", StaticFiles(directory=static, check_dir=False)))
    return AccessCheck(Starlette(routes=routes), access)


def _index(pages: Sequence[MachinePage]) -> Answer:
    async def answer(_request: Request) -> Response:
        if len(pages) == 1:
            return RedirectResponse(f"/{pages[0].path}/", status_code=303)
        rows = "".join(f'<li><a href="/{escape(one.path)}/">{escape(one.title)}</a></li>' for one in pages)
        return HTMLResponse(f'<!doctype html><html lang="en"><title>snr</title><ul>{rows}</ul></html>')

    return answer


def _shell(page: MachinePage, static: Path) -> Answer:
    async def answer(_request: Request) -> Response:
        file = static / page.shell
        return FileResponse(file) if file.is_file() else PlainTextResponse(f"{page.shell} is missing.", 404)

    return answer


def _socket(page: ServedPage, connections: set[_Connection]) -> Callable[[WebSocket], Awaitable[None]]:
    async def serve(websocket: WebSocket) -> None:
        await websocket.accept()
        connection = _Connection(websocket)
        if len(connections) >= MAX_CONNECTIONS:
            reason = f"{MAX_CONNECTIONS} pages are open, the maximum: close one."
            await connection.close_with(page.goodbye(reason))
            return
        connections.add(connection)
        try:
            await connection.serve(page)
        finally:
            connections.discard(connection)

    return serve


class _Connection:
    """A WebSocket, with the messages that wait for it."""

    def __init__(self, websocket: WebSocket) -> None:
        self._websocket = websocket
        self._waiting: deque[bytes] = deque()
        self._has_more = asyncio.Event()

    def send(self, message: bytes) -> None:
        """Queue a message.

        Raises:
            HungUpError: too many wait; the connection is closed.
        """
        if len(self._waiting) >= MAX_WAITING:
            self._has_more.set()
            raise HungUpError("The browser does not read what it is sent.")
        self._waiting.append(message)
        self._has_more.set()

    async def serve(self, page: ServedPage) -> None:
        """Serve a page until the browser or the server ends the connection."""
        session: Any = None  # of this page
        try:
            session = page.open(self._websocket.state.rights, self.send)
            tasks = [asyncio.create_task(self._read(session.receive)), asyncio.create_task(self._write())]
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in tasks:
                task.cancel()
            errors = [one for one in await asyncio.gather(*tasks, return_exceptions=True) if isinstance(one, Exception)]
            for error in sorted(errors, key=lambda one: not isinstance(one, HungUpError)):
                raise error
        except HungUpError as error:
            await self.close_with(page.goodbye(str(error)))
        except (WebSocketDisconnect, OSError, TimeoutError):
            pass  # the browser is gone
        finally:
            if session is not None:
                page.close(session)

    async def _read(self, receive: Callable[[str | bytes], None]) -> None:
        while True:
            message = await self._websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            receive(message.get("text") or message.get("bytes") or b"")

    async def _write(self) -> None:
        while True:
            await self._has_more.wait()
            self._has_more.clear()
            while self._waiting:
                if len(self._waiting) >= MAX_WAITING:
                    raise HungUpError("The browser does not read what it is sent.")
                async with asyncio.timeout(SEND_TIMEOUT_S):
                    await self._websocket.send_text(self._waiting.popleft().decode())

    async def close_with(self, message: bytes) -> None:
        """Send a last message, and close."""
        with suppress(WebSocketDisconnect, OSError, TimeoutError, RuntimeError):
            async with asyncio.timeout(CLOSE_TIMEOUT_S):
                if self._websocket.application_state == WebSocketState.CONNECTED:
                    await self._websocket.send_text(message.decode())
                    await self._websocket.close(POLICY_VIOLATION)


class _Http(H11Protocol):
    """A connection that is closed for a newer one while it requests nothing, if there are too many of these."""

    _begun_s = 0.0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Close the oldest idle connection of the address that has most, if there are too many; begin this one."""
        begun = sorted((one for one in self.connections if isinstance(one, _Http)), key=lambda one: one._begun_s)
        idle = [one for one in begun if one.cycle is None or one.cycle.response_complete]
        if len(idle) >= MAX_IDLE:
            surplus = largest_group(idle, lambda one: source_of(one.client[0] if one.client else ""))[0]
            self.connections.discard(surplus)
            surplus.transport.abort()
        self._begun_s = time.monotonic()
        super().connection_made(transport)


class _Server(uvicorn.Server):
    """A server that leaves signals alone: it would raise them again inside a task, and threads would never end."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Change no handler."""
        yield


async def serve(
    pages: Sequence[ServedPage], access: Access, sock: socket.socket, ending: asyncio.Event, static: Path = STATIC
) -> None:
    """Serve pages until `ending` is set; then close all connections.

    Args:
        pages: what is served.
        access: who may use it.
        sock: which listens; closed at the end.
        ending: set when it is to end.
        static: folder of the HTML files, scripts and styles.
    """
    config = uvicorn.Config(
        make_app(pages, access, static),
        loop="asyncio",
        http=_Http,
        ws="websockets-sansio",
        ws_max_size=MAX_MESSAGE_BYTES,
        ws_per_message_deflate=False,  # a short message could become a long one
        lifespan="off",
        log_config=None,
        log_level="critical",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        limit_concurrency=MAX_REQUESTS,
        timeout_graceful_shutdown=0,  # a browser that hangs does not delay the end of the run
    )
    server = _Server(config)
    serving = asyncio.create_task(server.serve(sockets=[sock]))
    ticking = asyncio.create_task(_tick(pages))
    waiting = asyncio.create_task(ending.wait())
    try:
        await asyncio.wait((serving, ticking, waiting), return_when=asyncio.FIRST_COMPLETED)
    finally:
        await asyncio.sleep(LAST_WORDS_S)
        server.should_exit = True
        for task in (ticking, waiting):
            task.cancel()
        await serving
    if ticking.done() and not ticking.cancelled():
        ticking.result()  # raises what a page has raised


async def _tick(pages: Sequence[ServedPage]) -> None:
    while True:
        await asyncio.sleep(TICK_PERIOD_S)
        now_s = time.monotonic()
        for page in pages:
            page.tick(now_s)
