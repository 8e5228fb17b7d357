"""Queues of a link: bounded in pages and in bytes; dropped pages are counted; no peer waits for more than a round."""

from collections import defaultdict

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.links.queues import SHARE_BYTES, FairQueue, Policy, SendQueue

BATCH_BYTES = 1 << 17
puts = st.lists(st.tuples(st.sampled_from("abcd"), st.sampled_from([1, 100, 5000, 100_000])), max_size=60)


def test_full_queue_drops_the_oldest_or_refuses_the_newest() -> None:
    oldest, newest = SendQueue(2, "drop_oldest"), SendQueue(2, "refuse")
    for frame in (b"1", b"2", b"3"):
        oldest.put(frame)
        newest.put(frame)
    assert (oldest.take(), newest.take()) == ([b"2", b"3"], [b"1", b"2"])
    assert oldest.dropped == newest.dropped == 1


def test_bytes_are_bounded_and_one_frame_always_fits() -> None:
    queue = SendQueue(100, max_bytes=10)
    for frame in (b"four", b"four", b"four", b"a long frame of 26 bytes .."):
        queue.put(frame)
    assert queue.take() == [b"a long frame of 26 bytes .."]
    assert queue.dropped == 3


def test_take_returns_frames_for_one_write() -> None:
    queue = SendQueue()
    for _ in range(10):
        queue.put(b"12345")
    assert len(queue.take(max_bytes=12)) == 3
    assert (len(queue), queue.waiting_bytes) == (7, 35)


@given(
    st.lists(st.one_of(st.binary(max_size=20), st.none()), max_size=60),
    st.sampled_from(["drop_oldest", "refuse"]),
    st.integers(1, 5),
    st.integers(1, 40),
)
def test_every_page_is_taken_in_order_or_counted(
    steps: list[bytes | None], policy: Policy, max_pages: int, max_bytes: int
) -> None:
    queue, put, taken = SendQueue(max_pages, policy, max_bytes), [], []
    for step in steps:
        if step is None:
            taken += queue.take(10)
        else:
            put.append(step)
            queue.put(step)
        assert len(queue) <= max_pages
        assert queue.waiting_bytes <= max_bytes or len(queue) == 1
    taken += queue.take()
    assert len(taken) + queue.dropped == len(put)
    rest = iter(put)
    assert all(frame in rest for frame in taken)  # in order
    assert queue.waiting_bytes == 0


class Frame(bytes):
    """A frame of a peer with a number."""

    peer: str
    number: int


def frame_of(peer: str, number: int, size: int) -> Frame:
    frame = Frame(size)
    frame.peer, frame.number = peer, number
    return frame


@given(puts, st.integers(1, 20), st.sampled_from(["drop_oldest", "refuse"]), st.data())
def test_frames_of_each_peer_are_in_order_and_bounded(
    arriving: list[tuple[str, int]], max_pages: int, policy: Policy, data: st.DataObject
) -> None:
    queue: FairQueue[Frame] = FairQueue(max_pages, policy, max_bytes=200_000)
    taken: dict[str, list[int]] = defaultdict(list)

    def take() -> None:
        batch = queue.take(data.draw(st.sampled_from([1, 10_000, BATCH_BYTES])))
        assert batch or not len(queue)
        for frame in batch:
            taken[frame.peer].append(frame.number)

    for number, (peer, size) in enumerate(arriving):
        queue.put(peer, frame_of(peer, number, size))
        assert len(queue) <= max_pages
        if data.draw(st.booleans()):
            take()
    while len(queue):
        take()
    assert all(numbers == sorted(set(numbers)) for numbers in taken.values())
    assert sum(map(len, taken.values())) + queue.dropped == len(arriving)


@given(st.lists(st.sampled_from([1, 100, 5000, 100_000]), min_size=1, max_size=300), st.sampled_from([3, 10_000]))
def test_flood_of_one_peer_neither_delays_nor_drops_a_page_of_another(sizes: list[int], max_pages: int) -> None:
    queue: FairQueue[Frame] = FairQueue(max_pages)
    for number, size in enumerate(sizes):
        queue.put("flood", frame_of("flood", number, size))
    queue.put("pilot", frame_of("pilot", 0, 100))
    before = 0
    for frame in queue.take(1 << 30):
        if frame.peer == "pilot":
            break
        before += len(frame)
    else:
        pytest.fail("the pilot's page was dropped")
    assert before < SHARE_BYTES + max(sizes)


def test_refusing_queue_keeps_what_has_come_first() -> None:
    queue: FairQueue[bytes] = FairQueue(2, "refuse")
    for frame in (b"1", b"2", b"3"):
        queue.put("a", frame)
    assert (queue.take(100), queue.dropped) == ([b"1", b"2"], 1)
