"""Access control of a node: shared secrets, addresses, certificates."""

from __future__ import annotations

import hmac
import ipaddress
import os
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from snr_sim.prelude.errors import ConfigError

if TYPE_CHECKING:
    import ssl

MIN_SECRET_BYTES = 16
FileName: TypeAlias = str | Path | None
Network: TypeAlias = ipaddress.IPv4Network | ipaddress.IPv6Network


def as_secret(secret: str | bytes | None, source: str = "secret=") -> bytes | None:
    """Return a shared secret as bytes; None stays None.

    Raises:
        ConfigError: it is neither text nor bytes, cannot be encoded, or is too short.
    """
    if secret is None:
        return None
    if not isinstance(secret, (str, bytes)):  # bytes(20) would be twenty zero bytes, which is not a secret
        raise ConfigError(
            f"The shared secret ({source}) is of type {type(secret).__name__}.",
            fix="text or bytes; secret_from_file(path) and secret_from_env(name) read one.",
        )
    try:
        raw = secret.encode() if isinstance(secret, str) else secret
    except UnicodeEncodeError as error:
        raise ConfigError(
            f"The shared secret ({source}) is not valid UTF-8 text: half a character at index {error.start}.",
            fix="use plain letters and digits, or bytes.",
        ) from None
    if len(raw) < MIN_SECRET_BYTES:
        raise ConfigError(
            f"The shared secret ({source}) has {len(raw)} bytes, but needs at least {MIN_SECRET_BYTES}.",
            fix='python3 -c "import secrets; print(secrets.token_hex(16))" makes a good one.',
        )
    return raw


def secret_from_file(path: str | Path) -> bytes:
    """Return the shared secret in a file, without white space around it.

    Raises:
        ConfigError: the file cannot be read, or its content is too short.
    """
    try:
        raw = Path(path).read_bytes().strip()
    except OSError as error:
        raise ConfigError(
            f"The file of the shared secret cannot be read: {path} ({error.strerror}).",
            fix="one line of text that both ends have, readable by you alone.",
        ) from error
    return as_secret(raw, f"file {path}") or b""


def secret_from_env(name: str) -> bytes:
    """Return the shared secret in an environment variable.

    Raises:
        ConfigError: the variable is not set, or its value is too short.
    """
    if name not in os.environ:
        raise ConfigError(
            f"The environment variable {name} should hold the shared secret, but is not set.",
            fix=f"export {name}=...  with the same text on both ends.",
        )
    return as_secret(os.environ[name], f"variable {name}") or b""


def derive_key(secret: bytes, use: str, client_hello: bytes, server_hello: bytes) -> bytes:
    """Return 32 bytes that only ends with this secret can compute, for one use in one session.

    The key depends on both greetings as they were sent, and so on purpose, names and nonces. So it is of no use in
    another session, at another port, or after a greeting was changed in transit.

    Args:
        use: "client proof", "server proof", "client frames" or "server frames". The sides differ, so that what one end
            sends cannot be sent back to it.
        client_hello, server_hello: frames of the greetings, including the length.
    """
    return hmac.digest(secret, f"snr 2 {use}\0".encode() + client_hello + server_hello, "sha256")


def as_networks(allow: Iterable[str]) -> tuple[Network, ...]:
    """Parse addresses and networks.

    Raises:
        ConfigError: one is neither.

    >>> as_networks(["10.0.0.7", "192.168.2.0/24"])
    (IPv4Network('10.0.0.7/32'), IPv4Network('192.168.2.0/24'))
    """
    fix = '["192.168.2.7"] or ["192.168.2.0/24"].'
    listed: Any = [allow] if isinstance(allow, str) else allow
    if not isinstance(listed, Iterable) or isinstance(listed, bytes):
        raise ConfigError(
            f"allow={allow!r} is not a list of addresses.", fix=f"{fix[:-1]}, or () for this machine alone."
        )
    networks = []
    for text in listed:
        try:
            if isinstance(text, (int, bytes)):  # which would be taken as the number of an address
                raise ValueError("it is not a string")
            networks.append(ipaddress.ip_network(text))
        except ValueError as error:
            raise ConfigError(
                f"allow= holds {text!r}, which is neither an address nor a network: {error}.",
                fix=fix,
            ) from error
    return tuple(networks)


def is_loopback(host: str) -> bool:
    """Return whether a host is this machine only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def as_host(address: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """Return a peer's address; that of IPv4 if it is mapped into IPv6; None if it is not an address.

    >>> as_host("::ffff:192.0.2.1"), as_host("fe80::1%eth0"), as_host("localhost")
    (IPv4Address('192.0.2.1'), IPv6Address('fe80::1'), None)
    """
    try:
        host = ipaddress.ip_address(address.partition("%")[0])  # an IPv6 address may name its interface
    except ValueError:
        return None
    return getattr(host, "ipv4_mapped", None) or host


def is_allowed(address: str, networks: Iterable[Network]) -> bool:
    """Return whether a peer's address is this machine's own or in one of the networks."""
    peer = as_host(address)
    return peer is not None and (peer.is_loopback or any(peer in network for network in networks))


@dataclass(frozen=True)
class Tls:
    """Certificates for links over TCP. Files in PEM; only those are needed that an end uses.

    Args:
        certificate: of the server, with the chain up to its authority.
        key: of that certificate.
        authority: signed the server's certificate; clients trust no other.
        server_name: the name that clients expect in the certificate; the host they call if not given.
        client_authority: signed the clients' certificates; if given, a server accepts only clients that have one.
        client_certificate: of the client.
        client_key: of that certificate.

    Raises:
        ConfigError: a value is not a file name.
    """

    certificate: FileName = None
    key: FileName = None
    authority: FileName = None
    server_name: str = ""
    client_authority: FileName = None
    client_certificate: FileName = None
    client_key: FileName = None

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, (str, Path)) and not (value is None and field.name != "server_name"):
                what = (
                    "the name in the server's certificate" if field.name == "server_name" else "the path of a PEM file"
                )
                raise ConfigError(f"Tls {field.name} is {value!r}.", fix=f"use {what}.")

    def server_context(self) -> ssl.SSLContext:
        """Return the context of a server.

        Raises:
            ConfigError: a file is missing or invalid.
        """
        if self.certificate is None:
            raise ConfigError("A server with TLS needs a certificate.", fix="Tls(certificate=..., key=...).")
        return _context(True, self.certificate, self.key, self.client_authority)

    def client_context(self) -> ssl.SSLContext:
        """Return the context of a client.

        Raises:
            ConfigError: a file is missing or invalid.
        """
        if self.authority is None:
            raise ConfigError(
                "A client with TLS needs the authority that signed the server's certificate.", fix="Tls(authority=...)."
            )
        return _context(False, self.client_certificate, self.client_key, self.authority)


def _context(is_server: bool, certificate: FileName, key: FileName, authority: FileName) -> ssl.SSLContext:
    """Return a context with our own certificate and the authority to trust, as far as they are given."""
    import ssl  # takes 10 ms, and most links do not use TLS

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER if is_server else ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        if certificate is not None:
            context.load_cert_chain(certificate, key)
        if authority is not None:
            context.load_verify_locations(authority)
            context.verify_mode = ssl.CERT_REQUIRED
    except OSError as error:
        names = ", ".join(str(path) for path in (certificate, key, authority) if path is not None)
        raise ConfigError(
            f"TLS cannot use its files ({names}): {error.strerror or error}.",
            fix="use readable PEM files; the key must belong to the certificate.",
        ) from error
    return context
