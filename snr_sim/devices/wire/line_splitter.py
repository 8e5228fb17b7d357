"""Splits received bytes into lines, for formats with one message a line."""

from __future__ import annotations


class LineSplitter:
    """Never raises, never grows.

    Args:
        max_bytes: of a line.
    """

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._rest = b""
        self._is_skipping = False  # inside a line that is too long

    def feed(self, data: bytes) -> list[bytes | None]:
        """Add received bytes; return the complete lines without white space around them, None for one that is too long.

        >>> LineSplitter(max_bytes=8).feed(b"one\\r\\n123456789\\ntw")
        [b'one', None]
        """
        lines: list[bytes | None] = []
        *ends, rest = data.split(b"\n")
        for end in ends:
            whole, self._rest = self._rest + end, b""
            is_too_long = self._is_skipping or len(whole) > self._max_bytes
            lines.append(None if is_too_long else whole.strip())
            self._is_skipping = False
        self._rest += rest
        if len(self._rest) > self._max_bytes:
            self._rest, self._is_skipping = b"", True
        return lines
