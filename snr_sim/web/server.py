"""Serves pages on a socket until it is to end. The only module that imports uvicorn."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import uvicorn

from snr_sim.web.access import Access
from snr_sim.web.app import STATIC, make_app
from snr_sim.web.message_parts import MAX_MESSAGE_BYTES
from snr_sim.web.pages import TICK_PERIOD_S, Page

MAX_REQUESTS = 128  # at once; beyond it, status 503
LAST_WORDS_S = 0.05  # for the last messages to leave


class _Server(uvicorn.Server):
    """A server that leaves signals alone: it would raise them again inside a task, and threads would never end."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Change no handler."""
        yield


async def serve(
    pages: Sequence[Page], access: Access, sock: socket.socket, ending: asyncio.Event, static: Path = STATIC
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
        http="h11",
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


async def _tick(pages: Sequence[Page]) -> None:
    while True:
        await asyncio.sleep(TICK_PERIOD_S)
        now_s = time.monotonic()
        for page in pages:
            page.tick(now_s)
