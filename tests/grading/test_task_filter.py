"""Limits on what a graded component sends: tasks, notes, keys, and the length of each."""

import msgspec
import pytest

from snr_sim.core.clocks import SimClock
from snr_sim.core.config import Config, Mode
from snr_sim.core.node import Node
from snr_sim.grading.remote.protocol import ComponentInfo
from snr_sim.grading.remote.task_filter import (
    MAX_KEYS,
    MAX_NOTES,
    MAX_TASKS_AT_ONE_MOMENT,
    MAX_TASKS_PER_RUN,
    TaskFilter,
    TaskRejectedError,
)
from snr_sim.prelude import tasks


def test_task_count_limit_per_run_and_per_moment_raises() -> None:
    task_filter = TaskFilter("mine.py")
    for moment in range(MAX_TASKS_PER_RUN // MAX_TASKS_AT_ONE_MOMENT):
        task_filter.count(float(moment), MAX_TASKS_AT_ONE_MOMENT)
    with pytest.raises(TaskRejectedError, match="in one run"):
        task_filter.count(1e6)
    with pytest.raises(TaskRejectedError, match="at one moment"):
        TaskFilter("mine.py").count(0.0, MAX_TASKS_AT_ONE_MOMENT + 1)


def test_notes_and_missed_keys_are_limited_per_run() -> None:
    task_filter = TaskFilter("mine.py")
    noted = [note for i in range(30) for note in task_filter.notes([f"{i} {j} {'n' * 5000}" for j in range(9)])]
    assert len(noted) == MAX_NOTES
    assert max(map(len, noted)) == 1_000
    missed = [key for i in range(30) for key in task_filter.missed([f"{i} {j}" for j in range(99)])]
    assert len(missed) == len(set(missed)) == MAX_KEYS
    assert TaskFilter("mine.py").missed(["depth", "depth", "x" * 201]) == ["depth", "depth"]


def test_long_component_name_or_too_many_handlers_is_rejected() -> None:
    task_filter = TaskFilter("mine.py")
    task_filter.component(ComponentInfo("pilot", [("event", None, "f")] * MAX_KEYS, []))
    for made in (
        ComponentInfo("x" * 201, [], []),
        ComponentInfo("pilot", [("event", None, "f")] * (MAX_KEYS + 1), []),
        ComponentInfo("pilot", [], [], optional_events=["e"] * (MAX_KEYS + 1)),
        ComponentInfo("pilot", [], [], repeats="e" * 201 + ".step"),
    ):
        with pytest.raises(TaskRejectedError, match="handlers"):
            task_filter.component(made)


def test_clock_may_send_steps_of_a_machine_only() -> None:
    task_filter = TaskFilter("mine.py")
    task_filter.component(ComponentInfo("clock", [], [], repeats="dora.step"))
    with pytest.raises(TaskRejectedError, match="not a machine's step"):
        task_filter.component(ComponentInfo("clock", [], [], repeats="add_component"))


def test_permitted_tasks_are_returned_unchanged() -> None:
    node = Node("urov", Config(Mode.TEST, {"urov": []}), clock=SimClock())
    brought = [tasks.event("surfaced"), tasks.finish("done")]
    raws = [msgspec.Raw(task.serialize()) for task in brought]
    assert TaskFilter("mine.py").tasks(raws, node, "mission") == brought
