"""The send queue: bounded in pages and in bytes; dropped pages are counted."""

from hypothesis import given
from hypothesis import strategies as st

from snr_sim.links.queues import Policy, SendQueue


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
