"""Search for frames in a stream of bytes, for formats whose frames state their length.

    .. 02 40 .. | good frame | good frame | good fr      junk that starts like a frame claims the bytes behind it

A reader that believes each claim loses the good frames in it: `03 ff ff` announces 65 535 bytes in a VESC's format.
So a claim beyond the format's largest frame is junk at once; one that turns out wrong is searched again from its second
byte; and one that is still incomplete after a pause on the line is given up, and searched again in the same way.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from typing import ClassVar, Generic, TypeVar

FrameT = TypeVar("FrameT")


class FrameSearch(ABC, Generic[FrameT]):
    """Decoder from bytes to frames, for chunks of any size with other bytes among them. Never raises, never grows.

    Args:
        gap_s: a frame whose bytes have paused for longer has ended. The sender sends a frame without such pauses.

    Attributes:
        frames: good frames.
        damaged: runs of bytes that start like a frame, and are not one by check sum or content.
        skipped: bytes outside of good frames.
    """

    _START: ClassVar[re.Pattern[bytes]]  # what a frame starts with

    def __init__(self, gap_s: float) -> None:
        self.frames: int = 0
        self.damaged: int = 0
        self.skipped: int = 0
        self._gap_s = gap_s
        self._rest = b""  # from the start of what may become a frame
        self._last_s = 0.0  # when the newest byte arrived

    def feed(self, data: bytes, now_s: float) -> list[FrameT]:
        """Add received bytes, which may be none; return the frames that are complete.

        Call it without bytes, too, once the line pauses: a good frame behind junk is then delivered.
        """
        # Only what started before a pause is given up, and only if these bytes do not complete it: a reader that is
        # called less often than every `gap_s` gets frames in two pieces.
        given_up = len(self._rest) if now_s - self._last_s > self._gap_s else 0
        if data:
            self._last_s = now_s
        received = self._rest + data
        found: list[FrameT] = []
        at = in_frames = 0
        while (match := self._START.search(received, at)) is not None:
            start = match.start()
            at = start + 1
            end = start + self._size(received, start)
            if end > len(received) and start >= given_up:
                at = start
                break
            if not start < end <= len(received):
                continue
            frame = self._open(received[start:end])
            if frame is None:
                self.damaged += 1
                continue
            found.append(frame)
            in_frames += end - start
            at = end
        else:
            at = len(received)
        self._rest = received[at:]
        self.frames += len(found)
        self.skipped += at - in_frames
        return found

    @abstractmethod
    def _size(self, received: bytes, start: int) -> int:
        """Return how long the frame at `start` claims to be; 0 if it cannot be one.

        If it is too short to tell, return the size of the shortest frame.
        """

    @abstractmethod
    def _open(self, frame: bytes) -> FrameT | None:
        """Return what a frame of the size it claims carries; None if it is not one."""
