"""Fleets: nets of many nodes on several robots, where every node hears every other. What all kinds of nets share.

Two robots may run the same program, so their nodes may have the same names. A net therefore knows each node by its
robot and its own name, and says so in what arrives: see `Member.brings`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from msgspec.structs import replace

from snr_sim.core.loop import LoopFactory
from snr_sim.links.link import Link
from snr_sim.links.options import MAX_KEY_CHARS, LinkOptions
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.page import DataKey, Page

PING_BYTES = 64  # about what asking whether somebody is there costs on a wire


@dataclass(frozen=True)
class Member:
    """A node as the net knows it.

    Args:
        robot: it belongs to; its own name if it belongs to none.
        node: its name.
    """

    robot: str
    node: str

    @property
    def name(self) -> str:
        """Its name in the net.

        >>> Member("rov1", "camera_node").name, Member("topside_node", "topside_node").name
        ('rov1/camera_node', 'topside_node')
        """
        return self.node if self.robot == self.node else f"{self.robot}/{self.node}"

    def brings(self, page: Page, to: Member, apart: bool) -> Page:
        """Returns a page of this member as another is to see it: as it is, within one robot.

        From another robot, the origin of a page that was made here becomes this member's name in the net; and if
        pages are to be kept apart, their keys begin with the robot's name.

        >>> page = Page("depth", 1.5, "auv_node", 0.0)
        >>> Member("rov1", "auv_node").brings(page, Member("shore_node", "shore_node"), apart=True)
        Page(key='rov1/depth', data=1.5, origin='rov1/auv_node', created_at_s=0.0, process=True)
        """
        if self.robot == to.robot:
            return page
        key = f"{self.robot}/{page.key}" if apart else page.key
        # Not of pages it only passes on: their origin would grow with each net they cross.
        origin = self.name if page.origin == self.node else page.origin
        return replace(page, key=key, origin=origin)


@dataclass(frozen=True)
class Hearing:
    """What a node of a net wants to hear.

    Args:
        robots: whose pages may come in; None is every robot's.
        apart: whether keys of other robots' pages begin with the robot's name.
    """

    robots: frozenset[str] | None = None
    apart: bool = False


class FleetLink(Link):
    """A link to all other nodes of a net.

    Args:
        factory: who made it.
        parent: its node.
        options: of the link.
        member: the node, as the net knows it.
        hearing: what it wants to hear.
    """

    def __init__(
        self, factory: LoopFactory, parent: NodeApi, options: LinkOptions, member: Member, hearing: Hearing
    ) -> None:
        super().__init__(factory, parent, options)
        self.member = member
        self.hearing = hearing

    def _carry(self, page: Page, raw: bytes, frame: bytes, by: object) -> None:
        if by is None:  # what a net has brought, all of the net have heard already
            self._send(page.key, raw, frame)

    def _send(self, key: DataKey, raw: bytes, frame: bytes) -> None:
        """Sends a page to all others; on the node's thread."""
        raise NotImplementedError

    def _bring_from(self, member: Member, pages: Iterable[Page], by: object) -> None:
        """Lets pages in that another member sent, as far as this one wants them."""
        accept, robots = self.options.accept, self.hearing.robots
        wanted = []
        for page in pages:
            is_mine = page.origin == self.member.name  # came round, by another way
            is_heard = not is_mine and (robots is None or member.robot in robots)
            if not is_heard or not (accept is None or self._is_accepted(page.key, accept)):
                self.unwanted += 1
            else:
                wanted.append(member.brings(page, self.member, self.hearing.apart))
        self._bring(wanted, by)

    def _is_wanted(self, key: DataKey, accept: Any) -> bool:
        return 0 < len(key) <= MAX_KEY_CHARS
