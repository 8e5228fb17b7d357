"""Queues of frames that wait: to be sent to one peer, or to be read from several. Bounded, and they never block."""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable, Sized
from typing import Generic, Literal, TypeAlias, TypeVar

Policy: TypeAlias = Literal["drop_oldest", "refuse"]
Frame = TypeVar("Frame", bound=Sized)  # bytes, or an object whose length is their number

MAX_WAITING_BYTES = 1 << 26  # 64 MiB: of all frames that wait, whatever their number
SHARE_BYTES = 8 * 1024  # of a peer in a round, as in streams.py


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
        self.frames: deque[Frame] = deque()  # that wait; for others to look at, which takes less time than a call

    def __len__(self) -> int:
        return len(self.frames)

    def put(self, frame: Frame) -> None:
        """Add a frame; a full queue drops it, or the oldest ones.

        >>> queue = SendQueue(max_pages=2)
        >>> for frame in (b"a", b"b", b"c"):
        ...     queue.put(frame)
        >>> queue.take(), queue.dropped
        ([b'b', b'c'], 1)
        """
        while self.frames and not self._has_room_for(frame):
            if self.policy == "refuse":
                self._drop(frame)
                return
            oldest = self.frames.popleft()
            self.waiting_bytes -= len(oldest)
            self._drop(oldest)
        self.frames.append(frame)
        self.waiting_bytes += len(frame)

    def take(self, max_bytes: int | None = None) -> list[Frame]:
        """Remove and return the oldest frames: at least one if any waits, and about `max_bytes` at most."""
        frames: list[Frame] = []
        taken_bytes = 0
        while self.frames and (max_bytes is None or taken_bytes < max_bytes):
            frames.append(self.frames.popleft())
            taken_bytes += len(frames[-1])
        self.waiting_bytes -= taken_bytes
        return frames

    def _drop(self, frame: Frame) -> None:
        self.dropped += 1

    def _has_room_for(self, frame: Frame) -> bool:
        return len(self.frames) < self.max_pages and self.waiting_bytes + len(frame) <= self._max_bytes


class FairQueue(Generic[Frame]):
    """First in, first out for each peer; peers are read in rounds of equal shares. Arguments are those of SendQueue.

    A full queue drops and counts pages of the peer of which most wait, by frames or by bytes, whichever are too many:
    so no peer can use up the others' places.
    """

    def __init__(
        self, max_pages: int = 10_000, policy: Policy = "drop_oldest", max_bytes: int = MAX_WAITING_BYTES
    ) -> None:
        self.dropped: int = 0
        self._max_pages, self._max_bytes, self._policy = max_pages, max_bytes, policy
        self._frames: dict[Hashable, deque[Frame]] = {}  # of peers of which some wait, the next to be read first
        self._bytes: dict[Hashable, int] = {}
        self._count = self._total_bytes = 0

    def __len__(self) -> int:
        return self._count

    def put(self, peer: Hashable, frame: Frame) -> None:
        """Add a frame of a peer."""
        self._frames.setdefault(peer, deque()).append(frame)
        self._bytes[peer] = self._bytes.get(peer, 0) + len(frame)
        self._total_bytes += len(frame)
        self._count += 1
        # Rarely more than one turn: each frame that arrives displaces as much as it brings.
        while self._count > 1 and (self._count > self._max_pages or self._total_bytes > self._max_bytes):
            self._remove(self._fullest(), is_newest=self._policy == "refuse")
            self.dropped += 1

    def _fullest(self) -> Hashable:
        """Return the peer that has the most of what is too much."""
        if self._count > self._max_pages:
            return max(self._frames, key=lambda one: (len(self._frames[one]), self._bytes[one]))
        return max(self._frames, key=lambda one: (self._bytes[one], len(self._frames[one])))

    def take(self, max_bytes: int) -> list[Frame]:
        """Remove and return frames: at least one if any waits, and about `max_bytes` at most.

        >>> queue = FairQueue()
        >>> for peer, frame in (("a", b"1"), ("a", b"2" * SHARE_BYTES), ("a", b"3"), ("b", b"4")):
        ...     queue.put(peer, frame)
        >>> [frame[:1] for frame in queue.take(10 * SHARE_BYTES)]
        [b'1', b'2', b'4', b'3']
        """
        frames: list[Frame] = []
        left_bytes = max_bytes
        while self._count and (left_bytes > 0 or not frames):
            peer, share_bytes = next(iter(self._frames)), SHARE_BYTES
            while peer in self._frames and share_bytes > 0:
                frames.append(self._remove(peer))
                share_bytes -= len(frames[-1])
            left_bytes -= SHARE_BYTES - share_bytes
            if peer in self._frames:
                self._frames[peer] = self._frames.pop(peer)  # behind all others
        return frames

    def _remove(self, peer: Hashable, *, is_newest: bool = False) -> Frame:
        waiting = self._frames[peer]
        frame = waiting.pop() if is_newest else waiting.popleft()
        self._bytes[peer] -= len(frame)
        self._total_bytes -= len(frame)
        self._count -= 1
        if not waiting:
            del self._frames[peer], self._bytes[peer]
        return frame
