"""A listening socket: it accepts connections, and pauses briefly when none can be accepted."""

import errno
import logging
import os
import selectors
import socket
from collections.abc import Iterator
from typing import Any

import pytest

from snr_sim.links.listener import PAUSE_S, Listener

pytestmark = pytest.mark.slow

LOG = logging.getLogger("snr.listener")


class Full:
    """A socket on a system without a free descriptor, or with another reason not to accept."""

    def __init__(self, sock: socket.socket, reason: int = errno.EMFILE) -> None:
        self.sock = sock
        self.is_full = True
        self.reason = reason

    def __getattr__(self, name: str) -> Any:
        return getattr(self.sock, name)

    def accept(self) -> tuple[socket.socket, Any]:
        if self.is_full:
            raise OSError(self.reason, os.strerror(self.reason))
        return self.sock.accept()


@pytest.fixture
def sock() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as sock:
        sock.setblocking(False)
        yield sock


def test_accept_returns_a_waiting_client_and_then_none(sock: socket.socket) -> None:
    with selectors.DefaultSelector() as selector, socket.create_connection(sock.getsockname()) as caller:
        listener = Listener(sock, selector, LOG, "a connection")
        assert [key.data for key, _ in selector.select(30.0)] == ["a connection"]
        accepted = listener.accept(0.0)
        assert accepted is not None
        assert accepted[1] == caller.getsockname()
        accepted[0].close()
        assert listener.accept(0.0) is None
        listener.close()


@pytest.mark.parametrize("ends_resting", [False, True])
def test_listener_without_descriptor_pauses_and_resumes(
    ends_resting: bool, sock: socket.socket, caplog: pytest.LogCaptureFixture
) -> None:
    full: Any = Full(sock)
    with selectors.DefaultSelector() as selector, socket.create_connection(sock.getsockname()):
        listener = Listener(full, selector, LOG)
        with caplog.at_level(logging.WARNING, "snr.listener"):
            assert listener.accept(10.0) is None
        assert caplog.messages == ["cannot take a connection: Too many open files"]
        listener.resume(10.0 + 0.9 * PAUSE_S)
        assert not selector.get_map(), "or the selector would return at once every time"
        if not ends_resting:
            full.is_full = False
            listener.resume(10.0 + PAUSE_S)
            assert len(selector.select(30.0)) == 1
            accepted = listener.accept(11.0)
            assert accepted is not None
            accepted[0].close()
        listener.close()
        assert not selector.get_map()


def test_aborted_connection_does_not_pause_the_listener(sock: socket.socket) -> None:
    full: Any = Full(sock, errno.ECONNABORTED)
    with selectors.DefaultSelector() as selector:
        listener = Listener(full, selector, LOG)
        assert listener.accept(10.0) is None
        assert selector.get_map()
        listener.close()
        listener.close()  # safe to call twice
        assert not selector.get_map()
