"""SocketsPair: links over TCP, two ends of one address. The thesis' listing 5.1 in any mix of directions.

    tether = SocketsPair(("192.168.2.2", 9120), name="tether", secret=secret_from_env("SNR_SECRET"))
    Config(factories={"robot": [tether.server("depth")], "topside": [tether.client("controller_input")]})

Under a SimClock both ends meet in memory instead, in the same sessions with the same faults.
"""

from __future__ import annotations

import errno
import os
import random
import selectors
import socket
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING

from snr_sim.core.clocks import SimClock
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.core.node import Node
from snr_sim.prelude.errors import ConfigError, LinkError
from snr_sim.prelude.page import DataKey
from snr_sim.std_mods.comms.faults import Faults
from snr_sim.std_mods.comms.frames import MAX_FRAME_BYTES
from snr_sim.std_mods.comms.link import LinkOptions, as_keys
from snr_sim.std_mods.comms.security import Tls, as_networks, as_secret, is_allowed, is_loopback
from snr_sim.std_mods.comms.send_queue import Policy
from snr_sim.std_mods.comms.session import Terms
from snr_sim.std_mods.comms.simulated import Meeting, SimulatedLink
from snr_sim.std_mods.comms.stream_peer import StreamPeer
from snr_sim.std_mods.comms.streams import StreamLink

if TYPE_CHECKING:
    import ssl

CONNECT_TIMEOUT_S = 5.0
RETRY_FIRST_S = 0.05
RETRY_MOST_S = 2.0
STEADY_S = 5.0  # a connection that lasted this long was a good one: the next try comes soon
MAX_STREAMS = 64  # per server, known or not; more are closed at once
PAUSE_S = 0.5  # after the system had no descriptor left for a connection


class SocketPort:
    """A TCP socket, perhaps inside TLS, as a port.

    Args:
        sock: connected.
        context: of TLS, if wanted.
        server_name: what its certificate must say; None on the server's side.
    """

    def __init__(self, sock: socket.socket, context: ssl.SSLContext | None = None, server_name: str | None = None):
        sock.setblocking(False)
        with suppress(OSError):  # not every family of sockets has it
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.is_shareable = context is None  # OpenSSL is not for two threads at a time
        self._sock = sock
        self._blocked: tuple[type[Exception], ...] = ()
        if context is not None:
            import ssl  # only links with TLS pay for it

            self._blocked = (ssl.SSLWantReadError, ssl.SSLWantWriteError)
            self._sock = context.wrap_socket(
                sock, server_side=server_name is None, server_hostname=server_name, do_handshake_on_connect=False
            )

    def fileno(self) -> int:
        """Returns the socket's descriptor."""
        return self._sock.fileno()

    def read(self, most: int) -> bytes:
        """Returns what has come; see Port."""
        if self.is_shareable:
            return self._sock.recv(most)
        chunks: list[bytes] = []
        try:
            # Until it says that nothing is left: what TLS has taken in already, `select` does not see.
            while sum(map(len, chunks)) < most or self._sock.pending():  # type: ignore[attr-defined]
                chunks.append(self._sock.recv(1 << 16))
                if not chunks[-1]:
                    break
        except self._blocked:
            if not chunks:
                raise BlockingIOError from None
        return b"".join(chunks)

    def write(self, data: bytes | memoryview) -> int:
        """Sends what fits; see Port."""
        try:
            return self._sock.send(data)
        except self._blocked:
            raise BlockingIOError from None

    def end_writing(self) -> None:
        """Tells the far end that nothing more comes."""
        socket.socket.shutdown(self._sock, socket.SHUT_WR)

    def close(self) -> None:
        """Closes the socket."""
        self._sock.close()


