"""SimulatedLink: the ends of a pair under one SimClock. The same sessions and faults as over a wire, and no wire.

So a config of several roles runs as one lock-step simulation, and as processes over TCP, without a change.
"""

from __future__ import annotations

import hashlib
from functools import partial
from weakref import WeakKeyDictionary

from snr_sim.core.clocks import SimClock
from snr_sim.core.loop import LoopFactory
from snr_sim.links.faults import LEAST_TRANSIT_S, Way
from snr_sim.links.link import BEFORE_LOOPS
from snr_sim.links.messages import NONCE_BYTES
from snr_sim.links.options import LinkOptions
from snr_sim.links.peers import Peer, PeerLink
from snr_sim.links.session import Session, Terms
from snr_sim.prelude.node_api import NodeApi


class Meeting:
    """Where the ends of one pair find each other, per clock."""

    def __init__(self) -> None:
        self._servers: WeakKeyDictionary[SimClock, SimulatedLink] = WeakKeyDictionary()

    def __reduce__(self) -> tuple[type[Meeting], tuple[()]]:
        """Return an empty one for another process: clocks stay where they are."""
        return Meeting, ()

    def open(self, clock: SimClock, server: SimulatedLink) -> None:
        """A server is there."""
        self._servers[clock] = server

    def find(self, clock: SimClock) -> SimulatedLink | None:
        """Returns the server, if there is one."""
        return self._servers.get(clock)

    def close(self, clock: SimClock, server: SimulatedLink) -> None:
        """A server is gone."""
        if self._servers.get(clock) is server:
            del self._servers[clock]


class SimulatedPeer(Peer):
    """A far end in the same process: each frame is delivered when its way says so.

    Args:
        session, way: as of Peer.
        link: whose it is.
    """

    far: SimulatedPeer

    def __init__(self, session: Session, link: SimulatedLink, way: Way) -> None:
        super().__init__(session, link.options, way)
        self.link = link
        self.is_admitted = False
        self.is_gone = False
        self._way = way
        self._is_waiting = False  # for the way to be free

    def put(self, frame: bytes) -> None:
        """Has a page sent."""
        self.queue.put(frame)
        self.pump()

    def pump(self) -> None:
        """Sends what the way takes now; the rest when it is free again."""
        clock = self.link.clock
        for frame in self.session.take_output():
            self._send(frame, is_page=False)
        while len(self.queue) and self._way.is_free(clock.now_s()):
            (frame,) = self.queue.take(1)
            self.sent += 1
            self._send(frame, is_page=True)
        if len(self.queue) and not self._is_waiting:
            self._is_waiting = True
            clock.call_at(self._way.free_s, self._go_on, BEFORE_LOOPS)

    def _go_on(self) -> None:
        self._is_waiting = False
        self.pump()

    def _send(self, frame: bytes, is_page: bool) -> None:
        clock = self.link.clock
        for arrival_s in self._way.arrivals_s(len(frame), clock.now_s(), is_page):
            clock.call_at(arrival_s, partial(self._deliver, frame), BEFORE_LOOPS)

    def _deliver(self, frame: bytes) -> None:
        # Sealed only now: faults lose, repeat and reorder pages before they are sent, as over sockets.
        self.far.link.arrive(self.far, self.session.seal(frame))


class SimulatedLink(PeerLink):
    """An end of a pair under a SimClock; alone it is down, and runs all the same.

    Args:
        factory: who made it.
        parent: its node.
        options: of the link.
        terms: of its sessions.
        meeting: where it finds the other end.
    """

    least_transit_s = LEAST_TRANSIT_S

    def __init__(
        self, factory: LoopFactory, parent: NodeApi, options: LinkOptions, terms: Terms, meeting: Meeting
    ) -> None:
        super().__init__(factory, parent, options, terms)
        assert isinstance(parent.clock, SimClock)
        self.clock = parent.clock
        self._meeting_place = meeting
        self._far_ends: list[SimulatedPeer] = []

    def _open(self) -> None:
        if self.terms.is_server:
            self._meeting_place.open(self.clock, self)
        else:
            self.clock.call_at(self.clock.now_s(), self._call, BEFORE_LOOPS)

    def _call(self) -> None:
        server = self._meeting_place.find(self.clock)
        if server is None:
            self.reason = "nobody listens."
        elif not self._far_ends and not self.is_terminated():
            here, there = self._meet(server.parent.role), server._meet(self.parent.role)
            here.far, there.far = there, here
            here.pump()
            there.pump()

    def _meet(self, far_role: str) -> SimulatedPeer:
        # The same in every run; a secret that nobody listens to needs no better one.
        nonce = hashlib.blake2b(f"{self.parent.role} {far_role}".encode(), digest_size=NONCE_BYTES).digest()
        session = Session(self.terms, self.clock.now_s(), self._decode, nonce)
        peer = SimulatedPeer(session, self, self._new_way())
        self._far_ends.append(peer)
        return peer

    def arrive(self, peer: SimulatedPeer, frame: bytes) -> None:
        """A frame has come."""
        session = peer.session
        if peer.is_gone or self.parent.is_terminated:
            return
        pages = session.receive(frame, self.clock.now_s())
        if session.is_up and not peer.is_admitted:
            peer.is_admitted = True
            self._admit(peer)
            self._report(self.clock.now_s())
        self._bring(pages, peer)
        self._pump(peer)

    def _pump(self, peer: SimulatedPeer) -> None:
        peer.pump()
        if peer.session.is_closed and not peer.is_gone:
            peer.is_gone = True
            self._far_ends.remove(peer)
            self.reason = peer.session.reason
            if peer.is_admitted:
                self._dismiss(peer)

    def loop(self) -> None:
        """Does what time asks for."""
        now_s = self.clock.now_s()
        for peer in list(self._far_ends):
            peer.session.tick(now_s)
            self._pump(peer)
        if not self.terms.is_server and not self._far_ends:
            self._call()
        self._report(now_s)

    def halt(self) -> None:
        """Says goodbye."""
        if self.terms.is_server:
            self._meeting_place.close(self.clock, self)
        for peer in list(self._far_ends):
            peer.session.bye(self._farewell())
            self._pump(peer)
