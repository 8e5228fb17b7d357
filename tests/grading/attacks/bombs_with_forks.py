"""Makes as many processes as it can, each of which makes as many as it can."""

import os
import time

# Outside a sandbox this would harm the machine: it acts only as a user who owns nothing.
assert os.getuid() >= 61184


def double(x):
    made = 0
    while True:
        try:
            made += os.fork() > 0
        except OSError:
            time.sleep(0.01)
