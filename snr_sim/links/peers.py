"""Peers: the remote peers that a link has sessions with, over sockets, pipes or simulated, and their queues."""

from __future__ import annotations

import itertools
import threading
from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any

from snr_sim.links.faults import LinkFaults, LossyChannel
from snr_sim.links.frames import HEADER_BYTES
from snr_sim.links.link import Link, link_state
from snr_sim.links.messages import decode_message
from snr_sim.links.options import LinkOptions
from snr_sim.links.queues import Policy, SendQueue
from snr_sim.links.session import Session, SessionConfig
from snr_sim.prelude.task import DataKey, Page

SHOWN_KEYS = 5


class Peer:
    """One remote peer of a link; `channel` injects faults into what is sent to it, if any."""

    def __init__(self, session: Session, options: LinkOptions, channel: LossyChannel | None) -> None:
        self.session: Session = session
        self.queue: SendQueue[bytes] = SendQueue(options.queue_pages, options.policy)
        self.channel: LossyChannel | None = channel
        self.sent: int = 0
        self.dropped: int = 0  # in addition to those that its queue dropped

    @property
    def all_dropped(self) -> int:
        """Number of pages known at this end not to have arrived."""
        return self.dropped + self.queue.dropped

    @property
    def waiting(self) -> int:
        """Number of pages that wait to be sent."""
        return len(self.queue)

    def accepts(self, frame: bytes) -> bool:
        """Whether the remote peer accepts a frame of this length; counts the page as dropped if not."""
        hello = self.session.peer
        if hello is not None and len(frame) - HEADER_BYTES <= hello.max_frame_bytes:
            return True
        self.dropped += 1
        return False

    def put(self, frame: bytes) -> None:
        """Send or queue a page; on the node's thread, without blocking."""
        raise NotImplementedError

    def state(self, now_s: float) -> dict[str, Any]:
        """Return its state, as in the link's page."""
        return {
            "age_s": max(0.0, now_s - self.session.last_received_s),
            "rtt_s": self.session.rtt_s,
            "clock_offset_s": self.session.clock_offset_s,
            "dropped": self.all_dropped,
            "sent": self.sent,
            "waiting": self.waiting,
        }


@dataclass(frozen=True, slots=True)
class KeptPage:
    """A page and its frame. Its length is that of the frame."""

    page: Page
    frame: bytes

    def __len__(self) -> int:
        return len(self.frame)


class EarlyPages(SendQueue[KeptPage]):
    """Pages stored before the link is first up, up to the queue's limit; counts the dropped ones per key."""

    def __init__(self, max_pages: int, policy: Policy) -> None:
        super().__init__(max_pages, policy)
        self.gone: Counter[DataKey] = Counter()

    def _drop(self, frame: KeptPage) -> None:
        super()._drop(frame)
        self.gone[frame.page.key] += 1

    @property
    def loss(self) -> str:
        """Return which pages were dropped, as text; empty if none were."""
        if not self.gone:
            return ""
        listed = ", ".join(f"{key} {count}" for key, count in self.gone.most_common(SHOWN_KEYS))
        more = f" and {len(self.gone) - SHOWN_KEYS} keys more" if len(self.gone) > SHOWN_KEYS else ""
        which = "oldest" if self.policy == "drop_oldest" else "newest"
        return (
            f"the {which} {self.dropped} pages that were stored before a node connected were dropped "
            f"({listed}{more}); queue_pages={self.max_pages} keeps no more."
        )


