"""Limits on what a graded component sends: tasks, notes, keys, and the length of each."""

import msgspec
import pytest

from snr_sim.core.clocks import SimClock
from snr_sim.core.config import Config, Mode
from snr_sim.core.node import Node
from snr_sim.grading.remote.admission import (
    MAX_KEYS,
    MAX_NOTES,
    MAX_TASKS_AT_ONE_MOMENT,
    MAX_TASKS_PER_RUN,
    Admission,
    NotAdmitted,
)
from snr_sim.grading.remote.protocol import Made
from snr_sim.prelude import tasks


def test_a_steady_flood_of_tasks_ends_as_one_at_a_single_moment_does() -> None:
    admission = Admission("mine.py")
    for moment in range(MAX_TASKS_PER_RUN // MAX_TASKS_AT_ONE_MOMENT):
        admission.count(float(moment), MAX_TASKS_AT_ONE_MOMENT)
    with pytest.raises(NotAdmitted, match="in one run"):
        admission.count(1e6)
    with pytest.raises(NotAdmitted, match="at one moment"):
        Admission("mine.py").count(0.0, MAX_TASKS_AT_ONE_MOMENT + 1)


def test_notes_and_keys_asked_for_in_vain_are_kept_as_far_as_a_run_can_tell_them() -> None:
    admission = Admission("mine.py")
    noted = [note for i in range(30) for note in admission.notes([f"{i} {j} {'n' * 5000}" for j in range(9)])]
    assert len(noted) == MAX_NOTES
    assert max(map(len, noted)) == 1_000
    missed = [key for i in range(30) for key in admission.missed([f"{i} {j}" for j in range(99)])]
    assert len(missed) == len(set(missed)) == MAX_KEYS
    assert Admission("mine.py").missed(["depth", "depth", "x" * 201]) == ["depth", "depth"]


def test_a_component_has_a_name_that_can_be_read_and_no_more_handlers_than_keys() -> None:
    admission = Admission("mine.py")
    admission.component(Made("pilot", [("event", None, "f")] * MAX_KEYS, []))
    for made in (Made("x" * 201, [], []), Made("pilot", [("event", None, "f")] * (MAX_KEYS + 1), [])):
        with pytest.raises(NotAdmitted, match="handlers"):
            admission.component(made)


def test_what_honest_components_bring_is_let_in_as_it_is() -> None:
    node = Node("urov", Config(Mode.TEST, {"urov": []}), clock=SimClock())
    brought = [tasks.event("surfaced"), tasks.finish("done")]
    raws = [msgspec.Raw(task.serialize()) for task in brought]
    assert Admission("mine.py").tasks(raws, node, "mission") == brought
