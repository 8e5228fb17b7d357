"""Delays between attempts to connect: they grow, are bounded, and differ between clients."""

from itertools import pairwise
from random import Random

from snr_sim.links.back_off import RETRY_FIRST_S, RETRY_MOST_S, BackOff


class NoLuck(Random):
    """Always returns the maximum."""

    def uniform(self, a: float, b: float) -> float:
        return b


def test_waits_double_up_to_the_most() -> None:
    back_off = BackOff(NoLuck())
    waits_s = [back_off.next_s() for _ in range(12)]
    assert waits_s[0] == RETRY_FIRST_S
    assert all(later == min(2.0 * wait, RETRY_MOST_S) for wait, later in pairwise(waits_s))
    assert waits_s[-1] == RETRY_MOST_S


def test_each_wait_is_cut_by_chance_but_never_below_half() -> None:
    back_off = BackOff(Random(1))
    for _ in range(10):
        back_off.next_s()
    waits_s = [back_off.next_s() for _ in range(1000)]
    assert 0.5 * RETRY_MOST_S <= min(waits_s) < 0.55 * RETRY_MOST_S
    assert 0.95 * RETRY_MOST_S < max(waits_s) <= RETRY_MOST_S


def test_two_callers_do_not_wait_alike() -> None:
    one, other = BackOff(), BackOff()
    assert [one.next_s() for _ in range(5)] != [other.next_s() for _ in range(5)]


def test_after_a_good_connection_the_next_call_comes_soon() -> None:
    back_off = BackOff()
    for _ in range(8):
        back_off.next_s()
    back_off.forget()
    assert back_off.next_s() <= RETRY_FIRST_S
