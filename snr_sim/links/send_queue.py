"""SendQueue: frames that wait to be sent to one peer. Bounded, so that a peer that does not read costs no memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Sized
from typing import Generic, Literal, TypeAlias, TypeVar, get_args

from snr_sim.prelude.errors import ParameterError

Policy: TypeAlias = Literal["drop_oldest", "refuse"]
Frame = TypeVar("Frame", bound=Sized)  # bytes, or an object whose length is their number

MAX_WAITING_BYTES = 1 << 26  # 64 MiB: of all frames that wait, whatever their number


class SendQueue(Generic[Frame]):
    """First in, first out; a full queue drops and counts a page, and never blocks.

    Args:
        max_pages: maximum number of frames that wait.
        policy: which page a full queue drops: "drop_oldest", or "refuse" the newest.
        max_bytes: limit of all frames together; a longer frame may wait alone.

    Raises:
        ParameterError: `max_pages` is less than 1, or the policy is unknown.
    """

    def __init__(
        self, max_pages: int = 10_000, policy: Policy = "drop_oldest", max_bytes: int = MAX_WAITING_BYTES
    ) -> None:
        if max_pages < 1 or max_bytes < 1:
            raise ParameterError(
                f"A send queue cannot hold {max_pages} pages and {max_bytes} bytes.", fix="use at least 1 of each."
            )
        if policy not in get_args(Policy):
            raise ParameterError(
                f"policy={policy!r} is not valid for a send queue.", fix=f"use one of {', '.join(get_args(Policy))}."
            )
        self.max_pages = max_pages
        self.max_bytes = max_bytes
        self.policy = policy
        self.dropped = 0
        self.waiting_bytes = 0
        self._frames: deque[Frame] = deque()

    def __len__(self) -> int:
        return len(self._frames)

    def put(self, frame: Frame) -> bool:
        """Add a frame; return whether it now waits. Frames dropped for it are counted in `dropped`.

        >>> queue = SendQueue(max_pages=2)
        >>> [queue.put(frame) for frame in (b"a", b"b", b"c")], queue.take(), queue.dropped
        ([True, True, True], [b'b', b'c'], 1)
        """
        while self._frames and not self._has_room_for(frame):
            if self.policy == "refuse":
                self._drop(frame)
                return False
            oldest = self._frames.popleft()
            self.waiting_bytes -= len(oldest)
            self._drop(oldest)
        self._frames.append(frame)
        self.waiting_bytes += len(frame)
        return True

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
        return len(self._frames) < self.max_pages and self.waiting_bytes + len(frame) <= self.max_bytes
