"""Peers: the remote peers that a link has sessions with, over sockets, pipes or simulated, and their queues."""

from __future__ import annotations

import itertools
import threading
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any

from snr_sim.links.faults import Faults, Way
from snr_sim.links.frames import HEADER_BYTES
from snr_sim.links.link import Link, by_name
from snr_sim.links.messages import decode_message
from snr_sim.links.options import LinkOptions
from snr_sim.links.send_queue import Policy, SendQueue
from snr_sim.links.session import Session, Terms
from snr_sim.prelude.page import DataKey, Page

SHOWN_KEYS = 5


class Peer:
    """One remote peer.

    Args:
        session: with it.
        options: of the link.
        way: injects faults into what is sent to it, if any.
    """

    def __init__(self, session: Session, options: LinkOptions, way: Way | None) -> None:
        self.session = session
        self.queue: SendQueue[bytes] = SendQueue(options.queue_pages, options.policy)
        self.way = way
        self.sent = 0
        self.dropped = 0  # in addition to those that its queue dropped

    @property
    def all_dropped(self) -> int:
        """Number of pages known at this end not to have arrived."""
        return self.dropped + self.queue.dropped

    @property
    def waiting(self) -> int:
        """Number of pages that wait to be sent."""
        return len(self.queue)

    def takes(self, frame: bytes) -> bool:
        """Whether the remote peer accepts a frame of this length; counts the page as dropped if not."""
        hello = self.session.peer
        if hello is not None and len(frame) - HEADER_BYTES <= hello.max_frame_bytes:
            return True
        self.dropped += 1
        return False

    def put(self, frame: bytes) -> None:
        """Send or queue a page; on the node's thread, without blocking."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class Kept:
    """A page and its frame. Its length is that of the frame."""

    page: Page
    frame: bytes

    def __len__(self) -> int:
        return len(self.frame)


class EarlyPages(SendQueue[Kept]):
    """Pages stored before the link is first up, up to the queue's limit; counts the dropped ones per key."""

    def __init__(self, max_pages: int, policy: Policy) -> None:
        super().__init__(max_pages, policy)
        self.gone: Counter[DataKey] = Counter()

    def _drop(self, frame: Kept) -> None:
        super()._drop(frame)
        self.gone[frame.page.key] += 1

    @property
    def loss(self) -> str:
        """Return which pages were dropped, as text; empty if none were."""
        if not self.gone:
            return ""
        most = ", ".join(f"{key} {count}" for key, count in self.gone.most_common(SHOWN_KEYS))
        more = f" and {len(self.gone) - SHOWN_KEYS} keys more" if len(self.gone) > SHOWN_KEYS else ""
        which = "oldest" if self.policy == "drop_oldest" else "newest"
        return (
            f"the {which} {self.dropped} pages that were stored before anybody had connected were dropped "
            f"({most}{more}); queue_pages={self.max_pages} keeps no more."
        )


