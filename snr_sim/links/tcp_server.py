"""TcpServer: the end of a TCP link that listens, for one client or several."""

from __future__ import annotations

import selectors
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Any

from snr_sim.links.link import Link
from snr_sim.links.newcomers import Newcomers, largest_group, source_of
from snr_sim.links.security import Network, is_allowed
from snr_sim.links.session import SessionConfig
from snr_sim.links.socket_port import SocketPort
from snr_sim.links.stream_peer import StreamPeer
from snr_sim.links.streams import Streams

if TYPE_CHECKING:
    import socket
    import ssl

MAX_PEERS = 64
MAX_NEWCOMERS = 64  # connections that are not up yet, or closing
ACCEPTS_PER_ROUND = 8
PAUSE_S = 0.5  # without accepting, when the system has no descriptor left


class TcpServer(Streams):
    """Listens, and serves each client separately.

    If clients have to authenticate, they may connect from any address; otherwise only from `allow` and this machine.
    """

    def __init__(
        self,
        link: Link,
        config: SessionConfig,
        listener: Callable[[], socket.socket],
        requires_authentication: bool,
        allow: tuple[Network, ...],
        context: ssl.SSLContext | None,
    ) -> None:
        super().__init__(link, config)
        self._listen = listener
        self._requires_authentication = requires_authentication
        self._allow = allow
        self._context = context
        self._newcomers = Newcomers()
        self._has_warned = False  # a warning that an address exceeded its rate of greetings

    def open(self, ports: ExitStack) -> None:
        """Listen; see Transport."""
        super().open(ports)
        self._listener = self._listen()
        ports.callback(self._listener.close)
        self._register_listener()

    def _register_listener(self) -> None:
        self._resume_s = float("inf")  # when to accept again after a pause
        self._selector.register(self._listener, selectors.EVENT_READ, self._accept)

    def _accept(self, events: int) -> None:
        for _ in range(ACCEPTS_PER_ROUND):
            try:
                accepted = self._listener.accept()
            except (BlockingIOError, ConnectionError):  # no other client; or it has gone, which must not delay others
                return
            except OSError as error:  # no descriptor left: an immediate retry would only spin
                self.link.log.warning("cannot take a connection: %s", error.strerror)
                self._selector.unregister(self._listener)
                self._resume_s = self.now_s() + PAUSE_S
                return
            self._receive(*accepted)

    def _receive(self, sock: socket.socket, address: tuple[Any, ...]) -> None:
        where = f"{address[0]}:{address[1]}"
        if not self._newcomers.may_greet(address[0], self.now_s()):
            if not self._has_warned:  # once: clients must not be able to fill the log
                self.link.log.warning("refused %s and perhaps others: too many connections from one address.", where)
            self._has_warned = True
            sock.close()
            return
        others = [stream for stream in self.streams if not stream.is_admitted or stream.leaves_s is not None]
        if len(others) >= MAX_NEWCOMERS:
            # Of those from one address, take one that is closing already, or else the oldest.
            one = min(largest_group(others, _source_of), key=lambda stream: stream.leaves_s is None)
            one.failure = "others came while it said nothing."
            self._for(one, self._pump)
        try:
            port = SocketPort(sock, self._context)
        except (OSError, ValueError):  # of TLS
            sock.close()
            return
        stream = self._add_stream(port, where)
        if not (self._requires_authentication or is_allowed(address[0], self._allow)):
            self.link.log.warning("refused %s, which is not in allow=.", where)
            stream.session.refuse(
                f"{address[0]} may not connect to node '{self.link.parent.name}'. "
                'Try: allow=["' + address[0] + '"] there, or a secret= on both ends.'
            )
            self._for(stream, self._pump)

    def _admit(self, stream: StreamPeer) -> None:
        super()._admit(stream)
        self._newcomers.remember(_host_of(stream))
        if len(self.peers.up) > MAX_PEERS:
            up = [other for other in self.streams if other in self.peers.up]
            crowded = largest_group(up, _source_of, lambda other: other.session.peer_node)
            surplus = crowded[-1] if len(crowded) > 1 else stream  # a client with only one connection keeps it
            surplus.session.refuse(f"{MAX_PEERS} others are connected to node '{self.link.parent.name}', the maximum.")

    def _housekeep(self, now_s: float) -> None:
        if now_s >= self._resume_s:
            self._register_listener()
        super()._housekeep(now_s)

    def drain_and_close(self) -> None:
        """Stop listening, and send the goodbye message; see Transport."""
        with suppress(KeyError, ValueError):  # paused, or closed
            self._selector.unregister(self._listener)
        self._listener.close()  # first: a client may reconnect at once after the goodbye
        super().drain_and_close()


def _host_of(stream: StreamPeer) -> str:
    return stream.where.rpartition(":")[0]


def _source_of(stream: StreamPeer) -> str:
    return source_of(_host_of(stream))
