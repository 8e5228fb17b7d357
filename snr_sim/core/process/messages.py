"""Messages between two snr_sim processes: plain values as JSON, followed by the bytes of large arrays.

Large arrays follow their message on the socket and are read directly into the new array: 61 us of CPU time for a
megabyte at the reader (870 by `Connection.recv_bytes_into`) and 52 at the writer; 3.3 GB/s into a node. Shared memory
takes 44 and 51 and has slots to maintain; for 20 kB, 13 and 18 instead of 8 and 6. With its tracker (3.11, 3.13) a
segment of `multiprocessing.shared_memory` disappears when the other process ends, and warnings are printed; without it
(3.13 only) the segment outlives a kill.
"""

from __future__ import annotations

import os
import select
import socket
import threading
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

import msgspec
import msgspec.structs

from snr_sim.prelude.errors import ValueEncodingError
from snr_sim.prelude.task import KINDS, Page
from snr_sim.prelude.values import TAG, decode_value, encode_value

ARRAY_BYTES = "array_bytes"  # tag of an array whose bytes follow
# Below this size JSON is as fast. Above it, JSON would cost 10 ms per megabyte.
BYTES_FROM = 16 * 1024
_PLAIN_KINDS = "biuf"
_OBJECT = b'{"$":"object"'  # never part of a JSON string, where the quotes would be escaped


class ArrayRef(msgspec.Struct, frozen=True, tag_field=TAG, tag=ARRAY_BYTES):
    """Placeholder of an array whose bytes follow the message."""

    dtype: str
    shape: list[int]


class MessageLine:
    """One end of a connection between two snr_sim processes.

    Any thread may send; one thread receives.

    Args:
        connection: the end; a Unix socket.
        user: the component or role that runs in the process, such as "Loop 'vision'".
        pidfd: descriptor that is readable once the other process has ended, if there is one; needed since a child that
            the other process has forked may keep the far end open.
    """

    def __init__(self, connection: Connection, user: str = "", pidfd: int | None = None) -> None:
        self.user: str = user
        self._connection = connection
        self._pidfd = pidfd
        self._sending = threading.Lock()

    def fileno(self) -> int:
        """Return the descriptor, to wait for."""
        return self._connection.fileno()

    def send(self, kind: str, *values: Any) -> bool:
        """Send plain values; wait while the buffer is full. Return whether the other process was running to get them.

        Raises:
            ValueEncodingError: a value is an object of a class that the other process could not create again.
        """
        arrays: list[Any] = []
        raw = encode_value([kind, *(_without_arrays(value, arrays) for value in values)])
        if _OBJECT in raw:
            what = f"{values[0]} '{values[1]}'" if kind == "task" else f"{kind} '{values[0]}'"
            raise ValueEncodingError(
                f"{self.user} runs in a process of its own, and {what} holds an object that cannot be sent: "
                f"{raw[raw.index(_OBJECT) :][:120].decode(errors='replace')}",
                fix="store numbers, text, lists, dicts and numpy arrays.",
            )
        return self.send_bytes(raw, arrays)

    def send_bytes(self, raw: bytes, arrays: list[Any] | None = None) -> bool:
        """Send a message as it is; see `send`."""
        with self._sending:
            try:
                self._connection.send_bytes(raw)
                for array in arrays or ():
                    left = memoryview(_bytes_of(array))
                    while left:
                        left = left[os.write(self.fileno(), left) :]
            except OSError:
                return False
        return True

    def receive(self) -> list[Any]:
        """Return the next message: its kind, then its values; raise an EOFError or OSError at its end."""
        return self.decode(self.receive_bytes())

    def receive_bytes(self) -> bytes:
        """Return the next message as it was sent; see `receive`."""
        return self._connection.recv_bytes()

    def decode(self, raw: bytes) -> list[Any]:
        """Decode a message from `receive_bytes`, and read the arrays that follow it."""
        message: list[Any] = decode_value(raw, {**KINDS, ARRAY_BYTES: self._read_array})
        return message

    def _read_array(self, dtype: str, shape: list[int]) -> Any:
        import numpy as np  # slow to import, and only pages with arrays need it

        array = np.empty(shape, np.dtype(dtype))
        left = memoryview(_bytes_of(array))
        ends = select.poll()
        for end in (self.fileno(), self._pidfd):
            if end is not None:
                ends.register(end, select.POLLIN)
        while left:
            if self.fileno() not in dict(ends.poll()):
                raise EOFError
            # Directly into the array: `Connection.recv_bytes` takes 15 times as long for a megabyte.
            try:
                count = os.readv(self.fileno(), [left])
            except OSError:
                count = 0
            if not count:
                raise EOFError
            left = left[count:]
        return array

    def close(self) -> None:
        """Close this end; a concurrent `send` fails, and cannot write to a new file with the same descriptor number."""
        with socket.socket(fileno=os.dup(self.fileno())) as end, suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)
        with self._sending:
            self._connection.close()


def _without_arrays(value: Any, arrays: list[Any]) -> Any:
    """Return the value with a reference in place of each large array, and append the arrays in the same order."""
    kind = type(value)
    if (
        kind.__module__ == "numpy"
        and kind.__name__ == "ndarray"
        and value.nbytes >= BYTES_FROM
        and value.dtype.kind in _PLAIN_KINDS
    ):
        arrays.append(value)
        return ArrayRef(value.dtype.str, list(value.shape))
    if kind is Page:
        data = _without_arrays(value.data, arrays)
        return value if data is value.data else msgspec.structs.replace(value, data=data)
    if kind is dict:
        return {key: _without_arrays(item, arrays) for key, item in value.items()}
    if kind in (list, tuple):
        return kind([_without_arrays(item, arrays) for item in value])
    return value


def _bytes_of(array: Any) -> Any:
    """Return an array's bytes; without a copy if it is contiguous in memory."""
    return array.reshape(-1).view("u1")
