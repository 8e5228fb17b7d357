"""ServerLink: the end of a TCP link that is called, by one client or several."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from snr_sim.core.loop import LoopFactory
from snr_sim.links.listener import Listener
from snr_sim.links.newcomers import Newcomers, crowd, source_of
from snr_sim.links.options import LinkOptions
from snr_sim.links.peers import Peer
from snr_sim.links.security import Network, is_allowed
from snr_sim.links.session import Terms
from snr_sim.links.socket_port import Address, Claim, SocketPort
from snr_sim.links.stream_peer import StreamPeer
from snr_sim.links.streams import StreamLink
from snr_sim.prelude.node_api import NodeApi

if TYPE_CHECKING:
    import socket
    import ssl

MAX_PEERS = 64
MAX_NEWCOMERS = 64  # connections that are not up, or not any more
ACCEPTS_PER_ROUND = 8


@dataclass(frozen=True)
class Gate:
    """Who may connect.

    Args:
        asks_who: clients have to prove who they are, and may come from anywhere.
        allow: otherwise only from here, and from this machine.
        context: of TLS, if wanted.
    """

    asks_who: bool
    allow: tuple[Network, ...]
    context: ssl.SSLContext | None


class ServerLink(StreamLink):
    """Listens, and serves each client by itself.

    Args:
        factory, parent, options, terms: as of StreamLink.
        address: where it listens.
        gate: who may connect.
        claim: of the port there.
    """

    def __init__(
        self,
        factory: LoopFactory,
        parent: NodeApi,
        options: LinkOptions,
        terms: Terms,
        address: Address,
        gate: Gate,
        claim: Claim,
    ) -> None:
        super().__init__(factory, parent, options, terms)
        self._address = address
        self._gate = gate
        self._claim = claim
        self._newcomers = Newcomers()
        self._has_told = False  # that an address may not greet now

    def _open_ports(self, ports: ExitStack) -> None:
        super()._open_ports(ports)
        sock = self._claim.take(self._address)
        ports.callback(sock.close)
        self._listener = Listener(sock, self._selector, self.log, self._accept)

    def _accept(self, events: int) -> None:
        for _ in range(ACCEPTS_PER_ROUND):
            come = self._listener.accept(self.get_time_s())
            if come is None:
                return
            self._receive(*come)

    def _receive(self, sock: socket.socket, address: tuple[Any, ...]) -> None:
        where = f"{address[0]}:{address[1]}"
        if not self._newcomers.may_greet(address[0], self.get_time_s()):
            if not self._has_told:  # once: whoever connects must not fill the log
                self.log.warning("refused %s and perhaps others: too many connections from one address.", where)
            self._has_told = True
            sock.close()
            return
        others = [stream for stream in self.streams if not stream.is_admitted or stream.leaves_s is not None]
        if len(others) >= MAX_NEWCOMERS:
            # Of those from one address who leaves already, or else the oldest.
            one = min(crowd(others, _source_of), key=lambda stream: stream.leaves_s is None)
            one.failure = "others came while it said nothing."
            self._for(one, self._pump)
        try:
            port = SocketPort(sock, self._gate.context)
        except (OSError, ValueError):  # of TLS
            sock.close()
            return
        stream = self._add_stream(port, where)
        if not (self._gate.asks_who or is_allowed(address[0], self._gate.allow)):
            self.log.warning("refused %s, which is not in allow=.", where)
            stream.session.refuse(
                f"{address[0]} may not connect to node '{self.parent.name}'. "
                'Try: allow=["' + address[0] + '"] there, or a secret= on both ends.'
            )
            self._for(stream, self._pump)

    def _admit(self, peer: Peer) -> None:
        super()._admit(peer)
        assert isinstance(peer, StreamPeer)
        self._newcomers.know(_host_of(peer))
        if len(self.peers) > MAX_PEERS:
            peers = [stream for stream in self.streams if stream in self.peers]
            crowded = crowd(peers, _source_of, lambda stream: stream.session.peer_node)
            surplus = crowded[-1] if len(crowded) > 1 else peer  # who has only one connection keeps it
            surplus.session.refuse(f"{MAX_PEERS} others are connected to node '{self.parent.name}', which is the most.")

    def _tend(self, now_s: float) -> None:
        self._listener.tend(now_s)
        super()._tend(now_s)

    def _see_off(self) -> None:
        self._listener.close()  # first: a client that has heard the goodbye may call again at once
        super()._see_off()


def _host_of(stream: StreamPeer) -> str:
    return stream.where.rpartition(":")[0]


def _source_of(stream: StreamPeer) -> str:
    return source_of(_host_of(stream))
