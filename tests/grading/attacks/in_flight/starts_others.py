"""Starts processes and threads in flight, which would answer in its place."""

import _thread
import contextlib
import os

from falling import falling

# Outside a sandbox this would harm the machine: it acts only as a user who owns nothing.
assert os.getuid() >= 61184


def answer():
    while True:
        for descriptor in range(3, 256):
            with contextlib.suppress(OSError):
                os.write(descriptor, b'{"n":9,"value":{"returned":{}}}\n')


def act(pilot):
    with contextlib.suppress(Exception):
        _thread.start_new_thread(answer, ())
    with contextlib.suppress(OSError):
        if os.fork() == 0:
            os.setsid()
            answer()


def factories(robot):
    return falling(act)
