"""Messages between two processes: large arrays arrive whole and in order, and an end is detected at any point."""

import os
import threading
from collections.abc import Iterator
from multiprocessing import Pipe
from typing import Any

import numpy as np
import pytest

from snr_sim import Page
from snr_sim.core.process.messages import BYTES_FROM, MessageLine
from snr_sim.prelude.errors import ValueEncodingError

LARGE = BYTES_FROM // 8  # so many float64
pytestmark = pytest.mark.slow  # a thread sends what does not fit into the line


@pytest.fixture
def ends() -> Iterator[tuple[MessageLine, MessageLine]]:
    before = len(os.listdir("/proc/self/fd"))
    here, there = map(MessageLine, Pipe())
    yield here, there
    for end in (here, there):
        if not end._connection.closed:
            end.close()
    assert len(os.listdir("/proc/self/fd")) == before


def sent(ends: tuple[MessageLine, MessageLine], *values: Any) -> tuple[bytes, list[Any]]:
    """The text of a message and what comes out; an array may be larger than what fits into the line."""
    here, there = ends
    thread = threading.Thread(target=here.send, args=("task", *values))
    thread.start()
    raw = there.receive_bytes()
    kind, *back = there.decode(raw)
    thread.join()
    assert kind == "task"
    return raw, back


@pytest.mark.parametrize(
    "array",
    [
        np.arange(LARGE, dtype=np.float64),
        np.arange(2 * LARGE, dtype=np.float64).reshape(2, -1)[:, ::-2].T,
        np.full((3, LARGE), np.nan),
        np.zeros((LARGE, 16), dtype=bool),
        np.arange(8 * LARGE, dtype=">u2"),
        np.zeros((64, LARGE)),
    ],
)
def test_an_array_comes_out_as_it_went_in_and_its_bytes_are_not_in_the_text(ends: Any, array: Any) -> None:
    raw, (_, back) = sent(ends, 1, {"image": array})
    assert len(raw) < 200
    assert back["image"].dtype == array.dtype
    np.testing.assert_array_equal(back["image"], array)
    back["image"][...] = 0  # the receiver's own


def test_small_arrays_go_as_text_and_those_of_no_real_numbers_raise(ends: Any) -> None:
    array = np.arange(LARGE - 1.0)
    raw, (back,) = sent(ends, array)
    assert b'"array_bytes"' not in raw
    np.testing.assert_array_equal(back, array)
    with pytest.raises(ValueEncodingError, match="holds an object that cannot be sent"):
        ends[0].send("task", "store_page", "eye", np.array(["depth"] * LARGE))


def test_arrays_inside_pages_tuples_and_lists_are_found(ends: Any) -> None:
    big = np.arange(LARGE, dtype=np.float64)
    _, (back, after) = sent(ends, Page("frames", (big, [big + 1]), "r_node", 0.5), {7: big + 2})
    assert (back.key, back.created_at_s, type(back.data)) == ("frames", 0.5, tuple)
    np.testing.assert_array_equal(back.data[0], big)
    np.testing.assert_array_equal(back.data[1][0], big + 1)
    np.testing.assert_array_equal(after[7], big + 2)


def test_object_is_rejected_and_connection_stays_open(ends: Any) -> None:
    with pytest.raises(ValueEncodingError, match="store_page 'eye' holds an object that cannot be sent"):
        ends[0].send("task", "store_page", "eye", threading.Event())
    assert sent(ends, 1)[1] == [1]


def test_an_end_in_the_middle_of_an_array_is_the_end_of_the_line(ends: Any) -> None:
    here, there = ends
    thread = threading.Thread(target=here.send, args=("task", np.zeros(100 * LARGE)))
    thread.start()
    raw = there.receive_bytes()
    here.close()  # which the sending thread notices
    thread.join()
    with pytest.raises(EOFError):
        there.decode(raw)
    assert not there.send("task", 1)


def test_a_process_that_died_in_the_middle_of_an_array_is_not_waited_for() -> None:
    """Another one, which it had forked, keeps the far end open."""
    here, there = Pipe()
    pidfd, dead = os.pipe()
    line = MessageLine(there, pidfd=pidfd)
    MessageLine(here).send_bytes(b'["task", {"$": "array_bytes", "dtype": "|u1", "shape": [9]}]')
    os.close(dead)
    with pytest.raises(EOFError):
        line.receive()
    os.close(pidfd)
    line.close()
    here.close()
