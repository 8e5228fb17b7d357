"""ZenohNet: links for several robots and several networks, over Zenoh. Every node of a net hears every other.

    net = ZenohNet(name="fleet", listen=["tls/192.168.2.1:7447"], tls=Tls(...))       # on shore
    net = ZenohNet(name="fleet", robot="rov1", connect=["tls/192.168.2.1:7447"], tls=Tls(...))
    Config(factories={"auv": [net.link("depth", accept=["mission"])]})

Whoever listens also passes on what it hears, so nodes that cannot reach each other meet through one that both can.
Under a SimClock the links of one ZenohNet meet in memory. `docs/formats.md` says which keys Zenoh sees.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.links.faults import Faults
from snr_sim.links.fleet import Hearing, Member, SimulatedFleet, prefix_of
from snr_sim.links.frames import MAX_FRAME_BYTES
from snr_sim.links.link import Link
from snr_sim.links.messages import MAX_NAME_CHARS
from snr_sim.links.options import LinkOptions
from snr_sim.links.security import Tls, is_loopback
from snr_sim.links.send_queue import Policy
from snr_sim.links.simulated import Meeting
from snr_sim.links.zenoh_link import ZenohTransport
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.page import DataKey

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


class ZenohNet:
    """A net of nodes, which may be on several robots.

    Args:
        listen: addresses of this machine where others may connect; no others are opened.
        connect: addresses of those that listen; they may come and go.
        name: of the net: the link is component and page `link_<name>`, and nets of different names never meet.
        robot: the robot this program runs on, if it is one of several; a node stands for itself if not given.
        tls: certificates, needed beyond this machine. Each side shows one: a listener needs `certificate`, `key` and
            `client_authority`; who connects needs `authority`, `client_certificate` and `client_key`.
        discover: whether to look for others by multicast.
        interfaces: where to look; loopback if not given.
        max_page_bytes: the longest page.
        queue_pages: how many pages may wait to be sent, and as many to be let in.
        policy: what happens when more would: "drop_oldest", or "refuse" the newest.
        faults: what is to go wrong on the way.
        keep_alive_s: how often each node asks which others are there.
        timeout_s: after how much silence one counts as gone.

    Raises:
        ConfigError: a name or an address is none, or an address is open to anybody.
    """

    def __init__(
        self,
        *,
        listen: str | Iterable[str] = (),
        connect: str | Iterable[str] = (),
        name: str = "zenoh",
        robot: str = "",
        tls: Tls | None = None,
        discover: bool = False,
        interfaces: Iterable[str] = ("lo",),
        max_page_bytes: int = MAX_FRAME_BYTES,
        queue_pages: int = 10_000,
        policy: Policy = "drop_oldest",
        faults: Faults | None = None,
        keep_alive_s: float = 0.5,
        timeout_s: float = 3.0,
    ) -> None:
        self.name = _as_name("name", name)
        self.robot = _as_name("robot", robot) if robot else ""
        self.tls = tls
        self.listen = as_endpoints("listen=", listen, tls)
        self.connect = as_endpoints("connect=", connect, tls)
        self.interfaces = (interfaces,) if isinstance(interfaces, str) else tuple(interfaces)
        self.discover = discover
        self.meeting: Meeting[SimulatedFleet] = Meeting()
        self.options = LinkOptions(
            name,
            max_frame_bytes=max_page_bytes,
            queue_pages=queue_pages,
            policy=policy,
            keep_alive_s=keep_alive_s,
            timeout_s=timeout_s,
            faults=faults,
        )

    def link(
        self,
        keys: DataKey | Iterable[DataKey] = (),
        accept: Iterable[DataKey] | None = None,
        *,
        robots: str | Iterable[str] | None = None,
        apart: bool = False,
        robot: str | None = None,
        listen: str | Iterable[str] | None = None,
        connect: str | Iterable[str] | None = None,
    ) -> ZenohLinkFactory:
        """Return the factory of a node's link to all others of the net.

        Args:
            keys: pages of these go to all others.
            accept: pages of these may come in; any if not given.
            robots: whose pages may come in; every robot's if not given.
            apart: have pages of other robots come in as `<robot>/<key>`, so that `depth` of one does not take the
                place of `depth` of another.
            robot, listen, connect: of this node, if other than the net's: so that one net serves a whole config.

        Raises:
            ConfigError: as for the net; or certificates are missing, or this node could meet nobody.
        """
        return ZenohLinkFactory(
            self,
            self.options.for_end(keys, accept),
            Hearing(None if robots is None else frozenset([robots] if isinstance(robots, str) else robots), apart),
            self.robot if robot is None else _as_name("robot", robot),
            self.listen if listen is None else as_endpoints("listen=", listen, self.tls),
            self.connect if connect is None else as_endpoints("connect=", connect, self.tls),
        )


def _as_name(what: str, name: str) -> str:
    if not isinstance(name, str) or not 0 < len(name) <= MAX_NAME_CHARS:
        raise ConfigError(f"A net's {what} is {str(name)[:80]!r}.", fix=f"1 to {MAX_NAME_CHARS} characters.")
    return name


class ZenohLinkFactory(LoopFactory):
    """Makes a node's link to a net. Nothing is open on the network that was not asked for.

    Args:
        net: whose certificates, interfaces and limits it has.
        options: of the link.
        hearing: what the node wants to hear.
        robot: it belongs to, or "".
        listen: addresses it opens.
        connect: addresses it calls, again and again.

    Raises:
        ConfigError: certificates are missing, or it could meet nobody.
    """

    def __init__(
        self,
        net: ZenohNet,
        options: LinkOptions,
        hearing: Hearing,
        robot: str,
        listen: tuple[str, ...],
        connect: tuple[str, ...],
    ) -> None:
        super().__init__()
        self.net = net
        self.options = options
        self.hearing = hearing
        self.robot = robot
        self.listen = listen
        self.connect = connect
        if not (self.listen or self.connects):
            raise ConfigError(
                "A node of a net neither listens nor connects, so it would meet nobody.",
                fix='listen="tcp/127.0.0.1:7447" for one node, connect="tcp/127.0.0.1:7447" for the others.',
            )
        if self.discovers_abroad and self.net.tls is None:
            where = ", ".join(self.net.interfaces)
            raise ConfigError(
                f"discover=True on {where} without TLS: whoever answers could steer this node.",
                fix="tls=Tls(...) with certificates for both sides, or interfaces=['lo'].",
            )
        if self.net.tls is not None:
            _check_tls(self.net.tls, bool(self.listen), self.connects)

    def get(self, parent: NodeApi) -> Loop:
        """Return the link."""
        member = Member(self.robot or parent.name, parent.name)
        return Link(
            self,
            parent,
            self.options,
            real=lambda link: ZenohTransport(link, member, self.hearing, self.config(), self.waits_for),
            simulated=lambda link: SimulatedFleet(link, member, self.hearing, self.net.meeting),
        )

    @property
    def connects(self) -> bool:
        """Whether it calls anybody."""
        return bool(self.connect) or self.net.discover

    @property
    def discovers_abroad(self) -> bool:
        """Whether it looks for others beyond this machine."""
        return self.net.discover and not LOOPBACK_INTERFACES.issuperset(self.net.interfaces)

    @property
    def waits_for(self) -> str:
        """Whom it connects to, in words; "" if it listens itself."""
        return "" if self.listen else ", ".join(self.connect) or "anybody to be discovered"

    def config(self) -> dict[str, Any]:
        """Return Zenoh's configuration: no keys but the net's get in or out."""
        protocols = [address.partition("/")[0] for address in (*self.listen, *self.connect)]
        timeout_ms, stuck_us = int(self.net.options.timeout_s * 1000), int(STUCK_S * 1e6)
        return {
            # Between those connected to a router it passes on, which it does not between peers. Who does not listen is
            # a client and no router, because routers miss who comes within 0.1 s of another's going (1.10).
            "mode": "router" if self.listen else "client",
            "listen": {"endpoints": list(self.listen), "timeout_ms": 0, "exit_on_failure": True},
            "connect": {
                "endpoints": list(self.connect),
                # For ever, in the background; but a client would block for so long, so its link tries again itself.
                "timeout_ms": -1 if self.listen else 0,
                "exit_on_failure": not self.listen,
                "retry": {"period_init_ms": 50, "period_max_ms": 1000, "period_increase_factor": 2},
            },
            "scouting": {
                "delay": 0,
                "timeout": int(SCOUT_S * 1000),
                "multicast": {
                    "enabled": self.net.discover,
                    "interface": ",".join(self.net.interfaces),
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
                    "rx": {"max_message_size": self.net.options.max_frame_bytes + MESSAGE_EXTRA_BYTES},
                    **({} if self.net.tls is None else {"tls": _tls(self.net.tls, bool(self.listen), self.connects)}),
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
                        "key_exprs": [f"{prefix_of(self.net.name)}/**"],
                    }
                ],
                "subjects": [{"id": "all"}],
                "policies": [{"rules": ["net"], "subjects": ["all"]}],
            },
        }


def as_endpoints(what: str, endpoints: str | Iterable[str], tls: Tls | None) -> tuple[str, ...]:
    """Return addresses, checked: beyond this machine, only TLS with certificates on both sides is good enough.

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
        if match["protocol"] == "tcp" and not is_loopback(match["host"].strip("[]")):
            raise ConfigError(
                f"{what} holds {text}: without TLS, anybody in that network could steer this node.",
                fix=f'"tls/{text.removeprefix("tcp/")}" and tls=Tls(...) with certificates for both sides.',
            )
        if match["protocol"] == "tls" and tls is None:
            raise ConfigError(f"{what} holds {text}, and there is no tls=.", fix="tls=Tls(...).")
        found.append(text)
    return tuple(found)


def _tls(tls: Tls, listens: bool, connects: bool) -> dict[str, Any]:
    """Return Zenoh's names for the certificates. It takes one authority for both sides."""
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
