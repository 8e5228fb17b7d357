"""MemoryLink: carries pages between nodes of one simulated run, with the delay, loss and bandwidth of a real link.

Pages are serialised, as on a wire: what arrives is a copy, and what a wire cannot carry fails here too.
The remote node receives a page in its inbox, as any input, from the source `link_<sending role>`.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from functools import partial

from snr_sim.core.clocks import SimClock
from snr_sim.core.node import Node
from snr_sim.links.faults import MIN_TRANSIT_S, LinkFaults, LossyChannel
from snr_sim.links.link import BEFORE_LOOPS, UnsendablePages
from snr_sim.links.messages import encode_page
from snr_sim.prelude.component import RoleName
from snr_sim.prelude.errors import ConfigError, SnrError, UnknownNameError, suggest
from snr_sim.prelude.task import DataKey, Page, Task


class MemoryLink:
    """Sends the pages of some keys from one role to another. Implements `NodeLink`.

    Pages arrive in the order in which they were sent, as over TCP: one delayed by jitter also delays those behind it. A
    page is never sent back over the link it came by, nor to the node that made it, so nothing circulates.

    Args:
        keys: of the pages.
        from_role: role that stores them first.
        to_role: role that receives them.
        latency_s: delay of every page; `MIN_TRANSIT_S` at least.
        jitter_s: additional delay, uniformly distributed from 0 to this.
        loss: fraction of pages that never arrive, 0 to 1.
        bandwidth_bps: bits per second; None is unlimited.
        seed: of jitter and loss; the run's if not given.
        both_ways: also send pages of these keys in the other direction, with its own delay, loss and bandwidth.
        faults: replaces the five numbers above, for other kinds of faults.

    Raises:
        ConfigError: `keys` is a single string, or both ends are one role.
        ParameterError: a number is out of range.
    """

    def __init__(
        self,
        keys: Sequence[DataKey],
        from_role: RoleName,
        to_role: RoleName,
        latency_s: float = 0.0,
        jitter_s: float = 0.0,
        loss: float = 0.0,
        bandwidth_bps: float | None = None,
        seed: int | None = None,
        both_ways: bool = False,
        faults: LinkFaults | None = None,
    ) -> None:
        if isinstance(keys, str):
            raise ConfigError(f"The keys of a link must be a list, not the string {keys!r}.", fix=f"[{keys!r}].")
        if from_role == to_role:
            raise ConfigError(f"A link cannot connect the role '{from_role}' to itself.", fix="use two roles.")
        self.keys: list[DataKey] = list(dict.fromkeys(keys))
        self.from_role: RoleName = from_role
        self.to_role: RoleName = to_role
        self.faults: LinkFaults = faults or LinkFaults(
            latency_s, jitter_s, loss, bandwidth_bps=bandwidth_bps, seed=seed
        )
        self.both_ways: bool = both_ways
        self.directions: list[OneWay] = []

    def attach(self, nodes: Mapping[RoleName, Node], clock: SimClock) -> None:
        """Connect the two nodes, before they begin.

        Raises:
            UnknownNameError: one of the roles does not run.
        """
        for role in (self.from_role, self.to_role):
            if role not in nodes:
                raise UnknownNameError(f"A link needs the role '{role}', which does not run.", fix=suggest(role, nodes))
        one, other = nodes[self.from_role], nodes[self.to_role]
        self.directions = [OneWay(one, other, clock, self.faults)]
        if self.both_ways:
            back = OneWay(other, one, clock, self.faults)
            self.directions[0].back, back.back = back, self.directions[0]
            self.directions.append(back)
        for direction in self.directions:
            for key in self.keys:
                direction.sender.add_store_listener(key, direction.send)


class OneWay:
    """One direction of a link."""

    def __init__(self, sender: Node, receiver: Node, clock: SimClock, faults: LinkFaults) -> None:
        self.sender: Node = sender
        self.receiver: Node = receiver
        self.back: OneWay | None = None
        self.sent: int = 0
        self.delivered: int = 0
        self.dropped: int = 0  # pages of other nodes that cannot be serialised
        self._clock = clock
        self._channel = LossyChannel(faults, sender.seed, f"link:{sender.role}->{receiver.role}", MIN_TRANSIT_S)
        logger = logging.getLogger(f"snr.{sender.name}.link_{receiver.role}")
        self._unsendable = UnsendablePages(sender, f"The link from '{sender.role}' to '{receiver.role}'", logger)
        self._unstored: dict[int, Page] = {}  # pages that arrived in this direction and are not stored yet, by identity

    @property
    def lost(self) -> int:
        """Number of pages that never arrived."""
        return self._channel.lost

    def send(self, page: Page) -> None:
        """Send a page, unless it came from the receiver."""
        if page.origin == self.receiver.name or (self.back is not None and self.back.has_delivered(page)):
            return
        try:
            raw = encode_page(page)
        except SnrError as error:
            self._unsendable.drop(page, error)
            self.dropped += 1
            return
        self.sent += 1
        for arrival_s in self._channel.arrivals_s(len(raw), self._clock.now_s()):
            self._clock.call_at(arrival_s, partial(self._deliver, raw), BEFORE_LOOPS)

    def has_delivered(self, page: Page) -> bool:
        """Return whether this exact page arrived in this direction; called once, when it is stored."""
        return self._unstored.pop(id(page), None) is page

    def _deliver(self, raw: bytes) -> None:
        if self.receiver.is_terminated:
            return
        page = Page.deserialize(raw)
        self.delivered += 1
        if self.back is not None:
            self._unstored[id(page)] = page
        self.receiver.enqueue_input(Task.store_page(page), f"link_{self.sender.role}")
