"""Leaves detached processes behind, which would answer for later cases."""

import os
import sys
import time

# Outside a sandbox this would harm the machine: it acts only as a user who owns nothing.
assert os.getuid() >= 61184


def double(x):
    for _ in range(3):
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                for number in range(3):
                    os.close(number)
                while True:
                    time.sleep(1)
                    with_answer = b'{"n":1,"value":2}\n'
                    for descriptor in range(3, 64):
                        try:
                            os.write(descriptor, with_answer)
                        except OSError:
                            sys.exc_info()
            os._exit(0)
