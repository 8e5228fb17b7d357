"""Returns as many tasks for each reading as one moment allows: the whole flight would take the grader hours."""

from falling import falling

from snr_sim import tasks


def factories(robot):
    return falling(lambda pilot: [tasks.event("more") for _ in range(9_000)])
