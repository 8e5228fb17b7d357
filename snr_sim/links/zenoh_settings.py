"""ZenohSettings: what Zenoh is told, from what a ZenohNet is told. Nothing is open that was not asked for."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from snr_sim.links.security import Tls, is_loopback
from snr_sim.prelude.errors import ConfigError

LOOPBACK_INTERFACES = frozenset({"lo", "lo0"})
# A far end that reads nothing for so long gets no more until it does, and misses what is sent meanwhile. Until then it
# holds up the pages to all others: Zenoh sends to one after the other.
STUCK_S = 1.0
SCOUT_S = 1.0  # how long who does not listen looks for others at a time
MESSAGE_EXTRA_BYTES = 1 << 12  # what Zenoh itself may add to a page
_ENDPOINT = re.compile(r"(?P<protocol>[a-z]+)/(?P<host>\[[^\]]+\]|[^:/\[\]]+):(?P<port>\d{1,5})")
_ALL_MESSAGES = (
    "put",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
)


@dataclass(frozen=True)
class Endpoint:
    """An address as Zenoh writes it: tcp/127.0.0.1:7447.

    Args:
        text: all of it.
        protocol: "tcp" or "tls".
        host: without brackets.
    """

    text: str
    protocol: str
    host: str


def as_endpoints(what: str, endpoints: str | Iterable[str], tls: Tls | None) -> tuple[Endpoint, ...]:
    """Returns addresses, checked: beyond this machine, only TLS with certificates on both sides is good enough.

    Raises:
        ConfigError: one is no address, or anybody could listen in there.
    """
    found = []
    for text in [endpoints] if isinstance(endpoints, str) else endpoints:
        match = _ENDPOINT.fullmatch(text) if isinstance(text, str) else None
        if match is None or match["protocol"] not in ("tcp", "tls") or int(match["port"]) >= 1 << 16:
            raise ConfigError(
                f"{what} holds {text!r}, which is no address.", fix='"tcp/127.0.0.1:7447" or "tls/192.168.2.1:7447".'
            )
        endpoint = Endpoint(text, match["protocol"], match["host"].strip("[]"))
        if endpoint.protocol == "tcp" and not is_loopback(endpoint.host):
            raise ConfigError(
                f"{what} holds {text}: without TLS, anybody in that network could steer this node.",
                fix=f'"tls/{text.removeprefix("tcp/")}" and tls=Tls(...) with certificates for both sides.',
            )
        if endpoint.protocol == "tls" and tls is None:
            raise ConfigError(f"{what} holds {text}, and there is no tls=.", fix="tls=Tls(...).")
        found.append(endpoint)
    return tuple(found)


@dataclass(frozen=True)
class ZenohSettings:
    """What one node of a net may do on the network.

    Args:
        listen: addresses it opens.
        connect: addresses it calls, again and again.
        tls: certificates.
        discover: whether it looks for others by multicast.
        interfaces: where it looks.
        max_page_bytes: the longest page.
        timeout_s: after how much silence a connection counts as broken.

    Raises:
        ConfigError: certificates are missing, or it could meet nobody.
    """

    listen: tuple[Endpoint, ...]
    connect: tuple[Endpoint, ...]
    tls: Tls | None
    discover: bool
    interfaces: tuple[str, ...]
    max_page_bytes: int
    timeout_s: float

    def __post_init__(self) -> None:
        if not (self.listen or self.connects):
            raise ConfigError(
                "A node of a net neither listens nor connects, so it would meet nobody.",
                fix='listen="tcp/127.0.0.1:7447" for one node, connect="tcp/127.0.0.1:7447" for the others.',
            )
        if self.discovers_abroad and self.tls is None:
            raise ConfigError(
                f"discover=True on {', '.join(self.interfaces)} without TLS: whoever answers could steer this node.",
                fix="tls=Tls(...) with certificates for both sides, or interfaces=['lo'].",
            )
        if self.tls is not None:
            _check_tls(self.tls, bool(self.listen), self.connects)

    @property
    def connects(self) -> bool:
        """Whether it calls anybody."""
        return bool(self.connect) or self.discover

    @property
    def discovers_abroad(self) -> bool:
        """Whether it looks for others beyond this machine."""
        return self.discover and not LOOPBACK_INTERFACES.issuperset(self.interfaces)

    def config(self, prefix: str) -> dict[str, Any]:
        """Returns Zenoh's configuration.

        Args:
            prefix: of all keys this net has to do with; nothing else gets in or out.
        """
        protocols = [each.protocol for each in (*self.listen, *self.connect)]
        timeout_ms, stuck_us = int(self.timeout_s * 1000), int(STUCK_S * 1e6)
        return {
            # Between those connected to a router it passes on, which it does not between peers. Who does not listen is
            # a client and no router, because routers miss who comes within 0.1 s of another's going (1.10).
            "mode": "router" if self.listen else "client",
            "listen": {"endpoints": [each.text for each in self.listen], "timeout_ms": 0, "exit_on_failure": True},
            "connect": {
                "endpoints": [each.text for each in self.connect],
                # For ever, in the background; but a client would block for so long, so its link tries again itself.
                "timeout_ms": -1 if self.listen else 0,
                "exit_on_failure": not self.listen,
                "retry": {"period_init_ms": 50, "period_max_ms": 1000, "period_increase_factor": 2},
            },
            "scouting": {
                "delay": 0,
                "timeout": int(SCOUT_S * 1000),
                "multicast": {
                    "enabled": self.discover,
                    "interface": ",".join(self.interfaces),
                    "autoconnect": {"router": ["router"], "client": ["router"]},
                },
                "gossip": {"enabled": False},
            },
            "transport": {
                "unicast": {"open_timeout": timeout_ms, "accept_timeout": timeout_ms},
                "link": {
                    # Not what whoever answers a multicast may offer.
                    "protocols": ["tls"] if self.discovers_abroad else sorted({*protocols} or {"tcp"}),
                    "tx": {
                        "lease": timeout_ms,
                        "queue": {
                            "congestion_control": {
                                "drop": {"wait_before_drop": stuck_us, "max_wait_before_drop_fragments": stuck_us},
                                "block": {"wait_before_close": stuck_us},
                            }
                        },
                    },
                    "rx": {"max_message_size": self.max_page_bytes + MESSAGE_EXTRA_BYTES},
                    **({} if self.tls is None else {"tls": _tls(self.tls, bool(self.listen), self.connects)}),
                },
                "shared_memory": {"enabled": False},
            },
            "access_control": {
                "enabled": True,
                "default_permission": "deny",
                "rules": [
                    {
                        "id": "net",
                        "permission": "allow",
                        "messages": list(_ALL_MESSAGES),
                        "flows": ["ingress", "egress"],
                        "key_exprs": [f"{prefix}/**"],
                    }
                ],
                "subjects": [{"id": "all"}],
                "policies": [{"rules": ["net"], "subjects": ["all"]}],
            },
        }


def _tls(tls: Tls, listens: bool, connects: bool) -> dict[str, Any]:
    """Returns Zenoh's names for the certificates. It takes one authority for both sides."""
    return {
        "root_ca_certificate": str(tls.client_authority or tls.authority),
        "enable_mtls": True,
        "verify_name_on_connect": True,
        **({"listen_certificate": str(tls.certificate), "listen_private_key": str(tls.key)} if listens else {}),
        **(
            {
                "connect_certificate": str(tls.client_certificate),
                "connect_private_key": str(tls.client_key),
            }
            if connects
            else {}
        ),
    }


def _check_tls(tls: Tls, listens: bool, connects: bool) -> None:
    if listens:
        if tls.client_authority is None:
            raise ConfigError(
                "A net that listens with TLS takes only those who show a certificate, and knows no authority for them.",
                fix="Tls(certificate=..., key=..., client_authority=...).",
            )
        tls.server_context()  # says what is wrong with the files, in words
    if connects:
        if tls.client_certificate is None:
            raise ConfigError(
                "A net that connects with TLS has to show a certificate.",
                fix="Tls(authority=..., client_certificate=..., client_key=...).",
            )
        tls.client_context()
    if listens and connects and str(tls.authority) != str(tls.client_authority):
        raise ConfigError(
            "A net that listens and connects has two authorities, and Zenoh takes one.",
            fix="one authority for all certificates of a net: Tls(authority=A, client_authority=A, ...).",
        )
    if tls.server_name:
        raise ConfigError(
            f"A net with server_name='{tls.server_name}': Zenoh expects the name it calls in the certificate.",
            fix="that name in connect=.",
        )
