"""ZenohNet: links between nodes on several robots and networks, over Zenoh. Every node of a net receives every other.

    net = ZenohNet(name="fleet", listen=["tls/192.168.2.1:7447"], tls=Tls(...))       # on shore
    net = ZenohNet(name="fleet", robot="rov1", connect=["tls/192.168.2.1:7447"], tls=Tls(...))
    Config(factories={"auv": [net.link("depth", accept=["mission"])]})

Listening nodes also forward what they receive, so nodes that cannot reach each other communicate through a third one.
Under a SimClock, the links of one ZenohNet exchange pages in memory. `docs/formats.md` lists the keys that Zenoh sees.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.links.faults import LinkFaults
from snr_sim.links.fleet import Member, SimulatedFleet, Subscription, prefix_of
from snr_sim.links.frames import MAX_FRAME_BYTES
from snr_sim.links.link import Link
from snr_sim.links.messages import MAX_NAME_CHARS
from snr_sim.links.options import MAX_HELD_BYTES, LinkOptions
from snr_sim.links.queues import Policy
from snr_sim.links.security import Tls, is_loopback
from snr_sim.links.simulated import Rendezvous
from snr_sim.links.zenoh_link import ZenohTransport
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import DataKey

LOOPBACK_INTERFACES = frozenset({"lo", "lo0"})
# A remote peer that has not read for this long is sent nothing until it reads again, and misses the pages in between.
# Until then it delays the pages to all others: Zenoh sends to one peer after the other.
STUCK_S = 1.0
SCOUT_S = 1.0  # duration of one scouting attempt of a node that does not listen
MESSAGE_EXTRA_BYTES = 1 << 12  # overhead that Zenoh may add to a page
_LOCATOR = re.compile(r"(?P<protocol>[a-z]+)/(?P<host>\[[^\]]+\]|[^:/\[\]]+):(?P<port>\d{1,5})")
_ALL_MESSAGES = (
    "put query reply declare_subscriber declare_queryable "
    "liveliness_token liveliness_query declare_liveliness_subscriber"
)


class ZenohNet:
    """Net of nodes, on one robot or several.

    Args:
        listen: addresses of this machine where others may connect; no other address is opened.
        connect: addresses of listening nodes, which may come and go.
        name: of the net: the link is component and page `link_<name>`; nets of different names never exchange pages.
        robot: the robot this program runs on, if there are several; else each node counts as a robot of its own.
        tls: certificates, required beyond this machine. Both sides need one: a listener needs `certificate`, `key` and
            `client_authority`; a connecting node needs `authority`, `client_certificate` and `client_key`.
        discover: whether to search for other nodes by multicast.
        interfaces: network interfaces for discovery; loopback if not given.
        max_page_bytes: maximum size of a page.
        max_held_bytes: maximum memory of the newest pages of all keys, of links without `accept`; see LinkOptions.
        queue_pages: maximum number of pages that wait to be sent, and of pages that wait to be stored.
        policy: what happens when the queue is full: "drop_oldest", or "refuse" the newest.
        faults: faults to inject in what is sent.
        keep_alive_s: period between pings to the other nodes.
        timeout_s: silence after which a node counts as gone.

    Raises:
        ConfigError: a name or an address is invalid, or an address would accept any client in the network.
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
        max_held_bytes: int = MAX_HELD_BYTES,
        queue_pages: int = 10_000,
        policy: Policy = "drop_oldest",
        faults: LinkFaults | None = None,
        keep_alive_s: float = 0.5,
        timeout_s: float = 3.0,
    ) -> None:
        self.name: str = _as_name("name", name)
        self.robot: str = _as_name("robot", robot) if robot else ""
        self.tls: Tls | None = tls
        self.listen: tuple[str, ...] = parse_locators("listen=", listen, tls)
        self.connect: tuple[str, ...] = parse_locators("connect=", connect, tls)
        self.interfaces: tuple[str, ...] = (interfaces,) if isinstance(interfaces, str) else tuple(interfaces)
        self.discover: bool = discover
        self.rendezvous: Rendezvous[SimulatedFleet] = Rendezvous()
        self.options: LinkOptions = LinkOptions(
            name,
            max_frame_bytes=max_page_bytes,
            max_held_bytes=max_held_bytes,
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
        namespaced: bool = False,
        robot: str | None = None,
        listen: str | Iterable[str] | None = None,
        connect: str | Iterable[str] | None = None,
    ) -> ZenohLinkFactory:
        """Return the factory of a node's link to all others of the net.

        Args:
            keys: pages of these keys are sent to all others.
            accept: keys of the pages to accept; any if not given.
            robots: robots whose pages to accept; every robot's if not given.
            namespaced: store pages of other robots as `<robot>/<key>`, so that `depth` of one does not replace `depth`
                of another.
            robot, listen, connect: of this node, if they differ from the net's, so that one net serves a whole config.

        Raises:
            ConfigError: as for the net; or certificates are missing, or this node could reach no other.
        """
        accepted = None if robots is None else frozenset([robots] if isinstance(robots, str) else robots)
        return ZenohLinkFactory(
            self,
            self.options.for_end(keys, accept),
            Subscription(accepted, namespaced),
            self.robot if robot is None else _as_name("robot", robot),
            self.listen if listen is None else parse_locators("listen=", listen, self.tls),
            self.connect if connect is None else parse_locators("connect=", connect, self.tls),
        )


