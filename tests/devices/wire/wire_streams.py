"""What the tests of wire formats share: streams of good frames with junk between them, and readers fed in chunks."""

import random
from collections.abc import Callable, Sequence
from typing import Any

BYTES_PER_S = 11_520.0  # of 115 200 baud


def crc_by_bits(data: bytes) -> int:
    """Return the CRC-16/XMODEM, by the polynomial x^16 + x^12 + x^5 + 1 and nothing of a library."""
    crc = 0
    for byte in data:
        for bit in range(7, -1, -1):
            crc = (crc << 1 ^ (0x1021 if (crc >> 15 ^ byte >> bit) & 1 else 0)) & 0xFFFF
    return crc


def junk_between(frames: Sequence[bytes], chance: random.Random, make_junk: Callable[[random.Random], bytes]) -> bytes:
    """Return one stream of all frames, with junk before each of them."""
    return b"".join(make_junk(chance) + frame for frame in frames)


def random_junk(chance: random.Random) -> bytes:
    return chance.randbytes(chance.randint(0, 5))


def read_in_chunks(reader: Any, stream: bytes, chance: random.Random, max_bytes: int = 40) -> list[Any]:
    """Return what a reader of frames finds in a stream at the speed of a line, and in the pause after it."""
    found, at = [], 0
    while at < len(stream):
        end = at + chance.randint(1, max_bytes)
        found += reader.feed(stream[at:end], end / BYTES_PER_S)
        at = end
    return found + reader.feed(b"", len(stream) / BYTES_PER_S + 1.0)


def fuzz(reader: Any, count: int, seed: int) -> list[Any]:
    """Return what a reader of frames finds in this many random bytes, in chunks of up to 200."""
    return read_in_chunks(reader, random.Random(seed).randbytes(count), random.Random(seed), max_bytes=200)
