"""Tasks and pages: equality, and the round trip through JSON."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import Page, Task, TaskType, tasks
from snr_sim.prelude.errors import TaskError, ValueEncodingError

plain = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(allow_nan=False), st.text('ab$"\\ é'), st.binary()),
    lambda inner: st.one_of(
        st.lists(inner), st.tuples(inner), st.dictionaries(st.one_of(st.text("ab$"), st.integers()), inner)
    ),
    max_leaves=8,
)


def test_tasks_with_the_same_contents_are_equal_and_have_one_hash() -> None:
    one, other = tasks.event("a", [1]), Task(TaskType.event, "a", [1])
    assert one == other
    assert hash(one) == hash(other)
    assert len({one, other}) == 1
    assert one != tasks.event("a", [2])
    assert one != tasks.process_data("a")


def test_each_task_has_a_list_of_its_own() -> None:
    tasks.event("a").val_list.append(1)
    Task(TaskType.event, "a").val_list.append(1)
    assert tasks.event("b").val_list == []
    assert Task(TaskType.event, "a").val_list == []
    given_list = [1]
    task = tasks.event("a", given_list)
    given_list.append(2)
    assert task.val_list == [1]


@pytest.mark.parametrize("values", ["hello", 5, {"a": 1}, None, b"x", {1}])
def test_event_with_scalar_value_raises_with_fix(values: Any) -> None:
    with pytest.raises(TaskError) as caught:
        tasks.event("say", values)
    assert f"event 'say' carries {values!r}" in str(caught.value)
    assert f"tasks.event('say', [{values!r}])" in str(caught.value)


def test_event_accepts_list_or_tuple() -> None:
    assert tasks.event("say", ("hello", 5)).val_list == tasks.event("say", ["hello", 5]).val_list == ["hello", 5]
    assert tasks.event("say", []).val_list == tasks.event("say", ()).val_list == []


@pytest.mark.parametrize("nothing", [None, 5, [b"x"], {}])
def test_deserialize_rejects_other_types_than_text_and_bytes(nothing: Any) -> None:
    with pytest.raises(TaskError, match="are not a task"):
        Task.deserialize(nothing)
    with pytest.raises(ValueEncodingError, match=f"of type {type(nothing).__name__}"):
        Page.deserialize(nothing)


@pytest.mark.parametrize("field", ["type", "name", "val_list"])
def test_a_task_cannot_be_changed_after_it_was_made(field: str) -> None:
    with pytest.raises(AttributeError):
        setattr(tasks.event("a"), field, "b")


def test_the_id_of_a_task_is_what_handlers_register_for() -> None:
    assert tasks.event("a").id() == (TaskType.event, "a")
    assert {(TaskType.event, "a"): 1}[tasks.event("a").id()] == 1


def test_the_helpers_make_the_tasks_they_are_named_after() -> None:
    page = Page("x", 1, "n", 0.0)
    assert tasks.store_page(page) == Task.store_page(page) == Task(TaskType.store_page, "x", [page])
    assert tasks.process_data("x").id() == (TaskType.process_data, "x")
    assert tasks.terminate("done").id() == (TaskType.terminate, "done")
    assert tasks.reload_component("x").id() == (TaskType.reload, "x")


@given(st.sampled_from(list(TaskType)), st.text('ab$" é'), st.lists(plain, max_size=3))
def test_task_round_trips_through_json(kind: TaskType, name: str, val_list: list[Any]) -> None:
    task = Task(kind, name, val_list)
    assert Task.deserialize(task.serialize()) == task


@given(st.text('ab$" é'), plain, st.floats(0, 1e6), st.booleans())
def test_page_round_trips_through_json(key: str, data: Any, created_at_s: float, process: bool) -> None:
    page = Page(key, data, "some_node", created_at_s, process)
    raw = page.serialize()
    assert Page.deserialize(raw) == page
    assert Page.deserialize(raw.decode()) == page
    assert type(Page.deserialize(raw).data) is type(data)
    assert b"\n" not in raw
    stored = Task.store_page(page)
    assert Task.deserialize(stored.serialize()) == stored


def test_page_of_arrays_round_trips_through_json() -> None:
    page = Page("imu", {"rates": np.array([0.1, np.nan]), "ok": (True, None)}, "n", 0.5)
    back = Page.deserialize(page.serialize())
    np.testing.assert_array_equal(back.data["rates"], page.data["rates"])
    assert back.data["ok"] == (True, None)


@pytest.mark.parametrize(
    "raw",
    [
        b"",
        b"{}",
        b'["evnt","a",[]]',
        b'["event","a"]',
        b'["event",5,[]]',
        b'["event","a",5]',
        b'{"$":"x"}',
        b"\xff",
        b"5",
    ],
)
def test_invalid_task_bytes_are_rejected(raw: bytes) -> None:
    with pytest.raises(TaskError, match="are not a task"):
        Task.deserialize(raw)


@pytest.mark.parametrize(
    "raw",
    [
        b"",
        b"5",
        b"{}",
        b'{"$":"page"}',
        b'{"$":"page","key":5,"data":1,"origin":"n","created_at_s":0.0,"process":true}',
        b'{"$":"page","key":"a","data":1,"origin":"n","created_at_s":"now","process":true}',
        b'{"$":"page","key":"a","data":1,"origin":7,"created_at_s":0.0,"process":true}',
        b'{"$":"page","key":"a","data":1,"origin":"n","created_at_s":0.0,"process":"yes"}',
    ],
)
def test_invalid_page_bytes_are_rejected(raw: bytes) -> None:
    with pytest.raises(ValueEncodingError):
        Page.deserialize(raw)
