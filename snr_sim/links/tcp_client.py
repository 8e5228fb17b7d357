"""TcpClient: the end of a TCP link that connects, and reconnects whenever the connection is lost."""

from __future__ import annotations

import errno
import socket
import threading
from collections.abc import Callable
from contextlib import ExitStack, suppress
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING

from snr_sim.links.link import Link
from snr_sim.links.restarting import MAX_RETRY_S, STEADY_S, BackOff, error_text
from snr_sim.links.security import is_loopback
from snr_sim.links.session import SessionConfig
from snr_sim.links.socket_port import Address, SocketPort
from snr_sim.links.stream_peer import StreamPeer
from snr_sim.links.streams import Streams

if TYPE_CHECKING:
    import ssl

CONNECT_TIMEOUT_S = 5.0
# On this computer an attempt costs little, and a server that is started again is there within a second.
LOCAL_RETRY_S = 0.2


class TcpClient(Streams):
    """Connects to an address, whose port may become known only once the server listens.

    With TLS, the server's certificate must contain `server_name`, or its host if that is empty.
    """

    def __init__(
        self, link: Link, config: SessionConfig, address: Address, context: ssl.SSLContext | None, server_name: str
    ) -> None:
        super().__init__(link, config)
        self._address = address
        self._context = context
        self._server_name = server_name or address.host

    def open(self, ports: ExitStack) -> None:
        """Connect as soon as possible; see Transport."""
        super().open(ports)
        self._connect_s: float | None = 0.0  # time of the next attempt; None during an attempt or a connection
        self._back_off = BackOff(LOCAL_RETRY_S if is_loopback(self._address.host) else MAX_RETRY_S)
        self._up_s = 0.0
        self._connector = Connector(self.wake)
        ports.callback(self._connector.cancel)

    def _housekeep(self, now_s: float) -> None:
        if self._connect_s is not None and now_s >= self._connect_s:
            self._connect_s = None
            self._connector.begin(self._address.host, self._address.port)
        super()._housekeep(now_s)

    def _poll(self) -> None:
        super()._poll()
        with suppress(Empty):
            result = self._connector.results.get_nowait()
            if isinstance(result, str):
                self._reconnect_later(f"waits for {self._address}: {result}.")
            else:
                self._on_connected(result)

    def _on_connected(self, sock: socket.socket) -> None:
        try:
            port = SocketPort(sock, self._context, self._server_name)
        except (OSError, ValueError) as error:  # of TLS: an invalid host name is a ValueError
            sock.close()
            self._reconnect_later(f"waits for {self._address}: {error}.")
            return
        self._up_s = self.now_s()
        self._add_stream(port, str(self._address))

    def _on_closed(self, stream: StreamPeer) -> None:
        if self.now_s() - self._up_s >= STEADY_S:
            self._back_off.reset()
        self._reconnect_later(stream.session.reason)

    def _reconnect_later(self, reason: str) -> None:
        self.link.reason = reason
        self._connect_s = self.now_s() + self._back_off.next_s()
        self._housekeep_s = min(self._housekeep_s, self._connect_s)


class Connector:
    """Resolves names and connects on separate threads, as both may block indefinitely; calls `notify` at a result."""

    def __init__(self, notify: Callable[[], None]) -> None:
        self.results: SimpleQueue[socket.socket | str] = SimpleQueue()
        self._notify = notify
        self._is_cancelled = False

    def begin(self, host: str, port: int) -> None:
        """Start to connect; the result is a socket, or an error."""
        threading.Thread(target=self._connect, args=(host, port), name=f"call {host}:{port}", daemon=True).start()

    def _connect(self, host: str, port: int) -> None:
        try:
            result: socket.socket | str = connect(host, port)
        except Exception as error:  # any: without a result the link would never retry
            result = error_text(error)
        self.results.put(result)
        if self._is_cancelled:
            self.cancel()
        else:
            self._notify()

    def cancel(self) -> None:
        """Ignore all further results; a socket that still arrives is closed."""
        self._is_cancelled = True
        with suppress(Empty):
            while True:
                result = self.results.get_nowait()
                if not isinstance(result, str):
                    result.close()


def connect(host: str, port: int) -> socket.socket:
    """Return a socket that is connected to a server; raise OSError if there is no server, or no such host."""
    sock = socket.create_connection((host, port), CONNECT_TIMEOUT_S)
    try:
        if sock.getsockname() == sock.getpeername():
            # On one machine, where the system takes our own port from the same range, a connection to a port without a
            # listener can reach itself; and then block the port for the server.
            raise ConnectionRefusedError(errno.ECONNREFUSED, "no server is listening")
    except OSError:  # also if the server has closed the connection already
        sock.close()
        raise
    return sock
