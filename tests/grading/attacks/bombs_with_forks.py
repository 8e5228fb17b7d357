"""Makes as many processes as it can, each of which makes as many as it can."""

import os
import time

# Without a sandbox it would hurt whoever tries it: it acts only where the sandbox has it.
assert os.getcwd() == "/submission"


def double(x):
    made = 0
    while True:
        try:
            made += os.fork() > 0
        except OSError:
            time.sleep(0.01)
