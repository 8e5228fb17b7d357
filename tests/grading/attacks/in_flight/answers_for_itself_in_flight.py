"""Answers the questions of the moments to come, ahead of being asked."""

import contextlib
import os

from falling import falling


def act(pilot):
    for n in range(1, 200):
        for descriptor in range(3, 256):
            with contextlib.suppress(OSError):
                os.set_blocking(descriptor, False)
                os.write(descriptor, b'{"n":%d,"value":{"returned":{}}}\n' % n)


def factories(robot):
    return falling(act)