class Peers:
    """Keeps one session and one queue per far end.

    The first peer to connect gets all pages stored before, up to the queue's limit. A peer that connects after all
    others have gone gets only the newest page of each key: the old ones would delay the new ones. If simulated, what is
    sent takes `min_transit_s` at least.
    """

    def __init__(self, link: Link, config: SessionConfig, min_transit_s: float = 0.0) -> None:
        self.up: tuple[Peer, ...] = ()  # replaced and never changed, so any thread may read it
        self._config = config
        self._link = link
        # Recorded in the page of the link, so another text changes the digests of recorded runs.
        link.reason = "nobody has connected yet."  # plain: nobody
        self._node = link.parent
        self._options = link.options
        self._min_transit_s = min_transit_s
        self._was_left = False  # whether the last peer that left said goodbye
        self._lost = self._duplicated = 0  # by faults, on channels to peers that have left
        self._early = EarlyPages(link.options.queue_pages, link.options.policy)
        self._was_up = False
        self._newest: dict[DataKey, KeptPage] = {}  # stored after all peers had left
        self._numbers = itertools.count(1)
        self._warned: set[str] = set()  # of node names that two nodes have
        self._membership_lock = threading.Lock()  # held while a page is queued for all, or a peer added or removed

    def notes(self) -> list[str]:
        """Return notes on pages lost before the first connection and on node names used twice."""
        return [words for words in (self._early.loss, *sorted(self._warned)) if words]

    def carry(self, page: Page, raw: bytes, frame: bytes, by: object) -> None:
        """Queue a page for all peers that are up except its sender, or keep it for the next peer; see Transport."""
        with self._membership_lock:  # so that no page is put for a peer after its last count
            peers = self.up
            if not peers and by is None:
                self._keep(page, frame)
            for peer in peers:
                if peer is not by and self._is_addressed_to(peer, page, peers) and peer.accepts(frame):
                    peer.put(frame)

    def carry_to(self, names: Collection[str], frame: bytes) -> int:
        """Queue a page for the peers of these names; return how many are up; see Transport."""
        with self._membership_lock:
            peers = [peer for peer in self.up if peer.session.peer_node in names]
            for peer in peers:
                if peer.accepts(frame):
                    peer.put(frame)
        return len(peers)

    def _is_addressed_to(self, peer: Peer, page: Page, peers: Iterable[Peer]) -> bool:
        """Whether a peer should get this page: not if it made the page, as far as node names are unique."""
        name = peer.session.peer_node
        if name != page.origin:
            return True
        if name == self._node.name:  # the peer has the same name as this node and would take the page for its own
            peer.dropped += 1
            return False
        return any(other is not peer and other.session.peer_node == name for other in peers)

    def _duplicate_names(self, peers: Iterable[Peer]) -> str:
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
            # No warning if one is silent since the other connected: then one node reconnected. What it had sent before
            # may be read after that, on a busy machine, but not again and again.
            both_s = max(session.begun_s, other.begun_s)
            if other is not session and session.is_received_steadily(both_s) and other.is_received_steadily(both_s):
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
        kept = KeptPage(page, frame)
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
        with self._membership_lock:
            kept = [*self._early.take(), *self._newest.values()]
            self._newest.clear()
            for one in kept:
                if self._is_addressed_to(peer, one.page, (*self.up, peer)) and peer.accepts(one.frame):
                    peer.put(one.frame)
            self.up = (*self.up, peer)
            is_first, self._was_up = not self._was_up, True
        if is_first and self._early.loss:
            self._link.log.warning("%s: %s", self._link.name, self._early.loss)

    def remove(self, peer: Peer) -> None:
        """Remove a session that is over, and drop the pages that wait for it."""
        with self._membership_lock:
            self.up = tuple(other for other in self.up if other is not peer)
        self._link.dropped += peer.all_dropped + peer.waiting
        self._link.sent += peer.sent
        if peer.channel is not None:
            self._lost += peer.channel.lost
            self._duplicated += peer.channel.duplicated
        self._link.reason = peer.session.reason
        self._was_left = peer.session.was_left

    def bye_reason(self) -> str:
        """Return the goodbye message that peers get when this end closes in good order."""
        reason = (self._node.exit_reason or "").rstrip(".")
        return f"node '{self._node.name}' ended{f': {reason}' if reason else ''}."

    def new_session(self, nonce: bytes | None = None) -> Session:
        """Return a session with a new peer; its nonce is random if not given."""
        link = self._link
        decode = link.decode_and_keep if link.forwards else partial(decode_message, is_acceptable=link.is_acceptable)
        return Session(self._config, link.get_time_s(), decode, nonce)

    def new_channel(self) -> LossyChannel:
        """Return the outgoing channel of a new peer: each session has its own random numbers, the same in every run."""
        name = f"link:{self._link.name}:{self._node.role}:{next(self._numbers)}"
        return LossyChannel(self._options.faults or LinkFaults(), self._node.seed, name, self._min_transit_s)

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the state of the link and of each peer; see `Transport.state`."""
        peers, link = self.up, self._link
        words = self._duplicate_names(peers)
        if words and words not in self._warned:
            self._warned.add(words)
            link.log.warning("%s: %s", link.name, words)
        state = link_state(
            link,
            ((peer.session.peer_node, peer.state(now_s)) for peer in peers),
            dropped=link.dropped + sum(peer.all_dropped for peer in peers),  # exact: integers
            sent=link.sent + sum(peer.sent for peer in peers),  # exact: integers
            reason=words if peers else link.reason,
        )
        state = {"up": state["up"], "has_left": self._was_left and not peers, **state}
        if self._options.faults is not None:
            channels = [peer.channel for peer in peers if peer.channel is not None]
            state["lost"] = self._lost + sum(channel.lost for channel in channels)  # exact: integers
            state["duplicated"] = self._duplicated + sum(channel.duplicated for channel in channels)  # exact: integers
        return state
