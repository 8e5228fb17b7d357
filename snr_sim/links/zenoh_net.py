"""ZenohNet: links for several robots and several networks, over Zenoh. Every node of a net hears every other.

    net = ZenohNet(name="fleet", listen=["tls/192.168.2.1:7447"], tls=Tls(...))       # on shore
    net = ZenohNet(name="fleet", robot="rov1", connect=["tls/192.168.2.1:7447"], tls=Tls(...))
    Config(factories={"auv": [net.link("depth", accept=["mission"])]})

Whoever listens also passes on what it hears, so nodes that cannot reach each other meet through one that both can.
Under a SimClock the links of one ZenohNet meet in memory. `docs/formats.md` says which keys Zenoh sees.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from snr_sim.core.clocks import SimClock
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.links.faults import Faults
from snr_sim.links.fleet import Hearing, Member
from snr_sim.links.frames import MAX_FRAME_BYTES
from snr_sim.links.messages import MAX_NAME_CHARS
from snr_sim.links.options import LinkOptions, as_keys
from snr_sim.links.security import Tls
from snr_sim.links.send_queue import Policy
from snr_sim.links.simulated_fleet import Gathering, SimulatedFleetLink
from snr_sim.links.zenoh_link import ZenohLink
from snr_sim.links.zenoh_settings import ZenohSettings, as_endpoints
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.page import DataKey


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
        self.gathering = Gathering()
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
        """Returns the factory of a node's link to all others of the net.

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
            replace(self.options, keys=as_keys(keys), accept=None if accept is None else frozenset(as_keys(accept))),
            Hearing(None if robots is None else frozenset([robots] if isinstance(robots, str) else robots), apart),
            self.robot if robot is None else _as_name("robot", robot),
            ZenohSettings(
                self.listen if listen is None else as_endpoints("listen=", listen, self.tls),
                self.connect if connect is None else as_endpoints("connect=", connect, self.tls),
                self.tls,
                self.discover,
                self.interfaces,
                self.options.max_frame_bytes,
                self.options.timeout_s,
            ),
        )


def _as_name(what: str, name: str) -> str:
    if not isinstance(name, str) or not 0 < len(name) <= MAX_NAME_CHARS:
        raise ConfigError(f"A net's {what} is {str(name)[:80]!r}.", fix=f"1 to {MAX_NAME_CHARS} characters.")
    return name


class ZenohLinkFactory(LoopFactory):
    """Makes a node's link to a net.

    Args:
        net: of which.
        options: of the link.
        hearing: what the node wants to hear.
        robot: it belongs to, or "".
        settings: what it may do on the network.
    """

    def __init__(
        self,
        net: ZenohNet,
        options: LinkOptions,
        hearing: Hearing,
        robot: str,
        settings: ZenohSettings,
    ) -> None:
        super().__init__()
        self.net = net
        self.options = options
        self.hearing = hearing
        self.robot = robot
        self.settings = settings

    def get(self, parent: NodeApi) -> Loop:
        """Returns the link."""
        member = Member(self.robot or parent.name, parent.name)
        if isinstance(parent.clock, SimClock):
            return SimulatedFleetLink(self, parent, self.options, member, self.hearing, self.net.gathering)
        return ZenohLink(self, parent, self.options, member, self.hearing, self.settings)
