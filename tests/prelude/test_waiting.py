from __future__ import annotations

import random
import signal
import threading
import time
from contextlib import suppress
from queue import Empty

import pytest

from snr_sim.prelude.waiting import TimedQueue, WakeUp


def test_items_come_in_the_order_of_their_puts() -> None:
    queue: TimedQueue[int] = TimedQueue()
    for i in range(3):
        queue.put(i)
    assert [queue.get(0.0) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(Empty):
        queue.get(0.0)


def test_wake_before_a_wait_ends_it_and_only_that_one() -> None:
    wake_up = WakeUp()
    wake_up.wake()
    wake_up.wake()
    began_s = time.monotonic()
    wake_up.wait()
    assert time.monotonic() - began_s < 0.5
    wake_up.wait(0.01)
    assert time.monotonic() - began_s >= 0.01


def test_short_wait_ends_after_wake_up_for_an_item_that_is_gone() -> None:
    """With `SimpleQueue` in the place of `TimedQueue` this does not end in Python 3.11 and 3.12, within 50 rounds."""
    queue: TimedQueue[int] = TimedQueue()
    rng = random.Random(0)
    for i in range(10_000):
        queue.put(i)
        assert queue.get(0.1) == i
        with suppress(Empty):
            queue.get(3e-6 * rng.random())


@pytest.mark.slow
def test_no_item_and_no_wait_is_lost_among_signals_and_threads() -> None:
    queue: TimedQueue[int] = TimedQueue()
    rng = random.Random(0)
    before = signal.signal(signal.SIGALRM, lambda *_: queue.put(-1))
    threads = [threading.Thread(target=lambda: [queue.put(i) for i in range(20_000)]) for _ in range(2)]
    found: list[int] = []
    signal.setitimer(signal.ITIMER_REAL, 1e-4, 1e-4)
    try:
        for one in threads:
            one.start()
        while len(found) < 40_000:
            with suppress(Empty):
                item = queue.get(2e-5 * rng.random())
                found += [item] if item >= 0 else []
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    for one in threads:
        one.join()
    assert sorted(found) == sorted([*range(20_000), *range(20_000)])
