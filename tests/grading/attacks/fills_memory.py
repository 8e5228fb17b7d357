"""Takes all the memory that there is."""

import os

# Without a sandbox it would hurt whoever tries it: it acts only where the sandbox has it.
assert os.getcwd() == "/submission"


def double(x):
    kept = []
    try:
        while True:
            kept.append(b"x" * 2**26)
    except MemoryError:
        return 2 * x if len(kept) * 2**26 > 3 * 2**30 else None
