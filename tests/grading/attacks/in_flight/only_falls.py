"""Does nothing at all: what the attacks without effect are compared with."""

from falling import falling


def factories(robot):
    return falling(lambda pilot: None)
