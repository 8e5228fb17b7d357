"""Returns more tasks for one reading than a node can handle."""

from falling import falling

from snr_sim import tasks


def factories(robot):
    return falling(lambda pilot: [tasks.event("more", [i]) for i in range(20_000)])
