"""The code of the failed landing, with all your repairs."""

from repairs import factories_with

OPTIONS = {"repairs": "which repairs to make: 1,2,3"}


def factories(robot):
    text = robot.options.get("repairs", "1,2,3")
    return factories_with(robot, [number for number in (1, 2, 3) if str(number) in text.split(",")])
