"""SimulatedTransport: the ends of a pair under one SimClock, with the sessions and faults of a real link, and no wire.

So a config of several roles runs both as one lock-step simulation and as processes over TCP, without a change.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Iterable
from contextlib import ExitStack
from functools import partial
from typing import Any, Generic, TypeVar
from weakref import WeakKeyDictionary

from snr_sim.core.clocks import SimClock
from snr_sim.links.faults import MIN_TRANSIT_S, LossyChannel
from snr_sim.links.link import BEFORE_LOOPS, Carry, Link, Transport
from snr_sim.links.messages import NONCE_BYTES
from snr_sim.links.peers import Peer, Peers
from snr_sim.links.session import Session, SessionConfig

One = TypeVar("One")


class Rendezvous(Generic[One]):
    """Registry of the servers of one pair, or of the nodes of one net, per clock."""

    def __init__(self) -> None:
        self._members: WeakKeyDictionary[SimClock, list[One]] = WeakKeyDictionary()

    def __reduce__(self) -> tuple[type[Rendezvous[One]], tuple[()]]:
        """Return an empty one for another process: clocks are not transferred."""
        return Rendezvous, ()

    def registered(self, clock: SimClock) -> list[One]:
        """Return the registered ones, in order of registration; a list to be changed in place."""
        return self._members.setdefault(clock, [])

    def remove(self, clock: SimClock, one: One) -> None:
        """Remove one, if it is registered."""
        if one in self.registered(clock):
            self.registered(clock).remove(one)


class SimulatedPeer(Peer):
    """A peer in the same process: each frame is delivered at the time that its channel computes."""

    remote: SimulatedPeer
    sent: int

    def __init__(self, session: Session, transport: SimulatedTransport, channel: LossyChannel) -> None:
        super().__init__(session, transport.link.options, channel)
        self.transport: SimulatedTransport = transport
        self.is_admitted: bool = False
        self.is_gone: bool = False
        self._channel = channel
        self._is_waiting = False  # for the channel to be free

    def put(self, frame: bytes) -> None:
        """Send or queue a page."""
        self.queue.put(frame)
        self.pump()

    def pump(self) -> None:
        """Send what the channel takes now; the rest when it is free again."""
        clock = self.transport.clock
        for frame in self.session.take_output():
            self._send(frame, is_page=False)
        while len(self.queue) and clock.now_s() >= self._channel.free_s:
            (frame,) = self.queue.take(1)
            self.sent += 1
            self._send(frame, is_page=True)
        if len(self.queue) and not self._is_waiting:
            self._is_waiting = True
            clock.call_at(self._channel.free_s, self._resume, BEFORE_LOOPS)

    def _resume(self) -> None:
        self._is_waiting = False
        self.pump()

    def _send(self, frame: bytes, is_page: bool) -> None:
        clock = self.transport.clock
        for arrival_s in self._channel.arrivals_s(len(frame), clock.now_s(), is_page):
            clock.call_at(arrival_s, partial(self._deliver, frame), BEFORE_LOOPS)

    def _deliver(self, frame: bytes) -> None:
        # Sealed only now: faults lose, repeat and reorder pages before they are sent, as over sockets.
        self.remote.transport.receive(self.remote, self.session.seal(frame))


class SimulatedTransport(Transport):
    """One end of a pair under a SimClock; without the other end it is down, and still runs."""

    def __init__(self, link: Link, config: SessionConfig, rendezvous: Rendezvous[SimulatedTransport]) -> None:
        super().__init__(link)
        assert isinstance(link.parent.clock, SimClock)
        self.clock: SimClock = link.parent.clock
        self.peers: Peers = Peers(link, config, MIN_TRANSIT_S)
        self.carry: Carry = self.peers.carry
        self.carry_to: Callable[[Collection[str], bytes], int] = self.peers.carry_to
        self.notes: Callable[[], Iterable[str]] = self.peers.notes
        self._is_server = config.is_server
        self._rendezvous = rendezvous
        self._remote_ends: list[SimulatedPeer] = []

    def open(self, ports: ExitStack) -> None:
        """Wait for a client, or look for the server."""
        if self._is_server:
            self._rendezvous.registered(self.clock).append(self)
        else:
            self.clock.call_at(self.clock.now_s(), self._connect, BEFORE_LOOPS)

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the state of the link; see Transport."""
        return self.peers.state(now_s)

    def _connect(self) -> None:
        servers = self._rendezvous.registered(self.clock)
        if not servers:
            self.link.reason = "no server is listening."
        elif not self._remote_ends and not self.link.is_terminated():
            here, there = self.start_session(servers[-1]), servers[-1].start_session(self)
            here.remote, there.remote = there, here
            here.pump()
            there.pump()

    def start_session(self, other: SimulatedTransport) -> SimulatedPeer:
        """Start a session with another node."""
        roles = f"{self.link.parent.role} {other.link.parent.role}"
        # The same in every run. It need not be random: no other program can read what is sent in memory.
        nonce = hashlib.blake2b(roles.encode(), digest_size=NONCE_BYTES).digest()
        peer = SimulatedPeer(self.peers.new_session(nonce), self, self.peers.new_channel())
        self._remote_ends.append(peer)
        return peer

    def receive(self, peer: SimulatedPeer, frame: bytes) -> None:
        """Receive a frame."""
        session = peer.session
        if peer.is_gone or self.link.parent.is_terminated:
            return
        pages = session.receive(frame, self.clock.now_s())
        if session.is_up and not peer.is_admitted:
            peer.is_admitted = True
            self.peers.admit(peer)
            self.link.report(self.clock.now_s())
        self.link.accept_pages(pages, peer)
        self._pump(peer)

    def _pump(self, peer: SimulatedPeer) -> None:
        peer.pump()
        if peer.session.is_closed and not peer.is_gone:
            peer.is_gone = True
            self._remote_ends.remove(peer)
            self.link.reason = peer.session.reason
            if peer.is_admitted:
                self.peers.remove(peer)

    def round(self) -> None:
        """Do what is due; see Transport."""
        now_s = self.clock.now_s()
        for peer in list(self._remote_ends):
            peer.session.tick(now_s)
            self._pump(peer)
        if not self._is_server and not self._remote_ends:
            self._connect()
        self.link.report(now_s)

    def drain_and_close(self) -> None:
        """Send the goodbye message; see Transport."""
        self._rendezvous.remove(self.clock, self)
        for peer in list(self._remote_ends):
            peer.session.bye(self.peers.bye_reason())
            self._pump(peer)
