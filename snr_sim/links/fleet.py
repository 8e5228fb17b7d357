"""Fleets: nets of nodes on several robots, where every node receives every other; over Zenoh or simulated.

Two robots may run the same program, so their nodes may have the same names. A net therefore identifies each node by
its robot and its own name, and marks arriving pages with both: see `Member.brings`. Each node has an address among the
net's keys, `snr/<net>/<robot>/<node>/<id>` (docs/formats.md), under which the rosters of the others list it.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any
from urllib.parse import quote, unquote

from msgspec.structs import replace

from snr_sim.core.clocks import SimClock
from snr_sim.links.faults import LEAST_TRANSIT_S, Faults, Way
from snr_sim.links.link import BEFORE_LOOPS, Link, Transport, by_name
from snr_sim.links.options import MAX_KEY_CHARS
from snr_sim.links.session import OFFSETS_REMEMBERED
from snr_sim.links.simulated import Meeting
from snr_sim.prelude.page import DataKey, Page

PING_BYTES = 64  # approximate size of a ping on a wire
MAX_MEMBERS = 1000  # per net; pages of further members are ignored
MAX_KEYS = 1000  # per member, whose pages are counted; lost pages of further keys go unnoticed
ALONE = "nobody else is in the net."


@dataclass(frozen=True)
class Member:
    """A node as known in the net.

    Args:
        robot: name of its robot; its own name if it has none.
        node: its name.
    """

    robot: str
    node: str

    @property
    def name(self) -> str:
        """Name in the net.

        >>> Member("rov1", "camera_node").name, Member("topside_node", "topside_node").name
        ('rov1/camera_node', 'topside_node')
        """
        return self.node if self.robot == self.node else f"{self.robot}/{self.node}"

    def brings(self, page: Page, to: Member, apart: bool) -> Page:
        """Return a page of this member as another member sees it: unchanged within one robot.

        From another robot, the origin of a page that this member made becomes the member's name in the net; with
        `apart`, the page's key also begins with the robot's name.

        >>> page = Page("depth", 1.5, "auv_node", 0.0)
        >>> Member("rov1", "auv_node").brings(page, Member("shore_node", "shore_node"), apart=True)
        Page(key='rov1/depth', data=1.5, origin='rov1/auv_node', created_at_s=0.0, process=True)
        """
        if self.robot == to.robot:
            return page
        key = f"{self.robot}/{page.key}" if apart else page.key
        # Forwarded pages keep their origin: it would grow with each net they cross.
        origin = self.name if page.origin == self.node else page.origin
        return replace(page, key=key, origin=origin)


@dataclass(frozen=True)
class Hearing:
    """Which pages a node of a net accepts.

    Args:
        robots: robots whose pages to accept; None accepts every robot's.
        apart: whether keys of other robots' pages begin with the robot's name.
    """

    robots: frozenset[str] | None = None
    apart: bool = False


def encoded(text: str) -> str:
    """Return a name or page key as one part of a Zenoh key, with Zenoh's special characters escaped.

    >>> encoded("depth/of rov*")
    'depth%2Fof%20rov%2A'
    """
    return quote(text, safe="", errors="replace")


def prefix_of(net: str) -> str:
    """Return the prefix of all addresses of a net."""
    return f"snr/{encoded(net)}"


class Far:
    """Remote node of the net.

    Args:
        member: its identity.
        now_s: time of the first contact.
    """

    def __init__(self, member: Member, now_s: float) -> None:
        self.member = member
        self.heard_s = now_s
        self.rtt_s: float | None = None
        self.clock_offset_s: float | None = None  # as of Session
        self._offsets_s: deque[float] = deque(maxlen=OFFSETS_REMEMBERED)
        self.is_here = False  # it has appeared, pinged or answered
        self.has_left = False  # it has announced that it leaves, and has not appeared since
        self.received = 0
        self.missed = 0
        self.numbers: dict[str, int] = {}  # of the newest page, per key

    def note_offset(self, offset_s: float) -> None:
        """Record a measured clock offset, which is too large by the transit time of the answer."""
        self._offsets_s.append(offset_s)
        self.clock_offset_s = min(self._offsets_s)


class Roster:
    """Table of all other nodes of the net known to this one, and of which of their pages arrived. Thread-safe.

    Args:
        prefix: of all addresses of the net.
    """

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix
        self.own_place = ""
        self.news = ""  # message about the last node that left
        self._fars: dict[str, Far] = {}
        self._missed = 0  # pages of nodes that are no longer in the table
        self._has_newcomer = False
        self._guard = threading.Lock()

    def place_of(self, member: Member, identity: str) -> str:
        """Return the address of a member; `identity` separates members of the same name."""
        return f"{self.prefix}/{encoded(member.robot)}/{encoded(member.node)}/{identity}"

    def shows(self, place: str, now_s: float) -> None:
        """Record that a node appeared."""
        with self._guard:
            far = self._at(place, now_s)
            if far is not None:
                far.has_left = False
                self._hear(far, now_s)

    def leaves(self, place: str) -> None:
        """Record that a node left or was cut off. It stays known: it may come back, and send its last page again."""
        with self._guard:
            far = self._fars.get(place)
            if far is not None:
                far.is_here, far.has_left = False, True
                self.news = f"'{far.member.name}' left."

    def cut_off(self) -> None:
        """Mark all others as gone, because this node itself left the net."""
        with self._guard:
            self.news = ""
            for far in self._fars.values():
                far.is_here = False

    def hears(self, place: str, now_s: float) -> Far | None:
        """Return the node that pinged or answered, and mark it as present; a node that left stays absent.

        What still arrives from a node that left was sent before.
        """
        with self._guard:
            far = self._at(place, now_s)
            if far is None or far.has_left:
                return None
            self._hear(far, now_s)
            return far

    def takes(self, place: str, key: str, number: int, now_s: float) -> tuple[Far | None, bool]:
        """Record an arriving page; return its sender and whether the page is new.

        Args:
            place: address of the sender.
            key: of the page.
            number: sequence number of the page for its key, from 1; 0 if it has none.
            now_s: the time.
        """
        with self._guard:
            far = self._at(place, now_s)
            if far is None:
                return None, False
            far.heard_s = now_s
            last = far.numbers.get(key)
            if not number or (last is None and len(far.numbers) >= MAX_KEYS):
                return far, True
            if last is not None:
                if number <= last:
                    return far, False
                far.missed += number - last - 1
            far.numbers[key] = number
            return far, True

    def take_newcomer(self) -> bool:
        """Return whether a node has appeared since the last call."""
        with self._guard:
            has_one, self._has_newcomer = self._has_newcomer, False
            return has_one

    def here(self) -> list[Far]:
        """Return the nodes that are present."""
        with self._guard:
            return [far for far in self._fars.values() if far.is_here]

    @property
    def missed(self) -> int:
        """Pages of others that did not arrive, by their sequence numbers."""
        with self._guard:
            return self._missed + sum(far.missed for far in self._fars.values())  # exact: integers

    def _hear(self, far: Far, now_s: float) -> None:
        far.heard_s = now_s
        self._has_newcomer = self._has_newcomer or not far.is_here
        far.is_here = True

    def _at(self, place: str, now_s: float) -> Far | None:
        """Return the node at an address, known or new; None if the address is not valid."""
        far = self._fars.get(place)
        if far is not None:
            return far
        parts = place.removeprefix(f"{self.prefix}/").split("/")
        if len(parts) != 3 or "*" in place or not place.startswith(f"{self.prefix}/") or place == self.own_place:
            return None
        if not (unquote(parts[0]) + unquote(parts[1])).isprintable():  # names are shown in terminals
            return None
        if len(self._fars) >= MAX_MEMBERS:
            oldest = next((place for place, far in self._fars.items() if not far.is_here), None)
            if oldest is None:
                return None
            self._missed += self._fars.pop(oldest).missed
        far = self._fars[place] = Far(Member(unquote(parts[0]), unquote(parts[1])), now_s)
        return far


class Fleet(Transport):
    """Carries pages to and from all other nodes of a net. Subclasses implement the transport.

    Args:
        link: as of Transport.
        member: the node, as the net knows it.
        hearing: which pages it accepts.
    """

    def __init__(self, link: Link, member: Member, hearing: Hearing) -> None:
        super().__init__(link)
        self.member = member
        self.hearing = hearing
        self.roster = Roster(prefix_of(link.options.name))
        self.now_s = link.parent.clock.now_s
        self._ping_s = 0.0  # when to ping the others next
        link.reason = ALONE

    def carry(self, page: Page, raw: bytes, frame: bytes, by: object) -> None:
        """Send a page to all others, unless it arrived over this net: then all members have it."""
        if by is None:
            self.send(page.key, raw)

    def send(self, key: DataKey, raw: bytes) -> None:
        """Send a page to all others; on the node's thread."""
        raise NotImplementedError

    def let_in(self, member: Member, page: Page, by: object) -> None:
        """Store a page that another member sent, if this node accepts it."""
        link, robots, accept = self.link, self.hearing.robots, self.link.options.accept
        is_mine = page.origin == self.member.name  # its own page, back over another path
        is_heard = not is_mine and (robots is None or member.robot in robots)
        if is_heard and (accept is None or link.is_accepted(page.key, accept)):
            page = member.brings(page, self.member, self.hearing.apart)
            if 0 < len(page.key) <= MAX_KEY_CHARS:
                link.bring([page], by, is_chosen=True)
                return
        link.unwanted += 1

    @property
    def dropped(self) -> int:
        """Number of pages known at this end not to have arrived."""
        return self.link.dropped

    def state_of(self, far: Far, now_s: float) -> dict[str, Any]:
        """Return the state of another node, as in the link's page."""
        return {"age_s": max(0.0, now_s - far.heard_s), "rtt_s": far.rtt_s}

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the state of the link; see Transport."""
        link, shown = self.link, self.roster.here()
        here = [far for far in shown if now_s - far.heard_s <= link.options.timeout_s]
        reason = f"nothing was heard for {link.options.timeout_s:g} s." if shown else self.roster.news or link.reason
        trips_s = [far.rtt_s for far in here if far.rtt_s is not None]
        return {
            "up": bool(here),
            "age_s": max((max(0.0, now_s - far.heard_s) for far in here), default=None),
            "dropped": self.dropped,
            "rtt_s": max(trips_s, default=None),
            "sent": link.sent,
            "received": link.received,
            "unwanted": link.unwanted,
            "reason": "" if here else reason,
            "peers": by_name((far.member.name, self.state_of(far, now_s)) for far in here),
        }


class SimulatedFleet(Fleet):
    """A net's nodes under one SimClock. They exchange pages in memory; each pair has its own channel, with faults.

    Args:
        link, member, hearing: as of Fleet.
        meeting: where it finds the other nodes.
    """

    def __init__(self, link: Link, member: Member, hearing: Hearing, meeting: Meeting[SimulatedFleet]) -> None:
        super().__init__(link, member, hearing)
        assert isinstance(link.parent.clock, SimClock)
        self.clock = link.parent.clock
        self._meeting = meeting
        self._ways: dict[SimulatedFleet, Way] = {}
        self._newest: dict[DataKey, bytes] = {}

    def open(self, ports: ExitStack) -> None:
        """Register with the other nodes; see Transport."""
        self.roster.own_place = self.roster.place_of(self.member, self.link.parent.role)
        fleets = self._meeting.on(self.clock)
        for other in fleets:
            other._meet(self)
            self._meet(other)
        fleets.append(self)

    def _meet(self, other: SimulatedFleet) -> None:
        link, node = self.link, self.link.parent
        name = f"link:{link.name}:{node.role}->{other.link.parent.role}"
        self._ways[other] = Way(link.options.faults or Faults(), node.seed, name, LEAST_TRANSIT_S)
        self.roster.shows(other.roster.own_place, self.now_s())
        for raw in self._newest.values():  # a node that joins late receives the newest page of each key
            self._send_to(other, raw)

    def send(self, key: DataKey, raw: bytes) -> None:
        """Send a page to all others; see Fleet."""
        self._newest.pop(key, None)  # removed first, so that the dict keeps the order of storing
        self._newest[key] = raw
        self.link.sent += 1
        for other in self._ways:
            self._send_to(other, raw)

    def _send_to(self, other: SimulatedFleet, raw: bytes) -> None:
        way = self._ways[other]
        lost = way.lost
        for arrival_s in way.arrivals_s(len(raw), self.now_s()):
            self.clock.call_at(arrival_s, partial(other.arrive, self, raw), BEFORE_LOOPS)
        self.link.dropped += way.lost - lost

    def arrive(self, sender: SimulatedFleet, raw: bytes) -> None:
        """Receive a page."""
        far = self._hear(sender)
        if far is not None:
            self.let_in(sender.member, Page.deserialize(raw), far)

    def _hear(self, sender: SimulatedFleet) -> Far | None:
        if sender not in self._ways or self.link.parent.is_terminated:
            return None
        return self.roster.hears(sender.roster.own_place, self.now_s())

    def _say(self, way: Way, hear: Callable[..., None], *words: Any) -> None:
        """Call a method of another node with this node and some arguments, when they have crossed the channel."""
        for arrival_s in way.arrivals_s(PING_BYTES, self.now_s(), is_page=False):
            self.clock.call_at(arrival_s, partial(hear, self, *words), BEFORE_LOOPS)

    def pinged(self, sender: SimulatedFleet, asked_s: float, is_answer: bool) -> None:
        """Handle a ping of another node, or its answer."""
        far = self._hear(sender)
        if far is None:
            return
        if is_answer:
            far.rtt_s = self.now_s() - asked_s
        else:
            self._say(self._ways[sender], sender.pinged, asked_s, True)

    def round(self) -> None:
        """Ping the other nodes periodically, and report the state of the link; see Transport."""
        now_s = self.now_s()
        if now_s >= self._ping_s:
            self._ping_s = now_s + self.link.options.keep_alive_s
            for other, way in self._ways.items():
                self._say(way, other.pinged, now_s, False)
        self.link.report(now_s)

    def see_off(self) -> None:
        """Leave the net; the others are notified after what was sent before has arrived."""
        self._meeting.leave(self.clock, self)
        for other, way in self._ways.items():
            self._say(way, other.left)
        self._ways.clear()

    def left(self, sender: SimulatedFleet) -> None:
        """Record that another node has left the net."""
        if self._ways.pop(sender, None) is not None:
            self.roster.leaves(sender.roster.own_place)
