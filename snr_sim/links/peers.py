"""PeerLink: a link that talks to each of its far ends in a Session: over sockets, pipes, or simulated."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterable
from functools import partial
from typing import Any

from snr_sim.core.loop import LoopFactory
from snr_sim.links.early_pages import EarlyPages, Kept
from snr_sim.links.faults import Faults, Way
from snr_sim.links.frames import HEADER_BYTES
from snr_sim.links.link import Link, by_name
from snr_sim.links.messages import decode_message
from snr_sim.links.options import LinkOptions
from snr_sim.links.send_queue import SendQueue
from snr_sim.links.session import Session, Terms
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.page import DataKey, Page


class Peer:
    """One far end.

    Args:
        session: with it.
        options: of the link.
        way: what faults do to what is sent to it, if any.
    """

    def __init__(self, session: Session, options: LinkOptions, way: Way | None) -> None:
        self.session = session
        self.queue: SendQueue[bytes] = SendQueue(options.queue_pages, options.policy)
        self.way = way
        self.sent = 0
        self.dropped = 0  # beside those its queue dropped

    @property
    def all_dropped(self) -> int:
        """Pages that did not get across, as far as this end knows."""
        return self.dropped + self.queue.dropped

    @property
    def waiting(self) -> int:
        """Pages that wait to be sent."""
        return len(self.queue)

    def takes(self, frame: bytes) -> bool:
        """Whether the far end takes a frame of this length; counted as dropped if not."""
        hello = self.session.peer
        if hello is not None and len(frame) - HEADER_BYTES <= hello.max_frame_bytes:
            return True
        self.dropped += 1
        return False

    def put(self, frame: bytes) -> None:
        """Has a page sent; on the node's thread, at once or soon, but never waiting."""
        raise NotImplementedError


