"""Sockets as ports, and their addresses: all that is specific to TCP and TLS about a stream of bytes."""

from __future__ import annotations

import errno
import os
import socket
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from snr_sim.core.loop import LoopFactory
from snr_sim.prelude.errors import LinkError

if TYPE_CHECKING:
    import ssl

# Codes of X509_verify_cert, from OpenSSL's x509_vfy.h.
_CERTIFICATES = {
    9: "the other end's certificate is not valid yet. Try: set both clocks",
    10: "the other end's certificate has expired. Try: a new one there; or are both clocks right?",
    62: "the other end's certificate is for another name. Try: Tls(server_name=...) with the name that it is for",
    64: "the other end's certificate is for another address. Try: Tls(server_name=...) with the name that it is for",
}
_UNKNOWN_AUTHORITY = (
    "the other end's certificate is not signed by the authority this end trusts. Try: the authority= that signed it"
)
_NO_TLS = "this end speaks TLS, the other does not. Try: tls=Tls(...) on both ends"
# Bytes that are not TLS cause different errors, depending on OpenSSL's version and on the bytes.
_NO_TLS_REASONS = (
    "BAD_RECORD_TYPE HTTP_REQUEST PACKET_LENGTH_TOO_LONG RECORD_LAYER_FAILURE UNKNOWN_PROTOCOL WRONG_VERSION_NUMBER"
)
_REASONS = dict.fromkeys(_NO_TLS_REASONS.split(), _NO_TLS) | {
    "PEER_DID_NOT_RETURN_A_CERTIFICATE": (
        "the client shows no certificate. Try: Tls(client_certificate=..., client_key=...) there"
    )
}
_REJECTED = "the other end does not take this end's certificate. Try: what the other end says about it"


@dataclass
class Address:
    """Address of a server."""

    host: str  # the only host it binds to
    port: int  # 0 takes a free one; once the server listens, this is the actual port

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


class Addressed:
    """What has the address of a server."""

    address: Address

    @property
    def host(self) -> str:
        """Host name or address for clients."""
        return self.address.host

    @property
    def port(self) -> int:
        """Port of the server; if 0 was requested, the actual one once it listens."""
        return self.address.port


class SocketPort:
    """A connected socket, with or without TLS, as a non-blocking stream of bytes.

    With TLS, the certificate of the other end must contain `server_name`, which is None on the server's side.
    """

    def __init__(self, sock: socket.socket, context: ssl.SSLContext | None = None, server_name: str | None = None):
        sock.setblocking(False)
        with suppress(OSError):  # not every socket family supports it
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # Whether one thread may write while another reads, and `select` shows all that arrived: not so with OpenSSL.
        self.is_shareable: bool = context is None
        self._sock = sock
        self._blocked: tuple[type[Exception], ...] = ()
        self._broken: tuple[type[ssl.SSLError], ...] = ()
        if context is not None:
            import ssl  # imported only by links with TLS

            self._blocked = (ssl.SSLWantReadError, ssl.SSLWantWriteError)
            self._broken = (ssl.SSLError,)
            self._sock = context.wrap_socket(
                sock, server_side=server_name is None, server_hostname=server_name, do_handshake_on_connect=False
            )

    def fileno(self) -> int:
        """Return the descriptor that `select` waits for."""
        return self._sock.fileno()

    def read(self, max_bytes: int) -> bytes:
        """Return what has arrived, b"" at the end; raise BlockingIOError if nothing has, OSError if it broke."""
        if self.is_shareable:
            return self._sock.recv(max_bytes)
        chunks: list[bytes] = []
        try:
            # A TLS record has at most 16 KiB, a frame may have more.
            while (left := max_bytes - sum(map(len, chunks))) > 0:
                chunks.append(self._sock.recv(left))
                if not chunks[-1]:
                    break
        except self._blocked:
            if not chunks:
                raise BlockingIOError from None
        except self._broken as error:
            raise OSError(describe_tls_error(error)) from None
        return b"".join(chunks)

    def has_more(self) -> bool:
        """Whether there are bytes to read that `select` does not show: those in the buffer of TLS."""
        return not self.is_shareable and self._sock.pending() > 0  # type: ignore[attr-defined]

    def write(self, data: bytes | memoryview) -> int:
        """Send what fits and return how much; raise BlockingIOError if nothing does, OSError if it broke."""
        try:
            return self._sock.send(data)
        except self._blocked:
            raise BlockingIOError from None
        except self._broken as error:
            raise OSError(describe_tls_error(error)) from None

    def end_writing(self) -> None:
        """Signal the end of the stream to the peer."""
        if self.is_shareable:
            self._sock.shutdown(socket.SHUT_WR)
        else:
            socket.socket.shutdown(self._sock, socket.SHUT_WR)  # shutdown() of TLS would also end reading

    def close(self) -> None:
        """Close the socket."""
        self._sock.close()


def describe_tls_error(error: ssl.SSLError) -> str:
    """Return what happened and what to try, followed by OpenSSL's text in parentheses."""
    openssl = (error.strerror or str(error)).partition(" (_ssl.c")[0]
    name = getattr(error, "reason", None) or ""  # only errors raised by OpenSSL have one
    code = getattr(error, "verify_code", None)
    if code is not None:
        words = _CERTIFICATES.get(code, _UNKNOWN_AUTHORITY)
    elif "ALERT" in name and any(part in name for part in ("CERTIFICATE", "UNKNOWN_CA")):
        words = _REJECTED
    else:
        words = _REASONS.get(name, "")
    return f"{words} ({openssl})" if words else openssl


class ListenerFactory(Addressed, LoopFactory):
    """Makes a loop that listens at an address; the socket may be opened before the loop exists. A PortFactory.

    If the port is 0, the actual one is stored in the address. `who` names the user of the port in error messages.
    """

    def __init__(self, address: Address, who: str) -> None:
        super().__init__()
        self.address = address
        self._who = who
        self._held: socket.socket | None = None

    def claim(self) -> None:
        """Listen before the loop exists; see PortFactory.

        Raises:
            LinkError: the port is taken, or the host is not this machine.
        """
        if self._held is None:
            self._held = listen(self.host, self.port, self._who)
            self.address.port = self._held.getsockname()[1]

    def release(self) -> None:
        """Close the port, if no loop has taken it; see PortFactory. Safe to call twice."""
        if self._held is not None:
            self._held.close()
            self._held = None

    def listener(self) -> socket.socket:
        """Return the listening socket, which the loop has to close; it is claimed now if it was not before."""
        self.claim()
        held, self._held = self._held, None
        assert held is not None
        return held


def listen(host: str, port: int, who: str = "A link") -> socket.socket:
    """Return a socket that listens at one address; `who` names its user in error messages.

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
