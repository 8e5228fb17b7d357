"""SimulatedTransport: the ends of a pair under one SimClock, with the sessions and faults of a real link, and no wire.

So a config of several roles runs both as one lock-step simulation and as processes over TCP, without a change.
"""

from __future__ import annotations

import hashlib
from contextlib import ExitStack
from functools import partial
from typing import Any, Generic, TypeVar
from weakref import WeakKeyDictionary

from snr_sim.core.clocks import SimClock
from snr_sim.links.faults import LEAST_TRANSIT_S, Way
from snr_sim.links.link import BEFORE_LOOPS, Link, Transport
from snr_sim.links.messages import NONCE_BYTES
from snr_sim.links.peers import Peer, Peers
from snr_sim.links.session import Session, Terms

One = TypeVar("One")


class Meeting(Generic[One]):
    """Registry of the servers of one pair, or of the nodes of one net, per clock."""

    def __init__(self) -> None:
        self._there: WeakKeyDictionary[SimClock, list[One]] = WeakKeyDictionary()

    def __reduce__(self) -> tuple[type[Meeting[One]], tuple[()]]:
        """Return an empty one for another process: clocks are not transferred."""
        return Meeting, ()

    def on(self, clock: SimClock) -> list[One]:
        """Return the registered ones, in order of registration; a list to be changed in place."""
        return self._there.setdefault(clock, [])

    def leave(self, clock: SimClock, one: One) -> None:
        """Remove one, if it is registered."""
        if one in self.on(clock):
            self.on(clock).remove(one)


class SimulatedPeer(Peer):
    """A peer in the same process: each frame is delivered at the time that its channel computes.

    Args:
        session, way: as of Peer.
        near: the transport it belongs to.
    """

    far: SimulatedPeer

    def __init__(self, session: Session, near: SimulatedTransport, way: Way) -> None:
        super().__init__(session, near.link.options, way)
        self.near = near
        self.is_admitted = False
        self.is_gone = False
        self._way = way
        self._is_waiting = False  # for the channel to be free

    def put(self, frame: bytes) -> None:
        """Send or queue a page."""
        self.queue.put(frame)
        self.pump()

    def pump(self) -> None:
        """Send what the channel takes now; the rest when it is free again."""
        clock = self.near.clock
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
        clock = self.near.clock
        for arrival_s in self._way.arrivals_s(len(frame), clock.now_s(), is_page):
            clock.call_at(arrival_s, partial(self._deliver, frame), BEFORE_LOOPS)

    def _deliver(self, frame: bytes) -> None:
        # Sealed only now: faults lose, repeat and reorder pages before they are sent, as over sockets.
        self.far.near.arrive(self.far, self.session.seal(frame))


class SimulatedTransport(Transport):
    """One end of a pair under a SimClock; without the other end it is down, and still runs.

    Args:
        link: as of Transport.
        terms: settings of its sessions.
        meeting: where it finds the other end.
    """

    def __init__(self, link: Link, terms: Terms, meeting: Meeting[SimulatedTransport]) -> None:
        super().__init__(link)
        assert isinstance(link.parent.clock, SimClock)
        self.clock = link.parent.clock
        self.peers = Peers(link, terms, LEAST_TRANSIT_S)
        self.carry = self.peers.carry
        self._is_server = terms.is_server
        self._meeting = meeting
        self._far_ends: list[SimulatedPeer] = []

    def open(self, ports: ExitStack) -> None:
        """Wait for a client, or look for the server."""
        if self._is_server:
            self._meeting.on(self.clock).append(self)
        else:
            self.clock.call_at(self.clock.now_s(), self._call, BEFORE_LOOPS)

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the state of the link; see Transport."""
        return self.peers.state(now_s)

    def notes(self) -> list[str]:
        """Return notes for the end of the run; see Transport."""
        return self.peers.notes()

    def _call(self) -> None:
        servers = self._meeting.on(self.clock)
        if not servers:
            self.link.reason = "nobody listens."
        elif not self._far_ends and not self.link.is_terminated():
            here, there = self.meet(servers[-1]), servers[-1].meet(self)
            here.far, there.far = there, here
            here.pump()
            there.pump()

    def meet(self, other: SimulatedTransport) -> SimulatedPeer:
        """Start a session with another node."""
        roles = f"{self.link.parent.role} {other.link.parent.role}"
        # The same in every run. It need not be random: no other program can read what is sent in memory.
        nonce = hashlib.blake2b(roles.encode(), digest_size=NONCE_BYTES).digest()
        peer = SimulatedPeer(self.peers.new_session(nonce), self, self.peers.new_way())
        self._far_ends.append(peer)
        return peer

    def arrive(self, peer: SimulatedPeer, frame: bytes) -> None:
        """Receive a frame."""
        session = peer.session
        if peer.is_gone or self.link.parent.is_terminated:
            return
        pages = session.receive(frame, self.clock.now_s())
        if session.is_up and not peer.is_admitted:
            peer.is_admitted = True
            self.peers.admit(peer)
            self.link.report(self.clock.now_s())
        self.link.bring(pages, peer)
        self._pump(peer)

    def _pump(self, peer: SimulatedPeer) -> None:
        peer.pump()
        if peer.session.is_closed and not peer.is_gone:
            peer.is_gone = True
            self._far_ends.remove(peer)
            self.link.reason = peer.session.reason
            if peer.is_admitted:
                self.peers.dismiss(peer)

    def round(self) -> None:
        """Do what is due; see Transport."""
        now_s = self.clock.now_s()
        for peer in list(self._far_ends):
            peer.session.tick(now_s)
            self._pump(peer)
        if not self._is_server and not self._far_ends:
            self._call()
        self.link.report(now_s)

    def see_off(self) -> None:
        """Say goodbye; see Transport."""
        self._meeting.leave(self.clock, self)
        for peer in list(self._far_ends):
            peer.session.bye(self.peers.farewell())
            self._pump(peer)
