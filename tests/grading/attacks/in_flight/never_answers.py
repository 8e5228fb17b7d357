"""Waits in flight for what does not come, and says a word now and then, so that it is not silent."""

import os
import select

from falling import falling


def act(pilot):
    while pilot.times > 5:
        select.select([], [], [], 0.1)
        os.write(1, b".")


def factories(robot):
    return falling(act)