class SocketsPair:
    """The two ends of links at one address.

    Args:
        server_tuple: host and port of the server. It binds to this host and no other; port 0 takes a free one.
        name: the link is component and page `link_<name>`; the port's number if not given.
        secret: shared by both ends, at least 16 bytes; see also `secret_from_file` and `secret_from_env`.
        tls: certificates.
        allow: addresses and networks a server takes clients from, beside this machine.
        max_frame_bytes: the longest page.
        queue_pages: how many pages may wait for one far end.
        policy: what happens when more would: "drop_oldest", or "refuse" the newest.
        faults: what is to go wrong on the way, in both directions.
        keep_alive_s: how often each end asks whether the other is there.
        timeout_s: after how much silence it counts as gone.

    Raises:
        ConfigError: the address, the secret or a network is none.
    """

    def __init__(
        self,
        server_tuple: tuple[str, int],
        *,
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
    ) -> None:
        try:
            self.host, port = server_tuple
            self.port = int(port)
            is_address = isinstance(self.host, str) and bool(self.host) and 0 <= self.port < 1 << 16
        except (TypeError, ValueError):
            is_address = False
        if not is_address:
            raise ConfigError(f"A link's address is {server_tuple!r}.", fix='("127.0.0.1", 9120): host and port.')
        self.secret = as_secret(secret)
        self.tls = tls
        self.allow = as_networks(allow)
        self.meeting = Meeting()
        self.options = LinkOptions(
            name or str(self.port),
            max_frame_bytes=max_frame_bytes,
            queue_pages=queue_pages,
            policy=policy,
            keep_alive_s=keep_alive_s,
            timeout_s=timeout_s,
            faults=faults,
        )

    def client(
        self, keys: DataKey | Iterable[DataKey] = (), *, accept: Iterable[DataKey] | None = None
    ) -> SocketsLoopFactory:
        """Returns the factory of the end that calls.

        Args:
            keys: pages of these go to the server.
            accept: pages of these may come from it; any if not given.
        """
        return SocketsLoopFactory(self, keys, accept)

    def server(
        self, keys: DataKey | Iterable[DataKey] = (), *, accept: Iterable[DataKey] | None = None
    ) -> SocketsListenerFactory:
        """Returns the factory of the end that is called, by one client or several.

        Args:
            keys: pages of these go to each client.
            accept: pages of these may come from clients; any if not given.

        Raises:
            ConfigError: anybody in the network could connect.
        """
        return SocketsListenerFactory(self, keys, accept)

    def options_for(self, keys: DataKey | Iterable[DataKey], accept: Iterable[DataKey] | None) -> LinkOptions:
        """Returns what one end is told."""
        wanted = None if accept is None else frozenset(as_keys(accept))
        return replace(self.options, keys=as_keys(keys), accept=wanted)

    def terms_for(self, node: str, is_server: bool) -> Terms:
        """Returns what one end brings to its sessions."""
        options = self.options
        return Terms(
            node,
            is_server,
            self.secret,
            max_frame_bytes=options.max_frame_bytes,
            keep_alive_s=options.keep_alive_s,
            timeout_s=options.timeout_s,
        )


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
        self.options = self.pair.options_for(data_keys, accept)
        self.context = None if self.pair.tls is None else self.pair.tls.client_context()

    def get(self, parent: Node) -> Loop:
        """Returns the link."""
        terms = self.pair.terms_for(parent.name, is_server=False)
        if isinstance(parent.clock, SimClock):
            return SimulatedLink(self, parent, self.options, terms, self.pair.meeting)
        return ClientLink(self, parent, self.options, terms)


class SocketsListenerFactory(LoopFactory):
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
        super().__init__()
        if isinstance(pair, int):
            pair = ("127.0.0.1", pair)
        self.pair = pair = pair if isinstance(pair, SocketsPair) else SocketsPair(pair)
        self.options = pair.options_for(data_keys, accept)
        # Who has a secret or a certificate of ours may come from anywhere.
        self.asks_who = pair.secret is not None or (pair.tls is not None and pair.tls.client_authority is not None)
        if not (self.asks_who or pair.allow or is_loopback(pair.host)):
            raise ConfigError(
                f"A server on {pair.host} would let anybody in that network steer this node.",
                fix='secret= on both ends, or allow=["192.168.2.7"] with the addresses that may connect.',
            )
        self.context = None if pair.tls is None else pair.tls.server_context()

    def get(self, parent: Node) -> Loop:
        """Returns the link."""
        terms = self.pair.terms_for(parent.name, is_server=True)
        if isinstance(parent.clock, SimClock):
            return SimulatedLink(self, parent, self.options, terms, self.pair.meeting)
        return ServerLink(self, parent, self.options, terms)


class ServerLink(StreamLink):
    """Listens, and serves each client by itself."""

    factory: SocketsListenerFactory

    def _open(self) -> None:
        pair = self.factory.pair
        self._listener = listen(pair.host, pair.port)
        pair.port = self._listener.getsockname()[1]  # for those who asked for any
        super()._open()
        self._resume_s: float | None = None
        self._selector.register(self._listener, selectors.EVENT_READ, self._accept)

    def _accept(self, events: int) -> None:
        try:
            sock, address = self._listener.accept()
        except BlockingIOError:
            return
        except OSError as error:  # no descriptor left: accepting at once again would only spin
            self.log.warning("cannot take a connection: %s", error.strerror)
            self._selector.unregister(self._listener)
            self._resume_s = self.get_time_s() + PAUSE_S
            return
        if len(self.streams) >= MAX_STREAMS:
            strangers = [stream for stream in self.streams if not stream.is_admitted]
            if not strangers:
                sock.close()
                return
            strangers[0].failure = "others came while it said nothing."
            self._pump(strangers[0])
        factory = self.factory
        where = f"{address[0]}:{address[1]}"
        try:
            port = SocketPort(sock, factory.context)
        except OSError:
            sock.close()
            return
        self._add_stream(port, where)
        if not (factory.asks_who or is_allowed(address[0], factory.pair.allow)):
            self.log.warning("refused %s, which is not in allow=.", where)
            self.streams[-1].session.refuse(
                f"{address[0]} may not connect to node '{self.parent.name}'. "
                'Try: allow=["' + address[0] + '"] there, or a secret= on both ends.'
            )
            self._pump(self.streams[-1])

    def _tend(self, now_s: float) -> None:
        if self._resume_s is not None and now_s >= self._resume_s:
            self._resume_s = None
            self._selector.register(self._listener, selectors.EVENT_READ, self._accept)
        super()._tend(now_s)

    def halt(self) -> None:
        """Takes nobody any more, and says goodbye to each."""
        self._listener.close()
        super().halt()