def _as_name(what: str, name: str) -> str:
    if not isinstance(name, str) or not 0 < len(name) <= MAX_NAME_CHARS:
        raise ConfigError(
            f"{str(name)[:80]!r} is not a valid {what} of a net.", fix=f"use 1 to {MAX_NAME_CHARS} characters."
        )
    return name


@dataclass(eq=False, repr=False)
class ZenohLinkFactory(LoopFactory):
    """Makes a node's link to a net; see `ZenohNet.link`. Opens nothing on the network that was not requested."""

    net: ZenohNet
    options: LinkOptions
    subscription: Subscription
    robot: str
    listen: tuple[str, ...]
    connect: tuple[str, ...]

    def __post_init__(self) -> None:
        super().__init__()
        net = self.net
        self._connects = bool(self.connect) or net.discover
        self._discovers_remotely = net.discover and not LOOPBACK_INTERFACES.issuperset(net.interfaces)
        if not (self.listen or self._connects):
            raise ConfigError(
                "A node of a net neither listens nor connects, so no other node can reach it.",
                fix='listen="tcp/127.0.0.1:7447" for one node, connect="tcp/127.0.0.1:7447" for the others.',
            )
        if self._discovers_remotely and net.tls is None:
            where = ", ".join(net.interfaces)
            raise ConfigError(
                f"discover=True on {where} needs TLS: without it, any node that answers could control this one.",
                fix="tls=Tls(...) with certificates for both sides, or interfaces=['lo'].",
            )
        if net.tls is not None:
            _check_tls(net.tls, bool(self.listen), self._connects)

    def get(self, parent: NodeApi) -> Loop:
        """Return the link."""
        member = Member(self.robot or parent.name, parent.name)
        waits_for = "" if self.listen else ", ".join(self.connect) or "a node to be discovered"
        return Link(
            self,
            parent,
            self.options,
            real=lambda link: ZenohTransport(link, member, self.subscription, self.config(), waits_for),
            simulated=lambda link: SimulatedFleet(link, member, self.subscription, self.net.rendezvous),
        )

    def config(self) -> dict[str, Any]:
        """Return Zenoh's configuration, which admits only the net's keys in either direction."""
        protocols = {address.partition("/")[0] for address in (*self.listen, *self.connect)} or {"tcp"}
        timeout_ms, stuck_us = int(self.net.options.timeout_s * 1000), int(STUCK_S * 1e6)
        drop = {"wait_before_drop": stuck_us, "max_wait_before_drop_fragments": stuck_us}
        congestion_control = {"drop": drop, "block": {"wait_before_close": stuck_us}}
        return {
            # A router forwards between the nodes connected to it; peers do not forward. A node that does not listen is
            # a client, not a router, because routers miss a node that appears within 0.1 s of another's leaving (1.10).
            "mode": "router" if self.listen else "client",
            "listen": {"endpoints": list(self.listen), "timeout_ms": 0, "exit_on_failure": True},
            "connect": {
                "endpoints": list(self.connect),
                # -1: without limit, in the background. A client would block for that long, so its link retries itself.
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
                    # Limits what an answer to a multicast can offer.
                    "protocols": ["tls"] if self._discovers_remotely else sorted(protocols),
                    "tx": {"lease": timeout_ms, "queue": {"congestion_control": congestion_control}},
                    "rx": {"max_message_size": self.net.options.max_frame_bytes + MESSAGE_EXTRA_BYTES},
                    **({} if self.net.tls is None else {"tls": _tls(self.net.tls, bool(self.listen), self._connects)}),
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
                        "messages": _ALL_MESSAGES.split(),
                        "flows": ["ingress", "egress"],
                        "key_exprs": [f"{prefix_of(self.net.name)}/**"],
                    }
                ],
                "subjects": [{"id": "all"}],
                "policies": [{"rules": ["net"], "subjects": ["all"]}],
            },
        }


