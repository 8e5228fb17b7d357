"""The code of the failed landing, with your repair 3 and no other."""

from repairs import factories_with


def factories(robot):
    return factories_with(robot, [3])
