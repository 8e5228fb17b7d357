"""SocketsPair: links over TCP, two ends of one address. The thesis' listing 5.1 in any mix of directions.

    tether = SocketsPair(("192.168.2.2", 9120), name="tether", secret=secret_from_env("SNR_SECRET"))
    Config(factories={"robot": [tether.server("depth")], "topside": [tether.client("controller_input")]})

Under a SimClock both ends exchange data in memory instead, with the same sessions and faults.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.links.faults import LinkFaults
from snr_sim.links.frames import MAX_FRAME_BYTES
from snr_sim.links.link import Link
from snr_sim.links.options import MAX_HELD_BYTES, LinkOptions
from snr_sim.links.queues import Policy
from snr_sim.links.security import Network, Tls, as_networks, as_secret, is_loopback
from snr_sim.links.session import SessionConfig
from snr_sim.links.simulated import Rendezvous, SimulatedTransport
from snr_sim.links.socket_port import Address, Addressed, ListenerFactory
from snr_sim.links.tcp_client import TcpClient
from snr_sim.links.tcp_server import TcpServer
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import DataKey

if TYPE_CHECKING:
    import ssl

# Time limit of a greeting, even where the limit of silence is shorter: the server's program may still be starting.
GREETING_S = 3.0


class SocketsPair(Addressed):
    """The two ends of links at one address.

    Args:
        server_tuple: host and port of the server. It binds to this host only; port 0 takes a free one.
        name: the link is component and page `link_<name>`; the port's number if not given.
        secret: shared by both ends, at least 16 bytes; see also `secret_from_file` and `secret_from_env`.
        tls: certificates.
        allow: addresses and networks that a server accepts clients from, in addition to this machine.
        max_frame_bytes: maximum size of a page.
        max_held_bytes: maximum memory of the newest pages of all keys, of links without `accept`; see LinkOptions.
        queue_pages: maximum number of pages that wait for one peer, and for the first peer to connect.
        policy: what happens when a queue is full: "drop_oldest", or "refuse" the newest.
        faults: faults to inject in both directions.
        keep_alive_s: period between pings of each end.
        timeout_s: silence after which an end counts as gone.
        secret_is: what users call the secret, and how they pass it; for messages.

    Raises:
        ConfigError: the address, the secret, the certificates or a network are invalid.
        ParameterError: another option is invalid; see LinkOptions.
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
        max_held_bytes: int = MAX_HELD_BYTES,
        queue_pages: int = 10_000,
        policy: Policy = "drop_oldest",
        faults: LinkFaults | None = None,
        keep_alive_s: float = 0.5,
        timeout_s: float = 3.0,
        secret_is: tuple[str, str] = SessionConfig.secret_is,
    ) -> None:
        self.address: Address = _as_address(server_tuple, more)
        self.secret: bytes | None = as_secret(secret)
        self.secret_is: tuple[str, str] = secret_is
        if tls is not None and not isinstance(tls, Tls):
            raise ConfigError(
                f"tls={tls!r} is not a Tls.", fix="Tls(certificate=..., key=..., authority=...), or None."
            )
        self.tls: Tls | None = tls
        self.allow: tuple[Network, ...] = as_networks(allow)
        self.rendezvous: Rendezvous[SimulatedTransport] = Rendezvous()
        self.options: LinkOptions = LinkOptions(
            name or str(self.port),
            max_frame_bytes=max_frame_bytes,
            max_held_bytes=max_held_bytes,
            queue_pages=queue_pages,
            policy=policy,
            keep_alive_s=keep_alive_s,
            timeout_s=timeout_s,
            faults=faults,
        )

    def client(
        self, keys: DataKey | Iterable[DataKey] = (), *, accept: Iterable[DataKey] | None = None
    ) -> SocketsLoopFactory:
        """Return the factory of the end that connects.

        Args:
            keys: pages of these keys are sent to the server.
            accept: keys of the pages to accept from the server; any if not given.
        """
        return SocketsLoopFactory(self, keys, accept)

    def server(
        self, keys: DataKey | Iterable[DataKey] = (), *, accept: Iterable[DataKey] | None = None
    ) -> SocketsListenerFactory:
        """Return the factory of the end that listens, for one client or several.

        Args:
            keys: pages of these keys are sent to each client.
            accept: keys of the pages to accept from clients; any if not given.

        Raises:
            ConfigError: any client in the network could connect.
        """
        return SocketsListenerFactory(self, keys, accept)

    def session_config(self, node: str, is_server: bool) -> SessionConfig:
        """Return the session settings of one end."""
        options = self.options
        return SessionConfig(
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
    """Return host and port after a check; `more` are positional arguments that belong in the tuple or need a name."""
    fix = 'SocketsPair(("127.0.0.1", 9120), name="tether"): host and port in parentheses, all else by its name.'
    if more:
        raise ConfigError(
            f"SocketsPair takes one address, not {server_tuple!r} and {', '.join(map(repr, more))}.", fix=fix
        )
    if not isinstance(server_tuple, (tuple, list)) or len(server_tuple) != 2:
        raise ConfigError(f"{server_tuple!r} is not the address of a link.", fix=fix)
    host, port = server_tuple
    if not isinstance(host, str) or not host:
        raise ConfigError(f"The address of a link is {server_tuple!r}, but its host cannot be {host!r}.", fix=fix)
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port < 1 << 16:
        raise ConfigError(
            f"The address of a link is {server_tuple!r}, but its port cannot be {port!r}.",
            fix="use an integer from 0 to 65535; 0 takes a free port.",
        )
    return Address(host, port)


class SocketsLoopFactory(LoopFactory):
    """Makes the end that connects to an address, or to the one of a SocketsPair; see `SocketsPair.client`."""

    def __init__(
        self,
        pair: SocketsPair | tuple[str, int],
        data_keys: DataKey | Iterable[DataKey] = (),
        accept: Iterable[DataKey] | None = None,
    ) -> None:
        super().__init__()
        self.pair: SocketsPair = pair if isinstance(pair, SocketsPair) else SocketsPair(pair)
        self.options: LinkOptions = self.pair.options.for_end(data_keys, accept)
        self._context()

    def _context(self) -> ssl.SSLContext | None:
        """Return the TLS context: made for each link, since a context cannot be sent to another process."""
        return None if self.pair.tls is None else self.pair.tls.client_context()

    def where(self) -> str:
        """Return a description of where it connects."""
        return f"link_{self.options.name} connects to {self.pair.address}"

    def get(self, parent: NodeApi) -> Loop:
        """Return the link."""
        pair = self.pair
        config = pair.session_config(parent.name, is_server=False)
        server_name = "" if pair.tls is None else pair.tls.server_name
        return Link(
            self,
            parent,
            self.options,
            real=lambda link: TcpClient(link, config, pair.address, self._context(), server_name),
            simulated=lambda link: SimulatedTransport(link, config, pair.rendezvous),
        )


class SocketsListenerFactory(ListenerFactory):
    """Makes the end that listens at a port of this machine, an address, or that of a SocketsPair.

    See `SocketsPair.server`.

    Raises:
        ConfigError: any client in the network could connect.
    """

    def __init__(
        self,
        pair: SocketsPair | tuple[str, int] | int,
        data_keys: DataKey | Iterable[DataKey] = (),
        accept: Iterable[DataKey] | None = None,
    ) -> None:
        if isinstance(pair, int):
            pair = ("127.0.0.1", pair)
        self.pair: SocketsPair = pair if isinstance(pair, SocketsPair) else SocketsPair(pair)
        pair = self.pair
        super().__init__(pair.address, f"The link '{pair.options.name}'")
        self.options: LinkOptions = pair.options.for_end(data_keys, accept)
        # Clients with our secret or certificate may connect from any address.
        requires_authentication = pair.secret is not None or (
            pair.tls is not None and pair.tls.client_authority is not None
        )
        if not (requires_authentication or pair.allow or is_loopback(pair.host)):
            raise ConfigError(
                f"A server on {pair.host} needs secret= or allow=: any computer in that network could steer this node.",
                fix='secret= on both ends, or allow=["192.168.2.7"] with the addresses that may connect.',
            )
        self._requires_authentication = requires_authentication
        self._context()

    def _context(self) -> ssl.SSLContext | None:
        """Return the TLS context; made for each link, as for a client."""
        return None if self.pair.tls is None else self.pair.tls.server_context()

    def where(self) -> str:
        """Return a description of where it listens."""
        return f"link_{self.options.name} listens at {self.pair.address}"

    def get(self, parent: NodeApi) -> Loop:
        """Return the link."""
        pair = self.pair
        config = pair.session_config(parent.name, is_server=True)
        return Link(
            self,
            parent,
            self.options,
            real=lambda link: TcpServer(
                link, config, self.listener, self._requires_authentication, pair.allow, self._context()
            ),
            simulated=lambda link: SimulatedTransport(link, config, pair.rendezvous),
        )