def listen(host: str, port: int, who: str = "A link") -> socket.socket:
    """Returns a socket that listens at one address; `who` wants it, for the words of an error.

    Raises:
        LinkError: the port is taken, or the host is not this machine.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except OSError as error:
        raise LinkError(
            f"{who} should listen on '{host}', which no name server knows ({error.strerror}).",
            fix="an address of this machine: 127.0.0.1, or one that `ip address` shows.",
        ) from error
    sock = socket.socket(family, kind, protocol)
    try:
        if os.name == "nt":
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)  # type: ignore[attr-defined,unused-ignore]
        else:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # a restart need not wait for the last run's
        sock.bind(address)
        sock.listen(128)
        sock.setblocking(False)
    except OSError as error:
        sock.close()
        raise _cannot_listen(who, host, port, error) from error
    return sock


def _cannot_listen(who: str, host: str, port: int, error: OSError) -> LinkError:
    if error.errno == errno.EADDRINUSE:
        fix = f"end the program that uses it (`ss -tlnp | grep {port}` names it), or take another port."
    elif error.errno == errno.EACCES:
        fix = "a port above 1023."
    else:
        fix = "an address of this machine: 127.0.0.1, or one that `ip address` shows."
    return LinkError(f"{who} cannot listen on {host} port {port}: {error.strerror}.", fix=fix)


class ClientLink(StreamLink):
    """Calls, and calls again whenever the connection is gone."""

    factory: SocketsLoopFactory

    def _open(self) -> None:
        super()._open()
        self._call_s: float | None = 0.0  # when to call next; None while somebody does, or the line is open
        self._tries = 0
        self._up_s = 0.0
        self._calls = Calls(self.wake)
        self._luck = random.Random()  # not the run's chance: two clients must not call at the same moments

    @property
    def address(self) -> str:
        """Where it calls, in words."""
        return f"{self.factory.pair.host}:{self.factory.pair.port}"

    def _tend(self, now_s: float) -> None:
        if self._call_s is not None and now_s >= self._call_s:
            self._call_s = None
            self._calls.begin(self.factory.pair.host, self.factory.pair.port)
        super()._tend(now_s)

    def _look_around(self) -> None:
        super()._look_around()
        with suppress(Empty):
            answer = self._calls.answers.get_nowait()
            if isinstance(answer, socket.socket):
                self._connected(answer)
            else:
                self._call_again(f"waits for {self.address}: {answer}.")

    def _connected(self, sock: socket.socket) -> None:
        factory = self.factory
        name = None if factory.pair.tls is None else factory.pair.tls.server_name or factory.pair.host
        try:
            port = SocketPort(sock, factory.context, name)
        except OSError as error:
            sock.close()
            self._call_again(f"waits for {self.address}: {error}.")
            return
        self._up_s = self.get_time_s()
        self._add_stream(port, self.address)

    def _gone(self, stream: StreamPeer) -> None:
        if self.get_time_s() - self._up_s >= STEADY_S:
            self._tries = 0
        self._call_again(stream.session.reason)

    def _call_again(self, reason: str) -> None:
        self.reason = reason
        most_s = min(RETRY_MOST_S, RETRY_FIRST_S * 2.0**self._tries)
        self._tries = min(self._tries + 1, 30)
        self._call_s = self.get_time_s() + most_s * self._luck.uniform(0.5, 1.0)
        self._tend_s = min(self._tend_s, self._call_s)

    def halt(self) -> None:
        """Calls no more, and says goodbye."""
        self._calls.give_up()
        super().halt()


class Calls:
    """Resolves names and connects on threads of their own: both may hang for as long as they like.

    Args:
        tell: is called when there is an answer.
    """

    def __init__(self, tell: Callable[[], None]) -> None:
        self.answers: SimpleQueue[socket.socket | str] = SimpleQueue()
        self._tell = tell
        self._has_given_up = False

    def begin(self, host: str, port: int) -> None:
        """Begins to connect; the answer is a socket, or what went wrong."""
        threading.Thread(target=self._connect, args=(host, port), name=f"call {host}:{port}", daemon=True).start()

    def _connect(self, host: str, port: int) -> None:
        try:
            answer: socket.socket | str = socket.create_connection((host, port), CONNECT_TIMEOUT_S)
        except (OSError, UnicodeError) as error:  # a host of more than 63 characters without a dot is a UnicodeError
            answer = getattr(error, "strerror", None) or str(error)
        self.answers.put(answer)
        if self._has_given_up:
            self.give_up()
        else:
            self._tell()

    def give_up(self) -> None:
        """Wants no more answers; a socket that comes all the same is closed."""
        self._has_given_up = True
        with suppress(Empty):
            while True:
                answer = self.answers.get_nowait()
                if isinstance(answer, socket.socket):
                    answer.close()
