"""How much slower this computer is than the one that limits of CPU time in tests are given for."""

import functools
import json
import time

JSON_S = 0.1  # CPU time of 100 000 calls of json.loads on an AMD EPYC, by its ratio to a computer that was measured


@functools.cache
def slowness() -> float:
    """Return the factor by which this computer is slower than the EPYC; 1 for one that is as fast, or faster."""
    used = []
    for _ in range(3):
        begun_s = time.thread_time()
        for _ in range(100_000):
            json.loads(b"0")
        used.append(time.thread_time() - begun_s)
    return max(1.0, min(used) / JSON_S)
