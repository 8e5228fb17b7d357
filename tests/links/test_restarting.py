"""Delays between attempts to connect: they grow, are bounded, and differ between clients."""

from itertools import pairwise
from random import Random

import pytest

from snr_sim.links.restarting import MAX_RETRY_S, RETRY_FIRST_S, BackOff


class MaximumRandom(Random):
    """Always returns the maximum."""

    def uniform(self, a: float, b: float) -> float:
        return b


def test_delay_doubles_up_to_the_maximum_and_reset_returns_to_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("snr_sim.links.restarting.Random", MaximumRandom)
    back_off = BackOff()
    waits_s = [back_off.next_s() for _ in range(12)]
    assert waits_s[0] == RETRY_FIRST_S
    assert all(later == min(2.0 * wait, MAX_RETRY_S) for wait, later in pairwise(waits_s))
    assert waits_s[-1] == MAX_RETRY_S
    back_off.reset()
    assert back_off.next_s() == RETRY_FIRST_S


def test_delay_is_random_and_at_least_half_of_the_maximum() -> None:
    back_off, other = BackOff(), BackOff()
    assert [back_off.next_s() for _ in range(10)] != [other.next_s() for _ in range(10)]
    waits_s = [back_off.next_s() for _ in range(1000)]
    assert 0.5 * MAX_RETRY_S <= min(waits_s) < 0.55 * MAX_RETRY_S
    assert 0.95 * MAX_RETRY_S < max(waits_s) <= MAX_RETRY_S
