"""Fleets: nets of nodes on several robots, where every node receives every other; over Zenoh or simulated.

Two robots may run the same program, so their nodes may have the same names. A net therefore identifies each node by
its robot and its own name, and marks arriving pages with both: see `Member.with_namespace`. Each node has an
address among the net's keys, `snr/<net>/<robot>/<node>/<id>` (docs/formats.md), under which the others list it in their
peer tables.

There is a peer table in addition to Zenoh's liveliness tokens because a token shows neither round trips nor clock
offsets, which give pages their age, and because declarations by unknown clients must cost bounded memory. A simulated
net uses the same table and has no sessions: its pages are sent once for all, and the newest of each key is for every
node that joins, where a session's link keeps it only while no peer is connected.
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
from snr_sim.links.faults import MIN_TRANSIT_S, LinkFaults, LossyChannel
from snr_sim.links.link import BEFORE_LOOPS, Link, Transport, link_state
from snr_sim.links.options import MAX_KEY_CHARS, MAX_KEYS
from snr_sim.links.session import OFFSETS_REMEMBERED
from snr_sim.links.simulated import Rendezvous
from snr_sim.prelude.task import DataKey, Page

PING_BYTES = 64  # approximate size of a ping on a wire
MAX_MEMBERS = 1000  # per net; pages of further members are ignored
ALONE = "no other node is in the net."


@dataclass(frozen=True)
class Member:
    """A node as known in the net."""

    robot: str  # name of its robot; its own name if it has none
    node: str

    @property
    def name(self) -> str:
        """Name in the net.

        >>> Member("rov1", "camera_node").name, Member("topside_node", "topside_node").name
        ('rov1/camera_node', 'topside_node')
        """
        return self.node if self.robot == self.node else f"{self.robot}/{self.node}"

    def with_namespace(self, page: Page, to: Member, namespaced: bool) -> Page:
        """Return a page of this member as another member sees it: unchanged within one robot.

        From another robot, the origin of a page that this member made becomes the member's name in the net; with
        `namespaced`, the page's key also begins with the robot's name.

        >>> page = Page("depth", 1.5, "auv_node", 0.0)
        >>> Member("rov1", "auv_node").with_namespace(page, Member("shore_node", "shore_node"), namespaced=True)
        Page(key='rov1/depth', data=1.5, origin='rov1/auv_node', created_at_s=0.0, process=True)
        """
        if self.robot == to.robot:
            return page
        key = f"{self.robot}/{page.key}" if namespaced else page.key
        # Forwarded pages keep their origin: it would grow with each net they cross.
        origin = self.name if page.origin == self.node else page.origin
        return replace(page, key=key, origin=origin)


@dataclass(frozen=True)
class Subscription:
    """Which pages a node of a net accepts."""

    robots: frozenset[str] | None = None  # whose pages to accept; None accepts every robot's
    namespaced: bool = False  # whether keys of other robots' pages begin with the robot's name


def encode_key_part(text: str) -> str:
    """Return a name or page key as one part of a Zenoh key, with Zenoh's special characters escaped.

    >>> encode_key_part("depth/of rov*")
    'depth%2Fof%20rov%2A'
    """
    return quote(text, safe="", errors="replace")


def prefix_of(net: str) -> str:
    """Return the prefix of all addresses of a net."""
    return f"snr/{encode_key_part(net)}"


class RemotePeer:
    """Remote node of the net."""

    def __init__(self, member: Member, now_s: float) -> None:
        self.member: Member = member
        self.last_received_s: float = now_s
        self.rtt_s: float | None = None
        self.clock_offset_s: float | None = None  # as of Session
        self._offsets_s: deque[float] = deque(maxlen=OFFSETS_REMEMBERED)
        self.is_present: bool = False  # it has appeared, pinged or answered
        self.has_left: bool = False  # it has announced that it leaves, and has not appeared since
        self.received: int = 0
        self.missed: int = 0
        self.numbers: dict[str, int] = {}  # of the newest page, per key

    def note_offset(self, offset_s: float) -> None:
        """Record a measured clock offset, which is too large by the transit time of the answer."""
        self._offsets_s.append(offset_s)
        self.clock_offset_s = min(self._offsets_s)


class PeerTable:
    """Table of all other nodes of the net known to this one, and of which of their pages arrived. Thread-safe.

    All addresses of the net begin with `prefix`.
    """

    def __init__(self, prefix: str) -> None:
        self.prefix: str = prefix
        self.own_address: str = ""
        self.leave_message: str = ""  # message about the last node that left
        self._peers: dict[str, RemotePeer] = {}
        self._missed = 0  # pages of nodes that are no longer in the table
        self._has_new_peer = False
        self._lock = threading.Lock()

    def address_of(self, member: Member, identity: str) -> str:
        """Return the address of a member; `identity` separates members of the same name."""
        return f"{self.prefix}/{encode_key_part(member.robot)}/{encode_key_part(member.node)}/{identity}"

    def record_leave(self, address: str) -> None:
        """Record that a node left or was cut off. It stays known: it may come back, and send its last page again."""
        with self._lock:
            peer = self._peers.get(address)
            if peer is not None:
                peer.is_present, peer.has_left = False, True
                self.leave_message = f"'{peer.member.name}' left."

    def mark_all_gone(self) -> None:
        """Mark all others as gone, because this node itself left the net."""
        with self._lock:
            self.leave_message = ""
            for peer in self._peers.values():
                peer.is_present = False

    def mark_present(self, address: str, now_s: float, joins: bool = False) -> RemotePeer | None:
        """Return the node that pinged, answered or joins, and mark it as present.

        A node that left stays absent until it joins: what still arrives from it was sent before.
        """
        with self._lock:
            peer = self._find_or_add(address, now_s)
            if peer is None or (peer.has_left and not joins):
                return None
            self._has_new_peer = self._has_new_peer or not peer.is_present
            peer.is_present, peer.has_left, peer.last_received_s = True, False, now_s
            return peer

    def record_page(self, address: str, key: str, number: int, now_s: float) -> tuple[RemotePeer | None, bool]:
        """Record a page that arrived from an address; return its sender and whether the page is new.

        Sequence numbers of pages count from 1 for each key; 0 is for a page without one.
        """
        with self._lock:
            peer = self._find_or_add(address, now_s)
            if peer is None:
                return None, False
            peer.last_received_s = now_s
            last = peer.numbers.get(key)
            if not number or (last is None and len(peer.numbers) >= MAX_KEYS):
                return peer, True  # lost pages of this key go unnoticed
            if last is not None:
                if number <= last:
                    return peer, False
                peer.missed += number - last - 1
            peer.numbers[key] = number
            return peer, True

    def consume_new_peer_flag(self) -> bool:
        """Return whether a node has appeared since the last call."""
        with self._lock:
            has_one, self._has_new_peer = self._has_new_peer, False
            return has_one

    def present(self) -> list[RemotePeer]:
        """Return the nodes that are present."""
        with self._lock:
            return [peer for peer in self._peers.values() if peer.is_present]

    @property
    def missed(self) -> int:
        """Pages of others that did not arrive, by their sequence numbers."""
        with self._lock:
            return self._missed + sum(peer.missed for peer in self._peers.values())  # exact: integers

    def _find_or_add(self, address: str, now_s: float) -> RemotePeer | None:
        """Return the node at an address, known or new; None if the address is not valid."""
        peer = self._peers.get(address)
        if peer is not None:
            return peer
        start, _, rest = address.partition(f"{self.prefix}/")
        parts = rest.split("/")
        if start or len(parts) != 3 or "*" in address or address == self.own_address:
            return None
        member = Member(unquote(parts[0]), unquote(parts[1]))
        if not (member.robot + member.node).isprintable():  # names are shown in terminals
            return None
        if len(self._peers) >= MAX_MEMBERS:
            oldest = next((address for address, peer in self._peers.items() if not peer.is_present), None)
            if oldest is None:
                return None
            self._missed += self._peers.pop(oldest).missed
        peer = self._peers[address] = RemotePeer(member, now_s)
        return peer


class Fleet(Transport):
    """Carries pages to and from all other nodes of a net, which knows this one as `member`."""

    def __init__(self, link: Link, member: Member, subscription: Subscription) -> None:
        super().__init__(link)
        self.member: Member = member
        self.subscription: Subscription = subscription
        self.peer_table: PeerTable = PeerTable(prefix_of(link.options.name))
        self.now_s: Callable[[], float] = link.parent.clock.now_s
        self._ping_s = 0.0  # when to ping the others next
        link.reason = ALONE

    def carry(self, page: Page, raw: bytes, frame: bytes, by: object) -> None:
        """Send a page to all others, unless it arrived over this net: then all members have it."""
        if by is None:
            self.send(page.key, raw)

    def send(self, key: DataKey, raw: bytes) -> None:
        """Send a page to all others; on the node's thread."""
        raise NotImplementedError

    def accept_page(self, member: Member, page: Page, raw: bytes, by: object) -> None:
        """Store a page that another member sent, if this node accepts it."""
        link, robots, accept = self.link, self.subscription.robots, self.link.options.accept
        seen = member.with_namespace(page, self.member, self.subscription.namespaced)
        is_mine = seen.origin in (self.member.name, self.member.node)  # its own page, back over another path
        is_accepted = not is_mine and (robots is None or member.robot in robots)
        is_accepted = is_accepted and (accept is None or link.is_accepted(page.key, accept))
        is_accepted = is_accepted and 0 < len(seen.key) <= MAX_KEY_CHARS
        if is_accepted and (accept is not None or link.has_room_for(seen.key, raw)):
            link.accept_pages([seen], by, is_chosen=True)
            return
        link.rejected += 1

    @property
    def dropped(self) -> int:
        """Number of pages known at this end not to have arrived."""
        return self.link.dropped

    def state_of(self, peer: RemotePeer, now_s: float) -> dict[str, Any]:
        """Return the state of another node, as in the link's page."""
        return {"age_s": max(0.0, now_s - peer.last_received_s), "rtt_s": peer.rtt_s}

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the state of the link; see Transport."""
        link, shown = self.link, self.peer_table.present()
        present = [peer for peer in shown if now_s - peer.last_received_s <= link.options.timeout_s]
        reason = (
            f"nothing was received for {link.options.timeout_s:g} s."
            if shown
            else self.peer_table.leave_message or link.reason
        )
        states = ((peer.member.name, self.state_of(peer, now_s)) for peer in present)
        return link_state(link, states, self.dropped, link.sent, "" if present else reason)


class SimulatedFleet(Fleet):
    """A net's nodes under one SimClock. They exchange pages in memory; each pair has its own channel, with faults."""

    def __init__(
        self, link: Link, member: Member, subscription: Subscription, rendezvous: Rendezvous[SimulatedFleet]
    ) -> None:
        super().__init__(link, member, subscription)
        assert isinstance(link.parent.clock, SimClock)
        self.clock: SimClock = link.parent.clock
        self._rendezvous = rendezvous
        self._channels: dict[SimulatedFleet, LossyChannel] = {}
        self._newest: dict[DataKey, bytes] = {}

    def open(self, ports: ExitStack) -> None:
        """Register with the other nodes; see Transport."""
        self.peer_table.own_address = self.peer_table.address_of(self.member, self.link.parent.role)
        fleets = self._rendezvous.registered(self.clock)
        for other in fleets:
            other._connect(self)
            self._connect(other)
        fleets.append(self)

    def _connect(self, other: SimulatedFleet) -> None:
        link, node = self.link, self.link.parent
        name = f"link:{link.name}:{node.role}->{other.link.parent.role}"
        self._channels[other] = LossyChannel(link.options.faults or LinkFaults(), node.seed, name, MIN_TRANSIT_S)
        self.peer_table.mark_present(other.peer_table.own_address, self.now_s(), joins=True)
        for raw in self._newest.values():  # a node that joins late receives the newest page of each key
            self._send_to(other, raw)

    def send(self, key: DataKey, raw: bytes) -> None:
        """Send a page to all others; see Fleet."""
        self._newest.pop(key, None)  # removed first, so that the dict keeps the order of storing
        self._newest[key] = raw
        self.link.sent += 1
        for other in self._channels:
            self._send_to(other, raw)

    def _send_to(self, other: SimulatedFleet, raw: bytes) -> None:
        channel = self._channels[other]
        lost = channel.lost
        for arrival_s in channel.arrivals_s(len(raw), self.now_s()):
            self.clock.call_at(arrival_s, partial(other.receive, self, raw), BEFORE_LOOPS)
        self.link.dropped += channel.lost - lost

    def receive(self, sender: SimulatedFleet, raw: bytes) -> None:
        """Receive a page."""
        peer = self._peer_of(sender)
        if peer is not None:
            self.accept_page(sender.member, Page.deserialize(raw), raw, peer)

    def _peer_of(self, sender: SimulatedFleet) -> RemotePeer | None:
        if sender not in self._channels or self.link.parent.is_terminated:
            return None
        return self.peer_table.mark_present(sender.peer_table.own_address, self.now_s())

    def _send_message(self, channel: LossyChannel, handler: Callable[..., None], *words: Any) -> None:
        """Call a method of another node with this node and some arguments, when they have crossed the channel."""
        for arrival_s in channel.arrivals_s(PING_BYTES, self.now_s(), is_page=False):
            self.clock.call_at(arrival_s, partial(handler, self, *words), BEFORE_LOOPS)

    def on_ping(self, sender: SimulatedFleet, asked_s: float, is_answer: bool) -> None:
        """Handle a ping of another node, or its answer."""
        peer = self._peer_of(sender)
        if peer is not None and is_answer:
            peer.rtt_s = self.now_s() - asked_s
        elif peer is not None:
            self._send_message(self._channels[sender], sender.on_ping, asked_s, True)

    def round(self) -> None:
        """Ping the other nodes periodically, and report the state of the link; see Transport."""
        now_s = self.now_s()
        if now_s >= self._ping_s:
            self._ping_s = now_s + self.link.options.keep_alive_s
            for other, channel in self._channels.items():
                self._send_message(channel, other.on_ping, now_s, False)
        self.link.report(now_s)

    def drain_and_close(self) -> None:
        """Leave the net; the others are notified after what was sent before has arrived."""
        self._rendezvous.remove(self.clock, self)
        for other, channel in self._channels.items():
            self._send_message(channel, other.on_leave)
        self._channels.clear()

    def on_leave(self, sender: SimulatedFleet) -> None:
        """Record that another node has left the net."""
        if self._channels.pop(sender, None) is not None:
            self.peer_table.record_leave(sender.peer_table.own_address)
