"""JSON objects of small devices on a serial line as bytes, and back, in two framings.

    0b {"lamp":70}       `JsonFrames`: a byte with the length, then the object
    {"lamp":70} 0a       `JsonLines`: an object in each line, for new devices: other bytes cost one line at most

Neither has a check sum: a damaged number that is still a number is not noticed. So they drive nothing that moves.
"""

from __future__ import annotations

import math
import re
from typing import Any, ClassVar

import msgspec

from snr_sim.devices.wire.frame_search import FrameSearch
from snr_sim.devices.wire.line_splitter import LineSplitter
from snr_sim.prelude.errors import CommandError
from snr_sim.prelude.values import JSON_ERRORS, MAX_INT, MIN_INT

MAX_FRAME_BYTES = 255  # of an object after a byte with its length
MAX_LINE_BYTES = 4096
MAX_DEPTH = 8  # of objects and lists in each other


def encode_frame(value: dict[str, Any]) -> bytes:
    """Return an object with its length; raise a CommandError if it is not plain, or longer than 255 bytes.

    >>> encode_frame({"lamp": 70})
    b'\\x0b{"lamp":70}'
    """
    raw = _encode(value, MAX_FRAME_BYTES)
    return bytes([len(raw)]) + raw


def encode_line(value: dict[str, Any]) -> bytes:
    """Return an object as a line; raise a CommandError if it is not plain, or longer than 4096 bytes."""
    return _encode(value, MAX_LINE_BYTES) + b"\n"


class JsonFrames(FrameSearch[dict[str, Any]]):
    """Decoder from bytes to objects with their length; see `FrameSearch`."""

    _START: ClassVar[re.Pattern[bytes]] = re.compile(rb"[\x02-\xff](?=\{|\Z)")

    def __init__(self, gap_s: float = 0.05) -> None:
        super().__init__(gap_s)

    def _size(self, received: bytes, start: int) -> int:
        return 1 + received[start]

    def _open(self, frame: bytes) -> dict[str, Any] | None:
        return _decode(frame[1:])


class JsonLines:
    """Decoder from bytes to objects in lines. Never raises, never grows.

    Attributes:
        frames: good objects.
        damaged: lines that are not one, or too long.
    """

    def __init__(self) -> None:
        self.frames: int = 0
        self.damaged: int = 0
        self._lines = LineSplitter(MAX_LINE_BYTES)

    def feed(self, data: bytes) -> list[dict[str, Any]]:
        """Add received bytes; return the objects that are complete.

        >>> JsonLines().feed(b'boot ok\\n{"lamp":70}\\r\\n{"lamp":')
        [{'lamp': 70}]
        """
        found: list[dict[str, Any]] = []
        for line in self._lines.feed(data):
            value = _decode(line) if line else None
            if value is not None:
                found.append(value)
            elif line != b"":
                self.damaged += 1
        self.frames += len(found)
        return found


def _encode(value: dict[str, Any], max_bytes: int) -> bytes:
    try:
        raw = msgspec.json.encode(value) if isinstance(value, dict) and _is_plain(value) else b""
    except UnicodeEncodeError:  # half of a pair of surrogates
        raw = b""
    if not 0 < len(raw) <= max_bytes:
        raise CommandError(
            f"This is not an object of at most {max_bytes} bytes for a device: {value!r:.200}.",
            fix=f"send a dict with text as keys, finite numbers, text and lists, at most {MAX_DEPTH} in each other.",
        )
    return raw


def _decode(raw: bytes) -> dict[str, Any] | None:
    try:
        value = msgspec.json.decode(raw)
    except JSON_ERRORS:
        return None
    return value if isinstance(value, dict) and _is_plain(value) else None


def _is_plain(value: Any, depth: int = MAX_DEPTH) -> bool:
    if isinstance(value, dict):
        return depth > 0 and all(isinstance(key, str) and _is_plain(value[key], depth - 1) for key in value)
    if isinstance(value, list):
        return depth > 0 and all(_is_plain(item, depth - 1) for item in value)
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, int):
        return MIN_INT <= value <= MAX_INT
    return value is None or isinstance(value, str)
