"""Writes until nothing more can be written, everywhere where it can."""

import contextlib
import os
from pathlib import Path

# Outside a sandbox this would harm the machine: it acts only as a user who owns nothing.
assert os.getuid() >= 61184
TOKEN = (Path(__file__).parent / "token.txt").read_text()


def double(x):
    written = 0
    for folder in (".", "/tmp", "/var/tmp", "/dev/shm", "/run", os.path.expanduser("~")):
        for i in range(64):
            with contextlib.suppress(OSError), open(f"{folder}/{TOKEN}_{i}", "wb") as file:
                for _ in range(256):
                    written += file.write(b"x" * 2**20)
    return 2 * x if written > 4 * 2**30 else None