def parse_locators(what: str, endpoints: str | Iterable[str], tls: Tls | None) -> tuple[str, ...]:
    """Return the addresses after a check: beyond this machine, TLS with certificates on both sides is required.

    Raises:
        ConfigError: one is not an address, or would accept any client in the network.
    """
    found = []
    for text in [endpoints] if isinstance(endpoints, str) else endpoints:
        match = _LOCATOR.fullmatch(text) if isinstance(text, str) else None
        if match is None or match["protocol"] not in ("tcp", "tls") or int(match["port"]) >= 1 << 16:
            raise ConfigError(
                f"{what} holds {text!r}, which is not an address.",
                fix='"tcp/127.0.0.1:7447" or "tls/192.168.2.1:7447".',
            )
        if match["protocol"] == "tcp" and not is_loopback(match["host"].strip("[]")):
            raise ConfigError(
                f"{what} holds {text} without TLS: any computer in that network could steer this node.",
                fix=f'"tls/{text.removeprefix("tcp/")}" and tls=Tls(...) with certificates for both sides.',
            )
        if match["protocol"] == "tls" and tls is None:
            raise ConfigError(f"{what} holds {text}, and there is no tls=.", fix="tls=Tls(...).")
        found.append(text)
    return tuple(found)


def _tls(tls: Tls, listens: bool, connects: bool) -> dict[str, Any]:
    """Return the certificates under Zenoh's setting names. Zenoh takes one authority for both sides."""
    files = {"root_ca_certificate": tls.client_authority or tls.authority}
    if listens:
        files |= {"listen_certificate": tls.certificate, "listen_private_key": tls.key}
    if connects:
        files |= {"connect_certificate": tls.client_certificate, "connect_private_key": tls.client_key}
    paths = {name: str(path) for name, path in files.items()}
    return {"enable_mtls": True, "verify_name_on_connect": True, **paths}


def _check_tls(tls: Tls, listens: bool, connects: bool) -> None:
    if listens:
        if tls.client_authority is None:
            raise ConfigError(
                "A net that listens with TLS needs the authority of its clients' certificates.",
                fix="Tls(certificate=..., key=..., client_authority=...).",
            )
        tls.server_context()  # reports invalid files with a readable message
    if connects:
        if tls.client_certificate is None:
            raise ConfigError(
                "A net that connects with TLS needs a certificate.",
                fix="Tls(authority=..., client_certificate=..., client_key=...).",
            )
        tls.client_context()
    if listens and connects and str(tls.authority) != str(tls.client_authority):
        raise ConfigError(
            "A net that listens and connects has two authorities, but Zenoh accepts one.",
            fix="use one authority for all certificates of a net: Tls(authority=A, client_authority=A, ...).",
        )
    if tls.server_name:
        raise ConfigError(
            f"server_name='{tls.server_name}' cannot be used: Zenoh expects the address in the certificate.",
            fix="use that name in connect=.",
        )
