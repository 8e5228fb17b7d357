"""ServerLink: the end of a TCP link that is called, by one client or several."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING

from snr_sim.core.loop import LoopFactory
from snr_sim.core.node import Node
from snr_sim.std_mods.comms.listener import Listener
from snr_sim.std_mods.comms.options import LinkOptions
from snr_sim.std_mods.comms.security import Network, is_allowed
from snr_sim.std_mods.comms.session import Terms
from snr_sim.std_mods.comms.socket_port import Address, Claim, SocketPort
from snr_sim.std_mods.comms.streams import StreamLink

if TYPE_CHECKING:
    import ssl

MAX_STREAMS = 64  # per server, known or not; for one more, the stranger who waits longest has to go


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
        parent: Node,
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

    def _open_ports(self, ports: ExitStack) -> None:
        super()._open_ports(ports)
        sock = self._claim.take(self._address)
        ports.callback(sock.close)
        self._listener = Listener(sock, self._selector, self.log, self._accept)

    def _accept(self, events: int) -> None:
        come = self._listener.accept(self.get_time_s())
        if come is None:
            return
        sock, address = come
        if len(self.streams) >= MAX_STREAMS:
            strangers = [stream for stream in self.streams if not stream.is_admitted]
            if not strangers:
                sock.close()
                return
            strangers[0].failure = "others came while it said nothing."
            self._for(strangers[0], self._pump)
        where = f"{address[0]}:{address[1]}"
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

    def _tend(self, now_s: float) -> None:
        self._listener.tend(now_s)
        super()._tend(now_s)

    def _see_off(self) -> None:
        self._listener.close()  # first: a client that has heard the goodbye may call again at once
        super()._see_off()
