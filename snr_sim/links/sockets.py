"""SocketsPair: links over TCP, two ends of one address. The thesis' listing 5.1 in any mix of directions.

    tether = SocketsPair(("192.168.2.2", 9120), name="tether", secret=secret_from_env("SNR_SECRET"))
    Config(factories={"robot": [tether.server("depth")], "topside": [tether.client("controller_input")]})

Under a SimClock both ends meet in memory instead, in the same sessions with the same faults.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.links.faults import Faults
from snr_sim.links.frames import MAX_FRAME_BYTES
from snr_sim.links.link import Link
from snr_sim.links.options import LinkOptions
from snr_sim.links.security import Tls, as_networks, as_secret, is_loopback
from snr_sim.links.send_queue import Policy
from snr_sim.links.session import Terms
from snr_sim.links.simulated import Meeting, SimulatedTransport
from snr_sim.links.socket_port import Address, ListenerFactory
from snr_sim.links.tcp_client import TcpClient
from snr_sim.links.tcp_server import TcpServer
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.page import DataKey

if TYPE_CHECKING:
    import ssl

# Time for a greeting, also where the silence that counts is shorter: whoever is called may still be starting.
GREETING_S = 3.0


class SocketsPair:
    """The two ends of links at one address.

    Args:
        server_tuple: host and port of the server. It binds to this host and no other; port 0 takes a free one.
        name: the link is component and page `link_<name>`; the port's number if not given.
        secret: shared by both ends, at least 16 bytes; see also `secret_from_file` and `secret_from_env`.
        tls: certificates.
        allow: addresses and networks a server takes clients from, beside this machine.
        max_frame_bytes: the longest page.
        queue_pages: how many pages may wait for one far end, and for anybody to come for the first time.
        policy: what happens when more would: "drop_oldest", or "refuse" the newest.
        faults: what is to go wrong on the way, in both directions.
        keep_alive_s: how often each end asks whether the other is there.
        timeout_s: after how much silence it counts as gone.
        secret_is: what people know the secret as, and how it is given; for messages.

    Raises:
        ConfigError: the address, the secret, the certificates or a network are none.
        ParameterError: another option makes no sense; see LinkOptions.
    """

    def __init__(
        self,
        server_tuple: tuple[str, int],
        *more: object,
        name: str = "",
        secret: str | bytes | None = None,
        tls: Tls | None = None,
        allow: Iterable[str] = (),
        max_frame_bytes: int = MAX_FRAME_BYTES,
        queue_pages: int = 10_000,
        policy: Policy = "drop_oldest",
        faults: Faults | None = None,
        keep_alive_s: float = 0.5,
        timeout_s: float = 3.0,
        secret_is: tuple[str, str] = Terms.secret_is,
    ) -> None:
        self.address = _as_address(server_tuple, more)
        self.secret = as_secret(secret)
        self.secret_is = secret_is
        if tls is not None and not isinstance(tls, Tls):
            raise ConfigError(f"A link with tls={tls!r}.", fix="Tls(certificate=..., key=..., authority=...), or None.")
        self.tls = tls
        self.allow = as_networks(allow)
        self.meeting: Meeting[SimulatedTransport] = Meeting()
        self.options = LinkOptions(
            name or str(self.port),
            max_frame_bytes=max_frame_bytes,
            queue_pages=queue_pages,
            policy=policy,
            keep_alive_s=keep_alive_s,
            timeout_s=timeout_s,
            faults=faults,
        )

    @property
    def host(self) -> str:
        """Where the server is, or is to be."""
        return self.address.host

    @property
    def port(self) -> int:
        """Its port; when any was asked for, the one it has, once it listens."""
        return self.address.port

    def client(
        self, keys: DataKey | Iterable[DataKey] = (), *, accept: Iterable[DataKey] | None = None
    ) -> SocketsLoopFactory:
        """Return the factory of the end that calls.

        Args:
            keys: pages of these go to the server.
            accept: pages of these may come from it; any if not given.
        """
        return SocketsLoopFactory(self, keys, accept)

    def server(
        self, keys: DataKey | Iterable[DataKey] = (), *, accept: Iterable[DataKey] | None = None
    ) -> SocketsListenerFactory:
        """Return the factory of the end that is called, by one client or several.

        Args:
            keys: pages of these go to each client.
            accept: pages of these may come from clients; any if not given.

        Raises:
            ConfigError: anybody in the network could connect.
        """
        return SocketsListenerFactory(self, keys, accept)

    def terms_for(self, node: str, is_server: bool) -> Terms:
        """Return what one end brings to its sessions."""
        options = self.options
        return Terms(
            node,
            is_server,
            self.secret,
            max_frame_bytes=options.max_frame_bytes,
            keep_alive_s=options.keep_alive_s,
            timeout_s=options.timeout_s,
            greeting_s=max(options.timeout_s, GREETING_S),
            secret_is=self.secret_is,
        )


def _as_address(server_tuple: object, more: tuple[object, ...]) -> Address:
    """Return host and port, checked; `more` is what stood behind them and belongs to them, or have no name."""
    fix = 'SocketsPair(("127.0.0.1", 9120), name="tether"): host and port in parentheses, all else by its name.'
    if more:
        raise ConfigError(f"A SocketsPair of {server_tuple!r} and {', '.join(map(repr, more))}.", fix=fix)
    if not isinstance(server_tuple, (tuple, list)) or len(server_tuple) != 2:
        raise ConfigError(f"A link's address is {server_tuple!r}.", fix=fix)
    host, port = server_tuple
    if not isinstance(host, str) or not host:
        raise ConfigError(f"A link's address is {server_tuple!r}, and its host is {host!r}.", fix=fix)
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port < 1 << 16:
        raise ConfigError(
            f"A link's address is {server_tuple!r}, and its port is {port!r}.",
            fix="a whole number from 0 to 65535; 0 takes a free one.",
        )
    return Address(host, port)


class SocketsLoopFactory(LoopFactory):
    """Makes the end that calls.

    Args:
        pair: the address, or a SocketsPair.
        data_keys: pages of these go to the server.
        accept: pages of these may come from it; any if None.
    """

    def __init__(
        self,
        pair: SocketsPair | tuple[str, int],
        data_keys: DataKey | Iterable[DataKey] = (),
        accept: Iterable[DataKey] | None = None,
    ) -> None:
        super().__init__()
        self.pair = pair if isinstance(pair, SocketsPair) else SocketsPair(pair)
        self.options = self.pair.options.for_end(data_keys, accept)
        self._context()

    def _context(self) -> ssl.SSLContext | None:
        """Return what TLS needs: made again for each link, since a context cannot be sent to a process.

        Raises:
            ConfigError: a file is missing or is not what it should be.
        """
        return None if self.pair.tls is None else self.pair.tls.client_context()

    def where(self) -> str:
        """Return where it connects, in words."""
        return f"link_{self.options.name} connects to {self.pair.address}"

    def get(self, parent: NodeApi) -> Loop:
        """Return the link."""
        pair = self.pair
        terms = pair.terms_for(parent.name, is_server=False)
        server_name = "" if pair.tls is None else pair.tls.server_name
        return Link(
            self,
            parent,
            self.options,
            real=lambda link: TcpClient(link, terms, pair.address, self._context(), server_name),
            simulated=lambda link: SimulatedTransport(link, terms, pair.meeting),
        )


class SocketsListenerFactory(ListenerFactory):
    """Makes the end that is called.

    Args:
        pair: a port of this machine, an address, or a SocketsPair.
        data_keys: pages of these go to each client.
        accept: pages of these may come from clients; any if None.

    Raises:
        ConfigError: anybody in the network could connect.
    """

    def __init__(
        self,
        pair: SocketsPair | tuple[str, int] | int,
        data_keys: DataKey | Iterable[DataKey] = (),
        accept: Iterable[DataKey] | None = None,
    ) -> None:
        if isinstance(pair, int):
            pair = ("127.0.0.1", pair)
        self.pair = pair = pair if isinstance(pair, SocketsPair) else SocketsPair(pair)
        super().__init__(pair.address, f"The link '{pair.options.name}'")
        self.options = pair.options.for_end(data_keys, accept)
        # Who has a secret or a certificate of ours may come from anywhere.
        asks_who = pair.secret is not None or (pair.tls is not None and pair.tls.client_authority is not None)
        if not (asks_who or pair.allow or is_loopback(pair.host)):
            raise ConfigError(
                f"A server on {pair.host} would let anybody in that network steer this node.",
                fix='secret= on both ends, or allow=["192.168.2.7"] with the addresses that may connect.',
            )
        self._asks_who = asks_who
        self._context()

    def _context(self) -> ssl.SSLContext | None:
        """Return what TLS needs; made again for each link, as for a client."""
        return None if self.pair.tls is None else self.pair.tls.server_context()

    def where(self) -> str:
        """Return where it listens, in words."""
        return f"link_{self.options.name} listens at {self.pair.address}"

    def get(self, parent: NodeApi) -> Loop:
        """Return the link."""
        pair = self.pair
        terms = pair.terms_for(parent.name, is_server=True)
        return Link(
            self,
            parent,
            self.options,
            real=lambda link: TcpServer(link, terms, self.listener, self._asks_who, pair.allow, self._context()),
            simulated=lambda link: SimulatedTransport(link, terms, pair.meeting),
        )
