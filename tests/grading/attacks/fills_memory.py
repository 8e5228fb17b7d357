"""Takes all the memory that there is."""

import os

# Outside a sandbox this would harm the machine: it acts only as a user who owns nothing.
assert os.getuid() >= 61184


def double(x):
    kept = []
    try:
        while True:
            kept.append(b"x" * 2**26)
    except MemoryError:
        return 2 * x if len(kept) * 2**26 > 3 * 2**30 else None
