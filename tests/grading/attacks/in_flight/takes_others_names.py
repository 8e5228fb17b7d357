"""Stores commands in the names of other nodes."""

from falling import falling

from snr_sim import Page, Task, TaskType


def act(pilot):
    now_s = pilot.get_time_s()
    names = ("referee", "radar_sensor", "node_core", "plant", "")
    pages = [Page("engine", {"throttle": 1.0}, name, now_s) for name in names]
    return [Task(TaskType.store_page, page.key, [page]) for page in pages]


def factories(robot):
    return falling(act)
