"""SendQueue: frames that wait to be sent to one peer. Bounded, so that a peer that does not read costs no memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Sized
from typing import Generic, Literal, TypeAlias, TypeVar

Policy: TypeAlias = Literal["drop_oldest", "refuse"]
Frame = TypeVar("Frame", bound=Sized)  # bytes, or an object whose length is their number

MAX_WAITING_BYTES = 1 << 26  # 64 MiB: of all frames that wait, whatever their number


class SendQueue(Generic[Frame]):
    """First in, first out; a full queue drops and counts a page, and never blocks.

    Args:
        max_pages: maximum number of frames that wait.
        policy: which page a full queue drops: "drop_oldest", or "refuse" the newest.
        max_bytes: limit of all frames together; a longer frame may wait alone.
    """

    def __init__(
        self, max_pages: int = 10_000, policy: Policy = "drop_oldest", max_bytes: int = MAX_WAITING_BYTES
    ) -> None:
        self.max_pages: int = max_pages  # LinkOptions has checked it, and the policy
        self.policy: Policy = policy
        self.dropped: int = 0
        self.waiting_bytes: int = 0
        self._max_bytes = max_bytes
        self._frames: deque[Frame] = deque()

    def __len__(self) -> int:
        return len(self._frames)

    def put(self, frame: Frame) -> None:
        """Add a frame; a full queue drops it, or the oldest ones.

        >>> queue = SendQueue(max_pages=2)
        >>> for frame in (b"a", b"b", b"c"):
        ...     queue.put(frame)
        >>> queue.take(), queue.dropped
        ([b'b', b'c'], 1)
        """
        while self._frames and not self._has_room_for(frame):
            if self.policy == "refuse":
                self._drop(frame)
                return
            oldest = self._frames.popleft()
            self.waiting_bytes -= len(oldest)
            self._drop(oldest)
        self._frames.append(frame)
        self.waiting_bytes += len(frame)

    def take(self, max_bytes: int | None = None) -> list[Frame]:
        """Remove and return the oldest frames: at least one if any waits, and about `max_bytes` at most."""
        frames: list[Frame] = []
        taken_bytes = 0
        while self._frames and (max_bytes is None or taken_bytes < max_bytes):
            frames.append(self._frames.popleft())
            taken_bytes += len(frames[-1])
        self.waiting_bytes -= taken_bytes
        return frames

    def _drop(self, frame: Frame) -> None:
        self.dropped += 1

    def _has_room_for(self, frame: Frame) -> bool:
        return len(self._frames) < self.max_pages and self.waiting_bytes + len(frame) <= self._max_bytes
