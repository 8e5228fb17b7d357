"""SimulatedFleetLink: a net's nodes under one SimClock. They meet in memory; each pair has its own way, with faults."""

from __future__ import annotations

from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

from snr_sim.core.clocks import SimClock
from snr_sim.core.loop import LoopFactory
from snr_sim.links.faults import LEAST_TRANSIT_S, Faults, Way
from snr_sim.links.fleet import PING_BYTES, FleetLink, Hearing, Member
from snr_sim.links.link import BEFORE_LOOPS, by_name
from snr_sim.links.options import LinkOptions
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.page import DataKey, Page


class Gathering:
    """Where the nodes of one net find each other, per clock."""

    def __init__(self) -> None:
        self._links: WeakKeyDictionary[SimClock, list[SimulatedFleetLink]] = WeakKeyDictionary()

    def __reduce__(self) -> tuple[type[Gathering], tuple[()]]:
        """Return an empty one for another process: clocks stay where they are."""
        return Gathering, ()

    def links_on(self, clock: SimClock) -> list[SimulatedFleetLink]:
        """Returns those that are there, in the order in which they came; to be changed in place."""
        return self._links.setdefault(clock, [])


class SimulatedFar:
    """Another node of the net.

    Args:
        link: of that node.
        way: to it.
        now_s: when it was met.
    """

    def __init__(self, link: SimulatedFleetLink, way: Way, now_s: float) -> None:
        self.link = link
        self.way = way
        self.heard_s = now_s
        self.rtt_s: float | None = None


class SimulatedFleetLink(FleetLink):
    """A node's link to all others of its net; alone it is down, and runs all the same.

    Args:
        factory, parent, options, member, hearing: as of FleetLink.
        gathering: where it finds the others.
    """

    def __init__(
        self,
        factory: LoopFactory,
        parent: NodeApi,
        options: LinkOptions,
        member: Member,
        hearing: Hearing,
        gathering: Gathering,
    ) -> None:
        super().__init__(factory, parent, options, member, hearing)
        assert isinstance(parent.clock, SimClock)
        self.clock = parent.clock
        self.reason = "nobody else is in the net."
        self._gathering = gathering
        self._fars: dict[SimulatedFleetLink, SimulatedFar] = {}
        self._newest: dict[DataKey, bytes] = {}
        self._ping_s = 0.0

    def _open(self) -> None:
        links = self._gathering.links_on(self.clock)
        for other in links:
            other._meet(self)
            self._meet(other)
        links.append(self)

    def _meet(self, other: SimulatedFleetLink) -> None:
        name = f"link:{self.name}:{self.parent.role}->{other.parent.role}"
        way = Way(self.options.faults or Faults(), self.parent.seed, name, LEAST_TRANSIT_S)
        self._fars[other] = SimulatedFar(other, way, self.clock.now_s())
        for raw in self._newest.values():  # who comes late hears the newest of each key
            self._send_to(self._fars[other], raw)

    def _send(self, key: DataKey, raw: bytes, frame: bytes) -> None:
        self._newest.pop(key, None)  # taken out, so that the order is that of storing
        self._newest[key] = raw
        self.sent += 1
        for far in self._fars.values():
            self._send_to(far, raw)

    def _send_to(self, far: SimulatedFar, raw: bytes) -> None:
        lost = far.way.lost
        for arrival_s in far.way.arrivals_s(len(raw), self.clock.now_s()):
            self.clock.call_at(arrival_s, partial(far.link.arrive, self, raw), BEFORE_LOOPS)
        self.dropped += far.way.lost - lost

    def arrive(self, sender: SimulatedFleetLink, raw: bytes) -> None:
        """A page has come."""
        far = self._hear(sender)
        if far is not None:
            self._bring_from(sender.member, [Page.deserialize(raw)], far)

    def _hear(self, sender: SimulatedFleetLink) -> SimulatedFar | None:
        far = self._fars.get(sender)
        if far is None or self.parent.is_terminated:
            return None
        far.heard_s = self.clock.now_s()
        return far

    def _ping(self, far: SimulatedFar, asked_s: float, is_answer: bool) -> None:
        for arrival_s in far.way.arrivals_s(PING_BYTES, self.clock.now_s(), is_page=False):
            self.clock.call_at(arrival_s, partial(far.link.pinged, self, asked_s, is_answer), BEFORE_LOOPS)

    def pinged(self, sender: SimulatedFleetLink, asked_s: float, is_answer: bool) -> None:
        """Somebody asks whether this node is there, or answers that it is."""
        far = self._hear(sender)
        if far is None:
            return
        if is_answer:
            far.rtt_s = self.clock.now_s() - asked_s
        else:
            self._ping(far, asked_s, is_answer=True)

    def loop(self) -> None:
        """Asks who is there, now and then, and says how the link is."""
        now_s = self.clock.now_s()
        if now_s >= self._ping_s:
            self._ping_s = now_s + self.options.keep_alive_s
            for far in self._fars.values():
                self._ping(far, now_s, is_answer=False)
        self._report(now_s)

    def _state(self, now_s: float) -> dict[str, Any]:
        heard = [far for far in self._fars.values() if now_s - far.heard_s <= self.options.timeout_s]
        if self._fars and not heard:
            self.reason = f"nothing was heard for {self.options.timeout_s:g} s."
        trips_s = [far.rtt_s for far in heard if far.rtt_s is not None]
        return {
            "up": bool(heard),
            "age_s": max((now_s - far.heard_s for far in heard), default=None),
            "dropped": self.dropped,
            "rtt_s": max(trips_s, default=None),
            "sent": self.sent,
            "received": self.received,
            "unwanted": self.unwanted,
            "reason": "" if heard else self.reason,
            "peers": by_name(
                (far.link.member.name, {"age_s": now_s - far.heard_s, "rtt_s": far.rtt_s}) for far in heard
            ),
        }

    def halt(self) -> None:
        """Leaves the net; the others notice once what was sent before has come."""
        links = self._gathering.links_on(self.clock)
        if self in links:
            links.remove(self)
        for far in self._fars.values():
            for arrival_s in far.way.arrivals_s(PING_BYTES, self.clock.now_s(), is_page=False):
                self.clock.call_at(arrival_s, partial(far.link.left, self), BEFORE_LOOPS)
        self._fars.clear()

    def left(self, sender: SimulatedFleetLink) -> None:
        """Another node has left the net."""
        if self._fars.pop(sender, None) is not None:
            self.reason = f"'{sender.member.name}' left."
