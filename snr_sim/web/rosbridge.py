"""rosbridge: tools of ROS subscribe to pages of a node and publish its events, by JSON over a WebSocket.

RosbridgeLoop --> Starlette on uvicorn --> WebSocket of / --> RosSession: publish, subscribe, call_service

    page "reference" --> topic "/reference"     a message at most 30 times a second, always the newest
    topic "/found"   --> event "FOUND"          a message's `data` is its list of values
    service "/move"  --> event "move.start", then the next page "move" is the answer

A message of a topic is the data of the page if these are an object, and {"data": ...} otherwise. Types of ROS are
neither checked nor sent: clients need none. A tool has to know the token: `ws://127.0.0.1:9090/?token=...`.

Source: the rosbridge v2 protocol, ROSBRIDGE_PROTOCOL.md of RobotWebTools/rosbridge_suite.
"""

from __future__ import annotations

from collections.abc import Mapping

from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.web.ros_session import Offer, RosbridgePage, Service
from snr_sim.web.web_loop import WebLoop, WebLoopFactory


class RosbridgeFactory(WebLoopFactory):
    """Makes a loop that serves tools of ROS.

    Args:
        port: 0 takes a free one; that of ROS is 9090.
        topics: the key of the page of each topic that tools may subscribe to.
        events: the event of each topic that they may publish.
        services: the event and the answer of each service: {"/move": ("move.start", "move")}.
        host: an address of this machine; it binds to this one only.
        token: at least 16 characters; a new random one if not given. Another host than loopback needs one.
        name: of the loop.

    Raises:
        ConfigError: the address or the token cannot be used, or a topic is in both tables.
        MissingExtraError: the packages of the extra 'web' are not installed.
    """

    def __init__(
        self,
        port: int = 9090,
        topics: Mapping[str, str] | None = None,
        *,
        events: Mapping[str, str] | None = None,
        services: Mapping[str, tuple[str, str]] | None = None,
        host: str = "127.0.0.1",
        token: str | bytes | None = None,
        name: str = "rosbridge",
    ) -> None:
        fix = 'token="..." of at least 16 characters, or leave host out.'
        super().__init__(port, host, token, name, who="rosbridge", token_fix=fix, is_for_programs=True)
        made = {service: Service(*one) for service, one in (services or {}).items()}
        self.offer: Offer = Offer(dict(topics or {}), dict(events or {}), made, name)
        for topic in self.offer.topics.keys() & self.offer.events.keys():
            raise ConfigError(f"Topic '{topic}' is a page and an event.", fix="give the event a topic of its own.")

    def get(self, parent: NodeApi) -> RosbridgeLoop:
        """Return the loop."""
        return RosbridgeLoop(self, parent)

    @property
    def url(self) -> str:
        """The address for a tool, with the token: `roslibpy.Ros(url)`."""
        return f"ws://{self.access.netloc}/?token={self.access.token}"


class RosbridgeLoop(WebLoop):
    """Loop that serves tools of ROS."""

    factory: RosbridgeFactory

    async def _serve(self) -> None:
        from snr_sim.web.server import serve  # slow to import, and not installed everywhere

        await serve([RosbridgePage(self.parent, self.factory.offer)], self.factory.access, self._sock, self._ending)
