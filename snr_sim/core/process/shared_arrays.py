"""Large arrays on their way between two processes: through memory that both see, and not through the line.

The memory is a file without a name, which exists as long as one of the two has it open. So nothing is left behind
whoever dies, and however: named shared memory outlives a process that is killed. It is divided into a few slots. The
sender copies an array into a free one and sends a note of where it is; the receiver copies it out and gives the slot
back. If none gets free soon the array goes through the line, as text: slower, and just as right.
"""

from __future__ import annotations

import mmap
import os
import sys
import tempfile
import threading
from collections.abc import Iterable
from typing import Any

import msgspec
import msgspec.structs

from snr_sim.prelude.page import Page
from snr_sim.prelude.values import MARK

SHARED = "shared"  # the mark of a note
SHARED_FROM_BYTES = 16 * 1024  # below, the text in the line is as quick
SLOTS = 4
WAIT_FOR_SLOT_S = 0.1
_PLAIN_KINDS = "biufc"


class Note(msgspec.Struct, frozen=True, tag_field=MARK, tag=SHARED):
    """Stands in a page for an array that is in a slot."""

    slot: int
    offset_bytes: int
    size_bytes: int
    dtype: str
    shape: list[int]


def make_shared_file() -> int:
    """Returns a descriptor of an empty file without a name, in memory where the system can."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("snr_arrays")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


class ArraySender:
    """Puts arrays into slots.

    Args:
        file: from `make_shared_file`; only one sender writes it.
    """

    def __init__(self, file: int) -> None:
        self._file = file
        self._slots: list[_Slot] = []
        self._free: set[int] = set()
        self._changing = threading.Condition()
        self._end_bytes = 0

    def share(self, value: Any) -> Any:
        """Returns the value with a note in place of each large array in it."""
        numpy = sys.modules.get("numpy")
        # Not there yet, or just being imported by another thread: then the value holds no array.
        return self._shared(value, numpy) if hasattr(numpy, "ndarray") else value

    def take_back(self, slots: Iterable[int]) -> None:
        """Makes slots free again whose arrays have been copied out."""
        with self._changing:
            self._free.update(slots)
            self._changing.notify_all()

    def _shared(self, value: Any, numpy: Any) -> Any:
        kind = type(value)
        if kind is numpy.ndarray:
            is_large = value.nbytes >= SHARED_FROM_BYTES and value.dtype.kind in _PLAIN_KINDS
            return self._put(value, numpy) if is_large else value
        if kind is Page:
            data = self._shared(value.data, numpy)
            return value if data is value.data else msgspec.structs.replace(value, data=data)
        if kind is dict:
            return {key: self._shared(item, numpy) for key, item in value.items()}
        if kind in (list, tuple):
            return kind([self._shared(item, numpy) for item in value])
        return value

    def _put(self, array: Any, numpy: Any) -> Any:
        number = self._slot_for(array.nbytes)
        if number is None:
            return array
        slot = self._slots[number]
        numpy.frombuffer(slot.memory, array.dtype, array.size).reshape(array.shape)[...] = array
        return Note(number, slot.offset_bytes, slot.size_bytes, array.dtype.str, list(array.shape))

    def _slot_for(self, size_bytes: int) -> int | None:
        with self._changing:
            if len(self._slots) == SLOTS:
                self._changing.wait_for(lambda: self._free, WAIT_FOR_SLOT_S)
            fitting = [number for number in self._free if self._slots[number].size_bytes >= size_bytes]
            if fitting:
                number = min(fitting, key=lambda fit: self._slots[fit].size_bytes)
            elif len(self._slots) < SLOTS:
                number = len(self._slots)
                self._slots.append(self._new_slot(size_bytes))
            elif self._free:
                number = next(iter(self._free))
                self._slots[number].memory.close()
                self._slots[number] = self._new_slot(size_bytes)
            else:
                return None
            self._free.discard(number)
            return number

    def _new_slot(self, size_bytes: int) -> _Slot:
        # Powers of two: arrays that keep growing then leave behind at most as much as they use.
        size_bytes = max(1 << (size_bytes - 1).bit_length(), mmap.ALLOCATIONGRANULARITY)
        offset_bytes = self._end_bytes
        self._end_bytes += size_bytes
        os.ftruncate(self._file, self._end_bytes)
        return _Slot(self._file, offset_bytes, size_bytes)

    def close(self) -> None:
        """Lets go of the memory."""
        for slot in self._slots:
            slot.memory.close()
        os.close(self._file)


class ArrayReceiver:
    """Copies arrays out of slots.

    Args:
        file: that the sender writes.
    """

    def __init__(self, file: int) -> None:
        self._file = file
        self._slots: dict[int, _Slot] = {}
        self.emptied: list[int] = []  # slots to be given back

    def copy(self, slot: int, offset_bytes: int, size_bytes: int, dtype: str, shape: list[int]) -> Any:
        """Returns the array that a note stands for."""
        import numpy as np  # slow to import, and only pages with arrays need it

        known = self._slots.get(slot)
        if known is None or known.offset_bytes != offset_bytes:
            if known is not None:
                known.memory.close()
            known = self._slots[slot] = _Slot(self._file, offset_bytes, size_bytes)
        kind = np.dtype(dtype)
        count = 1
        for length in shape:
            count *= length
        array = np.frombuffer(known.memory, kind, count).reshape(shape).copy()
        self.emptied.append(slot)
        return array

    def close(self) -> None:
        """Lets go of the memory."""
        for slot in self._slots.values():
            slot.memory.close()
        os.close(self._file)


class _Slot:
    """A part of the shared file."""

    def __init__(self, file: int, offset_bytes: int, size_bytes: int) -> None:
        self.offset_bytes = offset_bytes
        self.size_bytes = size_bytes
        self.memory = mmap.mmap(file, size_bytes, offset=offset_bytes)
