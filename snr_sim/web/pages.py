"""What the server and its pages know of each other: the server does not know what a page shows.

    WebSocket of /<path>/socket --> Page.open --> Session.receive       (app.py)
    30 times a second           --> Page.tick --> send of its sessions  (server.py)

Everything here happens on the server's thread.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, Protocol, TypeAlias

Rights: TypeAlias = Literal["change", "look"]
Send: TypeAlias = Callable[[bytes], None]  # queues a message for the browser; HungUpError if too many wait
TICK_PERIOD_S = 1.0 / 30.0


class HungUpError(Exception):
    """A connection is to be closed; the text is sent to the browser first."""


class Session(Protocol):
    """One connection of a browser."""

    def receive(self, data: str | bytes) -> None:
        """Handle a message.

        Raises:
            HungUpError: it cannot be handled, and the connection is to be closed.
        """


class Page(Protocol):
    """A page of the server, at `/<path>/`.

    Attributes:
        path: such as "machine/dora".
        title: for people.
        shell: name of its HTML file among the static files.
    """

    path: str
    title: str
    shell: str

    def open(self, rights: Rights, send: Send) -> Session:
        """Return the session of a new connection."""

    def close(self, session: Session) -> None:
        """Forget a connection: it has been closed."""

    def tick(self, now_s: float) -> None:
        """Send what has changed; `now_s` is wall time."""

    def gone(self, reason: str) -> None:
        """Send that the server ends."""

    def goodbye(self, reason: str) -> bytes:
        """Return the last message of a connection that the server closes."""
