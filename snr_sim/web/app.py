"""The server's routes: any pages, their WebSockets, and static files. The only module that imports Starlette.

    /                  the page, if there is one only; otherwise their list
    /<path>/           the HTML file of a page
    /<path>/socket     its WebSocket
    /static/<file>     scripts and styles

Every page has the same access (`access.py`); a page is added by adding it to the list.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from html import escape
from pathlib import Path
from typing import TypeAlias

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from snr_sim.web.access import Access, AccessCheck, App
from snr_sim.web.pages import HungUpError, Page

STATIC = Path(__file__).with_name("static")
MAX_CONNECTIONS = 32  # of all pages
MAX_WAITING = 64  # messages that a browser has not read
SEND_TIMEOUT_S = 10.0
CLOSE_TIMEOUT_S = 1.0
Answer: TypeAlias = Callable[[Request], Awaitable[Response]]
POLICY_VIOLATION = 1008  # RFC 6455, section 7.4.1


def make_app(pages: Sequence[Page], access: Access, static: Path = STATIC) -> App:
    """Return the application that serves pages.

    Args:
        pages: what it serves.
        access: who may use it.
        static: folder of the HTML files, scripts and styles.
    """
    connections: set[_Connection] = set()
    routes: list[BaseRoute] = [Route("/", _index(pages))]
    for page in pages:
        routes.append(Route(f"/{page.path}/", _shell(page, static)))
        routes.append(WebSocketRoute(f"/{page.path}/socket", _socket(page, connections)))
    routes.append(Mount("/static", StaticFiles(directory=static, check_dir=False)))
    return AccessCheck(Starlette(routes=routes), access)


def _index(pages: Sequence[Page]) -> Answer:
    async def answer(request: Request) -> Response:
        if len(pages) == 1:
            return RedirectResponse(f"/{pages[0].path}/", status_code=303)
        rows = "".join(f'<li><a href="/{escape(one.path)}/">{escape(one.title)}</a></li>' for one in pages)
        return HTMLResponse(f'<!doctype html><html lang="en"><title>snr</title><ul>{rows}</ul></html>')

    return answer


def _shell(page: Page, static: Path) -> Answer:
    async def answer(request: Request) -> Response:
        file = static / page.shell
        return FileResponse(file) if file.is_file() else PlainTextResponse(f"{page.shell} is missing.", 404)

    return answer


def _socket(page: Page, connections: set[_Connection]) -> Callable[[WebSocket], Awaitable[None]]:
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

    async def serve(self, page: Page) -> None:
        """Serve a page until the browser or the server ends the connection."""
        session = None
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
