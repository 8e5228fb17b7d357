"""The newest page of each key, and the one before."""

from typing import Any

import pytest

from snr_sim import Page
from snr_sim.core.datastore import Datastore
from snr_sim.prelude.errors import TaskError


def store_of(*data: Any) -> Datastore:
    store = Datastore()
    for value in data:
        store.put(Page("x", value, "n", 0.0))
    return store


def data_of(store: Datastore, key: str) -> Any:
    page = store.get(key)
    return page.data if page is not None else None


def test_the_newest_page_and_the_one_before_are_kept() -> None:
    store = store_of(1, 2, 3)
    assert (data_of(store, "x"), data_of(store, "x_prev")) == (3, 2)


def test_there_is_no_page_before_the_first() -> None:
    store = store_of(1)
    assert store.get("x_prev") is None
    assert store.missed == {}  # a request for it is not an error


def test_a_page_that_is_really_called_prev_wins() -> None:
    store = store_of(1, 2)
    store.put(Page("x_prev", "mine", "n", 0.0))
    assert data_of(store, "x_prev") == "mine"


def test_missed_keys_are_kept() -> None:
    store = store_of(1)
    assert store.get("y") is None
    assert list(store.missed) == ["y"]


def test_missed_previous_key_is_kept() -> None:
    store = store_of(1)
    assert store.get("y_prev") is None
    assert list(store.missed) == ["y"]


@pytest.mark.parametrize("page", [None, 5, Page(5, 1, "n", 0.0), Page(["x"], 1, "n", 0.0)])  # type: ignore[arg-type]
def test_non_page_raises_task_error(page: Any) -> None:
    with pytest.raises(TaskError, match="page"):
        store_of(1).put(page)
