"""Takes heading's place, for passengers who are easily seasick: the same pages, and never more than 1 N m."""

from heading import Heading


def factories(robot):
    # Step 4: so far it is heading.py itself.
    return [Heading.factory()]
