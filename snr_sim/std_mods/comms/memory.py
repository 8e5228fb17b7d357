"""MemoryLink: carries pages between nodes of one simulated run, with the delay, loss and width of a real link.

Pages cross as bytes, as they would on a wire: what arrives is a copy, and what a wire cannot carry fails here too.
At the far end a page enters through the door, as any input, from the source `link_<sending role>`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from snr_sim.core.clocks import SimClock
from snr_sim.core.component import CORE_NAME
from snr_sim.core.node import Node
from snr_sim.core.node_core import NodeCore
from snr_sim.prelude.component import RoleName
from snr_sim.prelude.errors import ConfigError, ParameterError, UnknownName, nearest
from snr_sim.prelude.page import DataKey, Page
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.task import Task

if TYPE_CHECKING:
    import numpy as np

BEFORE_LOOPS = -1  # of what is due at one moment, pages arrive first, so that loops find them


@dataclass(frozen=True)
class Quality:
    """How well a link carries.

    Args:
        latency_s: of every page.
        jitter_s: further delay, evenly spread from 0 to this.
        loss: share of pages that never arrive, 0 to 1.
        bandwidth_bps: bits per second; pages queue for it. None is any number.
    """

    latency_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    bandwidth_bps: float | None = None

    def __post_init__(self) -> None:
        for name, least, most in (("latency_s", 0, math.inf), ("jitter_s", 0, math.inf), ("loss", 0, 1)):
            value = getattr(self, name)
            if not (math.isfinite(value) and least <= value <= most):
                raise ParameterError(f"A link with {name}={value!r}.", fix=f"a number from {least} to {most}.")
        if self.bandwidth_bps is not None and not self.bandwidth_bps > 0:
            raise ParameterError(f"A link with bandwidth_bps={self.bandwidth_bps!r}.", fix="9600.0, or None.")


class MemoryLink:
    """Sends the pages of some keys from one role to another. Keeps the promise of Link.

    Pages arrive in the order in which they were sent, as over TCP: one that jitter holds up holds up those behind
    it. A page never goes back over the link it came by, nor to the node that made it, so nothing goes in circles.

    Args:
        keys: of the pages.
        from_role: where they are stored first.
        to_role: where they arrive.
        latency_s: of every page.
        jitter_s: further delay, evenly spread from 0 to this.
        loss: share of pages that never arrive, 0 to 1.
        bandwidth_bps: bits per second; None is any number.
        seed: of jitter and loss; the run's if not given.
        both_ways: pages of these keys go the other way too, with a delay, loss and width of their own.

    Raises:
        ConfigError: `keys` is one text, or both ends are one role.
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
    ) -> None:
        if isinstance(keys, str):
            raise ConfigError(f"A link's keys are a list, not the text {keys!r}.", fix=f"[{keys!r}].")
        if from_role == to_role:
            raise ConfigError(f"A link from '{from_role}' to itself.", fix="two roles.")
        self.keys = list(dict.fromkeys(keys))
        self.from_role = from_role
        self.to_role = to_role
        self.quality = Quality(latency_s, jitter_s, loss, bandwidth_bps)
        self.seed = seed
        self.both_ways = both_ways
        self.ways: list[OneWay] = []

    def attach(self, nodes: Mapping[RoleName, Node], clock: SimClock) -> None:
        """Connects the two nodes, before they begin.

        Raises:
            UnknownName: one of the roles does not run.
        """
        for role in (self.from_role, self.to_role):
            if role not in nodes:
                raise UnknownName(f"A link needs the role '{role}', which does not run.", fix=nearest(role, nodes))
        one, other = nodes[self.from_role], nodes[self.to_role]
        self.ways = [OneWay(one, other, clock, self.quality, self.seed)]
        if self.both_ways:
            back = OneWay(other, one, clock, self.quality, self.seed)
            self.ways[0].back, back.back = back, self.ways[0]
            self.ways.append(back)
        for way in self.ways:
            core = way.sender.components[CORE_NAME]
            assert isinstance(core, NodeCore)
            for key in self.keys:
                core.taps.setdefault(key, []).append(way.send)


class OneWay:
    """One direction of a link.

    Args:
        sender: the node whose pages are tapped.
        receiver: the node they enter.
        clock: has them delivered.
        quality: of this direction.
        seed: of its chance; the sender's if None.
    """

    def __init__(self, sender: Node, receiver: Node, clock: SimClock, quality: Quality, seed: int | None) -> None:
        self.sender = sender
        self.receiver = receiver
        self.back: OneWay | None = None
        self.sent = 0
        self.lost = 0
        self.delivered = 0
        self._clock = clock
        self._quality = quality
        self._rng: np.random.Generator | None = None
        if quality.jitter_s or quality.loss:
            seed = sender.seed if seed is None else seed
            self._rng = rng_for(seed, f"link:{sender.role}->{receiver.role}")
        self._free_s = 0.0  # when the last page has left
        self._last_arrival_s = 0.0
        self._brought: dict[int, Page] = {}  # pages that came by this way and have not been stored yet, by identity

    def send(self, page: Page) -> None:
        """Sends a page on its way, unless it came from there."""
        if page.origin == self.receiver.name or (self.back is not None and self.back.has_brought(page)):
            return
        self.sent += 1
        raw = page.serialize()
        copy = Page.deserialize(raw)  # here and not on arrival: what no wire can carry is the sender's mistake
        left_s = self._time_of_leaving(len(raw))
        is_lost, jitter_s = self._chance()
        if is_lost:
            self.lost += 1
            return
        arrival_s = max(self._last_arrival_s, left_s + self._quality.latency_s + jitter_s)
        self._last_arrival_s = arrival_s
        self._clock.call_at(arrival_s, partial(self._deliver, copy), BEFORE_LOOPS)

    def has_brought(self, page: Page) -> bool:
        """Returns whether this very page came by this way; asked once, when it is stored."""
        return self._brought.pop(id(page), None) is page

    def _time_of_leaving(self, size_bytes: int) -> float:
        start_s = max(self._clock.now_s(), self._free_s)
        bandwidth_bps = self._quality.bandwidth_bps
        self._free_s = start_s + (size_bytes * 8 / bandwidth_bps if bandwidth_bps is not None else 0.0)
        return self._free_s

    def _chance(self) -> tuple[bool, float]:
        """Whether a page is lost, and its jitter. Both are drawn for each page, so neither shifts the other."""
        if self._rng is None:
            return False, 0.0
        for_loss, for_jitter = self._rng.random(2)
        return bool(for_loss < self._quality.loss), float(for_jitter) * self._quality.jitter_s

    def _deliver(self, page: Page) -> None:
        if self.receiver.is_terminated:
            return
        self.delivered += 1
        if self.back is not None:
            self._brought[id(page)] = page
        self.receiver.enter(Task.store_page(page), f"link_{self.sender.role}")