class PeerLink(Link):
    """Keeps one session and one queue per far end.

    Whoever comes first gets all that was stored before, as far as the queue's bound goes. Who comes when all others
    have gone gets the newest page of each key: what is old by then would only hold up what is new.

    Args:
        factory: who made it.
        parent: its node.
        options: of the link.
        terms: of its sessions.
    """

    least_transit_s = 0.0  # of what is sent; a simulated link has some

    def __init__(self, factory: LoopFactory, parent: NodeApi, options: LinkOptions, terms: Terms) -> None:
        super().__init__(factory, parent, options)
        self.terms = terms
        self._decode = partial(decode_message, is_wanted=self._is_wanted)
        self.peers: tuple[Peer, ...] = ()  # those that are up; never changed in place, so any thread may read it
        self.reason = "nobody has connected yet."
        self._was_left = False  # whether the last who went said goodbye
        self._lost = self._duplicated = 0  # by faults, on the ways to far ends that have gone
        self._early: EarlyPages = EarlyPages(options.queue_pages, options.policy)
        self._was_up = False
        self._newest: dict[DataKey, Kept] = {}  # stored while nobody was there any more
        self._numbers = itertools.count(1)
        self._warned: set[str] = set()  # of names that mean two nodes
        self._meeting = threading.Lock()  # held while a page is put for all peers, and when one comes or goes

    def terminate(self) -> None:
        """Tells at the end of the run also which names meant two nodes."""
        super().terminate()
        for words in (self._early.loss, *sorted(self._warned)):
            if words:
                self.parent.note(f"'{self.name}': {words}")

    def _carry(self, page: Page, raw: bytes, frame: bytes, by: object) -> None:
        with self._meeting:  # so that nothing is put for a peer whose pages have been counted for the last time
            peers = self.peers
            if not peers and by is None:
                self._keep(page, frame)
            for peer in peers:
                if peer is not by and self._is_for(peer, page, peers) and peer.takes(frame):
                    peer.put(frame)

    def _is_for(self, peer: Peer, page: Page, peers: Iterable[Peer]) -> bool:
        """Whether a far end has not made this page itself, as far as names tell; told apart if two have one name."""
        name = peer.session.peer_node
        if name != page.origin:
            return True
        if name == self.parent.name:  # made here, and the far end would take it for its own
            peer.dropped += 1
            return False
        return any(other is not peer and other.session.peer_node == name for other in peers)

    def _names_meant_twice(self, peers: Iterable[Peer]) -> str:
        """Returns what is wrong with the names of this end and the far ends, in words."""
        sessions: dict[str, Session] = {}
        for session in (peer.session for peer in peers):
            name = session.peer_node
            if name == self.parent.name:
                return (
                    f"the other end is also named '{name}': its pages are taken for ours and do not cross; "
                    "give one of the roles another name."
                )
            other = sessions.setdefault(name, session)
            # Not if one has been silent since the other came: then somebody lost a connection and called again.
            both_s = max(session.begun_s, other.begun_s) + self.options.keep_alive_s
            if other is not session and min(session.heard_s, other.heard_s) > both_s:
                return (
                    f"two far ends are named '{name}': each takes the other's pages for its own; "
                    "give one of the roles another name."
                )
        return ""

    def _report(self, now_s: float) -> None:
        words = self._names_meant_twice(self.peers)
        if words and words not in self._warned:
            self._warned.add(words)
            self.log.warning("%s: %s", self.name, words)
        super()._report(now_s)

    @property
    def unsent(self) -> int:
        """How many pages wait for somebody to come."""
        return len(self._early) + len(self._newest)

    def _keep(self, page: Page, frame: bytes) -> None:
        kept = Kept(page, frame)
        if not self._was_up:
            before = self._early.dropped
            self._early.put(kept)
            self.dropped += self._early.dropped - before
            return
        if self._newest.pop(page.key, None) is not None:  # taken out, so that the order is that of storing
            self.dropped += 1
        self._newest[page.key] = kept

    def _admit(self, peer: Peer) -> None:
        """A session is up: what waits for somebody goes first, then whatever is stored from now on."""
        with self._meeting:
            kept = [*self._early.take(), *self._newest.values()]
            self._newest.clear()
            for one in kept:
                if self._is_for(peer, one.page, (*self.peers, peer)) and peer.takes(one.frame):
                    peer.put(one.frame)
            self.peers = (*self.peers, peer)
            is_first, self._was_up = not self._was_up, True
        if is_first and self._early.loss:
            self.log.warning("%s: %s", self.name, self._early.loss)

    def _dismiss(self, peer: Peer) -> None:
        """A session is over: what still waited for it is dropped."""
        with self._meeting:
            self.peers = tuple(other for other in self.peers if other is not peer)
        self.dropped += peer.all_dropped + peer.waiting
        self.sent += peer.sent
        if peer.way is not None:
            self._lost += peer.way.lost
            self._duplicated += peer.way.duplicated
        self.reason = peer.session.reason
        self._was_left = peer.session.was_left

    def _farewell(self) -> str:
        """Returns what is said to far ends when this one ends in order."""
        why = (self.parent.exit_reason or "").rstrip(".")
        return f"node '{self.parent.name}' ended{f': {why}' if why else ''}."

    def _new_way(self) -> Way:
        """Returns the way out to a new far end: each session has a luck of its own, the same in every run."""
        name = f"link:{self.name}:{self.parent.role}:{next(self._numbers)}"
        return Way(self.options.faults or Faults(), self.parent.seed, name, self.least_transit_s)

    def _state(self, now_s: float) -> dict[str, Any]:
        peers = self.peers
        each = by_name(
            (
                peer.session.peer_node,
                {
                    "age_s": max(0.0, now_s - peer.session.heard_s),
                    "rtt_s": peer.session.rtt_s,
                    "clock_offset_s": peer.session.clock_offset_s,
                    "dropped": peer.all_dropped,
                    "sent": peer.sent,
                    "waiting": peer.waiting,
                },
            )
            for peer in peers
        )
        ages_s = [now_s - peer.session.heard_s for peer in peers]
        trips_s = [peer.session.rtt_s for peer in peers if peer.session.rtt_s is not None]
        state = {
            "up": bool(peers),
            "left": self._was_left and not peers,
            "age_s": max(0.0, *ages_s) if ages_s else None,
            "dropped": self.dropped + sum(peer.all_dropped for peer in peers),  # exact: integers
            "rtt_s": max(trips_s, default=None),
            "sent": self.sent + sum(peer.sent for peer in peers),  # exact: integers
            "received": self.received,
            "unwanted": self.unwanted,
            "reason": self._names_meant_twice(peers) if peers else self.reason,
            "peers": each,
        }
        if self.options.faults is not None:
            ways = [peer.way for peer in peers if peer.way is not None]
            state["lost"] = self._lost + sum(way.lost for way in ways)  # exact: integers
            state["duplicated"] = self._duplicated + sum(way.duplicated for way in ways)  # exact: integers
        return state
