"""Faults of a link: effect of latency, jitter, loss, duplication, reordering, cuts and bandwidth on what is sent.

A `LossyChannel` takes what is sent and when, and returns when it arrives: never, once, or twice. It has
neither clock nor port, so the same class serves simulated links and real sockets.
"""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, TypeGuard

from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.rng import rng_for

if TYPE_CHECKING:
    import numpy as np

MAX_DELAY_S = 86_400.0  # a day
# Minimum transit time under a virtual clock, whatever the faults: no link is faster than one between two programs on
# one computer, where a page takes 45 to 90 us one way (`snr bench links`). Without it, two nodes that reply to each
# other would do so indefinitely at one instant.
MIN_TRANSIT_S = 50e-6
DRAWN_AT_ONCE = 256


@dataclass(frozen=True)
class LinkFaults:
    """Faults of a link. Loss, duplication and reordering affect pages only; the rest affects everything that is sent.

    Args:
        latency_s: delay of everything; a day at most.
        jitter_s: additional delay, uniformly distributed from 0 to this.
        loss: fraction of pages that never arrive, 0 to 1.
        duplication: fraction of pages that arrive twice.
        reordering: fraction of pages that do not wait for those before them, and may themselves be delayed by up to
            `jitter_s` and `latency_s` more.
        cut: intervals (start_s, end_s) in which nothing that is sent arrives.
        bandwidth_bps: bits per second, 1 or more; pages queue for it. None is unlimited.
        seed: of its random numbers; the run's if None.

    Raises:
        ParameterError: a number is invalid or out of range.
    """

    latency_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0
    cut: tuple[tuple[float, float], ...] = ()
    bandwidth_bps: float | None = None
    seed: int | None = None

    def __post_init__(self) -> None:
        bounds = {"latency_s": MAX_DELAY_S, "jitter_s": MAX_DELAY_S, "loss": 1, "duplication": 1, "reordering": 1}
        for name, max_value in bounds.items():
            value = getattr(self, name)
            if not (is_number(value) and 0 <= value <= max_value):
                raise invalid_option(name, value, f"use a number from 0 to {max_value:g}.")
        if not (self.bandwidth_bps is None or (is_number(self.bandwidth_bps) and self.bandwidth_bps >= 1)):
            fix = "use 9600.0 or another number of at least 1, or None."
            raise invalid_option("bandwidth_bps", self.bandwidth_bps, fix)
        seed: Any = self.seed
        if seed is not None and (isinstance(seed, bool) or not isinstance(seed, Integral)):
            raise invalid_option("seed", seed, "use an integer, or None for the run's seed.")
        if self.reordering and not self.latency_s + self.jitter_s:
            raise ParameterError(
                f"reordering={self.reordering!r} has no effect on a link without delay.", fix="add latency_s=0.05."
            )
        _check_cut(self.cut)


def _check_cut(cut: Any) -> None:
    fix = "cut=((start_s, end_s), ...), or () for none."
    if not isinstance(cut, (tuple, list)):
        raise invalid_option("cut", cut, fix)
    if _is_interval(cut):
        raise invalid_option("cut", cut, f"did you mean cut=({tuple(cut)!r},)?")
    for interval in cut:
        if not _is_interval(interval):
            raise ParameterError(f"{repr(interval)[:80]} is not a valid cut of a link.", fix=fix)


def _is_interval(value: Any) -> bool:
    is_pair = isinstance(value, (tuple, list)) and len(value) == 2 and all(map(is_number, value))
    return is_pair and bool(value[0] <= value[1])


def is_number(value: Any) -> TypeGuard[float]:
    """Whether a value is a real number and not a truth value."""
    return isinstance(value, Real) and not isinstance(value, bool)


def invalid_option(name: str, value: object, fix: str) -> ParameterError:
    """Return the error for an invalid option of a link."""
    return ParameterError(f"{name}={repr(value)[:80]} is not valid for a link.", fix=fix)


class UniformStream:
    """Random numbers from 0 to 1, drawn in batches: the same as in pairs, in a tenth of the time."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._left: list[float] = []  # the next one last

    def next_pair(self) -> tuple[float, float]:
        """Return the next two."""
        if not self._left:
            self._left = self._rng.random(DRAWN_AT_ONCE).tolist()[::-1]
        return self._left.pop(), self._left.pop()


class LossyChannel:
    """One direction of a link with faults; a lossy channel.

    Args:
        faults: of this direction.
        seed: of the run.
        name: of the direction; directions of different names have different random numbers.
        min_transit_s: minimum transit time; for a link without a real wire.
    """

    def __init__(self, faults: LinkFaults, seed: int, name: str, min_transit_s: float = 0.0) -> None:
        self.faults: LinkFaults = faults
        self.free_s: float = 0.0  # when the last frame has been sent, and the next can leave
        self.lost: int = 0  # pages
        self.duplicated: int = 0  # pages
        self._min_transit_s = min_transit_s
        self._last_arrival_s = 0.0
        seed = seed if faults.seed is None else faults.seed
        # Two generators, and each draws for every page: so more of one fault does not change those of another.
        self._uniforms = UniformStream(rng_for(seed, name)) if faults.jitter_s or faults.loss else None
        self._order_uniforms = (
            UniformStream(rng_for(seed, f"{name}:odd")) if faults.duplication or faults.reordering else None
        )

    def arrivals_s(self, size_bytes: int, now_s: float, is_page: bool = True) -> tuple[float, ...]:
        """Return when what is sent now arrives: never, once or twice, in order unless reordered."""
        faults = self.faults
        start_s = max(now_s, self.free_s)
        self.free_s = start_s + (size_bytes * 8 / faults.bandwidth_bps if faults.bandwidth_bps is not None else 0.0)
        for_loss, for_jitter = (1.0, 0.0) if self._uniforms is None else self._uniforms.next_pair()
        is_cut = any(begin_s <= now_s < end_s for begin_s, end_s in faults.cut)
        if is_cut or (is_page and for_loss < faults.loss):
            self.lost += is_page
            return ()
        delay_s = max(faults.latency_s + for_jitter * faults.jitter_s, self._min_transit_s)
        if is_page and self._order_uniforms is not None:
            return self._unordered_arrivals_s(self._order_uniforms, delay_s)
        return (self._in_order_s(delay_s),)

    def _unordered_arrivals_s(self, uniforms: UniformStream, delay_s: float) -> tuple[float, ...]:
        for_duplication, for_reordering = uniforms.next_pair()
        if for_reordering < self.faults.reordering:
            # The delay is derived from the same number, rescaled to a uniform distribution.
            fraction = for_reordering / self.faults.reordering
            arrival_s = self.free_s + delay_s + fraction * (self.faults.latency_s + self.faults.jitter_s)
        else:
            arrival_s = self._in_order_s(delay_s)
        if for_duplication >= self.faults.duplication:
            return (arrival_s,)
        self.duplicated += 1
        return (arrival_s, arrival_s)

    def _in_order_s(self, delay_s: float) -> float:
        """Return the delay that keeps the order: one delayed by jitter also delays those behind it, as over TCP."""
        self._last_arrival_s = max(self._last_arrival_s, self.free_s + delay_s)
        return self._last_arrival_s
