"""Dates its commands into the past, into the future, and at no time at all."""

from falling import falling

from snr_sim import Page, Task, TaskType

TIMES_S = (-1e308, float("-inf"), 1e9, float("inf"), float("nan"))


def act(pilot):
    page = Page("engine", {"throttle": 1.0}, pilot.parent.name, TIMES_S[pilot.times % 5])
    return Task(TaskType.store_page, page.key, [page])


def factories(robot):
    return falling(act)
