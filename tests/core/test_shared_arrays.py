"""Arrays through memory that two processes see: whole, however many, however large, and with nothing left behind."""

import os
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from snr_sim import Page
from snr_sim.core.process.shared_arrays import (
    SHARED,
    SHARED_FROM_BYTES,
    SLOTS,
    ArrayReceiver,
    ArraySender,
    make_shared_file,
)
from snr_sim.prelude.page import KINDS
from snr_sim.prelude.values import decode_value, encode_value

LARGE = SHARED_FROM_BYTES // 8  # so many float64


class Way:
    """Both ends; what goes in at one comes out at the other."""

    def __init__(self) -> None:
        file = make_shared_file()
        self.sender, self.receiver = ArraySender(file), ArrayReceiver(os.dup(file))

    def send(self, value: Any) -> bytes:
        return encode_value(self.sender.share(value))

    def receive(self, raw: bytes) -> Any:
        value = decode_value(raw, {**KINDS, SHARED: self.receiver.copy})
        self.sender.take_back(self.receiver.emptied)
        self.receiver.emptied = []
        return value

    def close(self) -> None:
        self.sender.close()
        self.receiver.close()


@pytest.fixture
def way() -> Iterator[Way]:
    before = len(os.listdir("/proc/self/fd"))
    way = Way()
    yield way
    way.close()
    assert len(os.listdir("/proc/self/fd")) == before


@pytest.mark.parametrize(
    "array",
    [
        np.arange(LARGE, dtype=np.float64),
        np.arange(2 * LARGE, dtype=np.float64).reshape(2, -1)[:, ::-2].T,
        np.full((3, LARGE), np.nan),
        np.zeros((LARGE, 16), dtype=bool),
        np.arange(8 * LARGE, dtype=">u2"),
        np.ones(LARGE) * (1 + 2j),
    ],
)
def test_an_array_comes_out_as_it_went_in_and_its_bytes_are_not_in_the_text(way: Way, array: Any) -> None:
    raw = way.send([1, {"image": array}])
    assert len(raw) < 200
    image = way.receive(raw)[1]["image"]
    assert image.dtype == array.dtype
    np.testing.assert_array_equal(image, array)
    image[...] = 0  # the receiver's own


def test_small_arrays_and_those_of_no_plain_type_go_as_text(way: Way) -> None:
    for array in (np.arange(LARGE - 1.0), np.array(["depth"] * LARGE)):
        raw = way.send(array)
        assert b'"shared"' not in raw
        np.testing.assert_array_equal(way.receive(raw), array)


def test_arrays_inside_pages_tuples_and_lists_are_found(way: Way) -> None:
    big = np.arange(LARGE, dtype=np.float64)
    page = Page("frames", (big, [big + 1]), "r_node", 0.5)
    back = way.receive(way.send(["task", page]))[1]
    assert (back.key, back.created_at_s, type(back.data)) == ("frames", 0.5, tuple)
    np.testing.assert_array_equal(back.data[1][0], big + 1)


def test_when_no_slot_gets_free_an_array_goes_as_text_and_is_as_right(way: Way) -> None:
    arrays = [np.full(LARGE, float(i)) for i in range(SLOTS + 1)]
    sent = [way.send(array) for array in arrays]
    assert [b'"shared"' in raw for raw in sent] == [True] * SLOTS + [False]
    for raw, array in zip(sent, arrays, strict=True):
        np.testing.assert_array_equal(way.receive(raw), array)
    assert b'"shared"' in way.send(arrays[0])  # there are free ones again


@pytest.mark.slow
def test_a_sender_waits_a_moment_for_a_slot_that_is_being_emptied(way: Way) -> None:
    sent = [way.send(np.full(LARGE, float(i))) for i in range(SLOTS)]
    thread = threading.Timer(0.01, way.receive, [sent[0]])
    thread.start()
    assert b'"shared"' in way.send(np.zeros(LARGE))
    thread.join()


def test_arrays_that_grow_find_room_and_leave_behind_no_more_than_they_use(way: Way) -> None:
    largest = LARGE
    for i in range(200):
        largest = LARGE + 400 * i
        array = np.full(largest, float(i))
        np.testing.assert_array_equal(way.receive(way.send(array)), array)
    file_bytes = os.fstat(way.receiver._file).st_size
    assert file_bytes <= 4 * SLOTS * 8 * largest