class Peers:
    """Keeps one session and one queue per far end.

    The first peer to connect gets all pages stored before, up to the queue's limit. A peer that connects after all
    others have gone gets only the newest page of each key: the old ones would delay the new ones.

    Args:
        link: the link they belong to.
        terms: of its sessions.
        least_transit_s: minimum transit time of what is sent, if simulated.
    """

    def __init__(self, link: Link, terms: Terms, least_transit_s: float = 0.0) -> None:
        self.terms = terms
        self.up: tuple[Peer, ...] = ()  # replaced and never changed, so any thread may read it
        self._link = link
        link.reason = "nobody has connected yet."
        self._node = link.parent
        self._options = link.options
        self._least_transit_s = least_transit_s
        self._decode = partial(decode_message, is_wanted=link.is_wanted)
        self._was_left = False  # whether the last peer that left said goodbye
        self._lost = self._duplicated = 0  # by faults, on channels to peers that have left
        self._early = EarlyPages(link.options.queue_pages, link.options.policy)
        self._was_up = False
        self._newest: dict[DataKey, Kept] = {}  # stored after all peers had left
        self._numbers = itertools.count(1)
        self._warned: set[str] = set()  # of node names that two nodes have
        self._meeting = threading.Lock()  # held while a page is queued for all, or a peer added or removed

    def notes(self) -> list[str]:
        """Return notes on pages lost before the first connection and on node names used twice."""
        return [words for words in (self._early.loss, *sorted(self._warned)) if words]

    def carry(self, page: Page, raw: bytes, frame: bytes, by: object) -> None:
        """Queue a page for all peers that are up except its sender, or keep it for the next peer; see Transport."""
        with self._meeting:  # so that no page is put for a peer after its last count
            peers = self.up
            if not peers and by is None:
                self._keep(page, frame)
            for peer in peers:
                if peer is not by and self._is_for(peer, page, peers) and peer.takes(frame):
                    peer.put(frame)

    def _is_for(self, peer: Peer, page: Page, peers: Iterable[Peer]) -> bool:
        """Whether a peer should get this page: not if it made the page, as far as node names are unique."""
        name = peer.session.peer_node
        if name != page.origin:
            return True
        if name == self._node.name:  # the peer has the same name as this node and would take the page for its own
            peer.dropped += 1
            return False
        return any(other is not peer and other.session.peer_node == name for other in peers)

    def _names_meant_twice(self, peers: Iterable[Peer]) -> str:
        """Return which node names of this end and the peers are used twice, as text."""
        sessions: dict[str, Session] = {}
        for session in (peer.session for peer in peers):
            name = session.peer_node
            if name == self._node.name:
                return (
                    f"the other end is also named '{name}': its pages are taken for ours and do not cross; "
                    "give one of the roles another name."
                )
            other = sessions.setdefault(name, session)
            # No warning if one was silent since the other connected: then one node reconnected.
            both_s = max(session.begun_s, other.begun_s) + self._options.keep_alive_s
            if other is not session and min(session.heard_s, other.heard_s) > both_s:
                return (
                    f"two far ends are named '{name}': each takes the other's pages for its own; "
                    "give one of the roles another name."
                )
        return ""

    @property
    def unsent(self) -> int:
        """Number of pages that wait for a peer to connect."""
        return len(self._early) + len(self._newest)

    def _keep(self, page: Page, frame: bytes) -> None:
        kept = Kept(page, frame)
        if not self._was_up:
            before = self._early.dropped
            self._early.put(kept)
            self._link.dropped += self._early.dropped - before
            return
        if self._newest.pop(page.key, None) is not None:  # removed first, so that the dict keeps the order of storing
            self._link.dropped += 1
        self._newest[page.key] = kept

    def admit(self, peer: Peer) -> None:
        """Start to send to a session that is up: waiting pages first, then each page as it is stored."""
        with self._meeting:
            kept = [*self._early.take(), *self._newest.values()]
            self._newest.clear()
            for one in kept:
                if self._is_for(peer, one.page, (*self.up, peer)) and peer.takes(one.frame):
                    peer.put(one.frame)
            self.up = (*self.up, peer)
            is_first, self._was_up = not self._was_up, True
        if is_first and self._early.loss:
            self._link.log.warning("%s: %s", self._link.name, self._early.loss)

    def dismiss(self, peer: Peer) -> None:
        """Remove a session that is over, and drop the pages that wait for it."""
        with self._meeting:
            self.up = tuple(other for other in self.up if other is not peer)
        self._link.dropped += peer.all_dropped + peer.waiting
        self._link.sent += peer.sent
        if peer.way is not None:
            self._lost += peer.way.lost
            self._duplicated += peer.way.duplicated
        self._link.reason = peer.session.reason
        self._was_left = peer.session.was_left

    def farewell(self) -> str:
        """Return the goodbye message that peers get when this end closes in good order."""
        why = (self._node.exit_reason or "").rstrip(".")
        return f"node '{self._node.name}' ended{f': {why}' if why else ''}."

    def new_session(self, nonce: bytes | None = None) -> Session:
        """Return a session with a new peer; its nonce is random if not given."""
        return Session(self.terms, self._link.get_time_s(), self._decode, nonce)

    def new_way(self) -> Way:
        """Return the outgoing channel of a new peer: each session has its own random numbers, the same in every run."""
        name = f"link:{self._link.name}:{self._node.role}:{next(self._numbers)}"
        return Way(self._options.faults or Faults(), self._node.seed, name, self._least_transit_s)

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the state of the link and of each peer; see `Transport.state`."""
        peers, link = self.up, self._link
        words = self._names_meant_twice(peers)
        if words and words not in self._warned:
            self._warned.add(words)
            link.log.warning("%s: %s", link.name, words)
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
            "dropped": link.dropped + sum(peer.all_dropped for peer in peers),  # exact: integers
            "rtt_s": max(trips_s, default=None),
            "sent": link.sent + sum(peer.sent for peer in peers),  # exact: integers
            "received": link.received,
            "unwanted": link.unwanted,
            "reason": words if peers else link.reason,
            "peers": each,
        }
        if self._options.faults is not None:
            ways = [peer.way for peer in peers if peer.way is not None]
            state["lost"] = self._lost + sum(way.lost for way in ways)  # exact: integers
            state["duplicated"] = self._duplicated + sum(way.duplicated for way in ways)  # exact: integers
        return state
