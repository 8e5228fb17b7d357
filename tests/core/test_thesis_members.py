"""The thesis' names on components and nodes: which work, which raise with the new name, and their cost."""

import logging
from pathlib import Path
from typing import Any

import pytest

from snr_sim import (
    Config,
    Endpoint,
    Loop,
    Node,
    Page,
    SimClock,
    TaskType,
    TimeoutLoopFactory,
    tasks,
)
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, RetiredNameError
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

LEVELS = {
    "dbg": logging.DEBUG,
    "info": logging.INFO,
    "warn": logging.WARNING,
    "err": logging.ERROR,
    "fatal": logging.CRITICAL,
}


def run(*factories: Any) -> Node:
    node = Node("test", Config(factories={"test": list(factories)}), clock=SimClock())
    node.loop()
    return node


@pytest.mark.parametrize(("name", "level"), LEVELS.items())
def test_short_ways_to_log_reach_the_log_with_their_level(
    name: str, level: int, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    node = run(
        FunctionEndpointFactory(begin=lambda part: getattr(part, name)("%s of %d", "part", 2)),
        FunctionLoopFactory(lambda loop: getattr(loop, name)("a tick"), rate_hz=1),
        TimeoutLoopFactory(seconds=0.5),
    )
    getattr(node, name)("over")
    assert [record[1:] for record in caplog.record_tuples] == [
        (level, "part of 2"),
        (level, "a tick"),
        (level, "over"),
    ]
    assert [record[0] for record in caplog.record_tuples] == [
        "snr.test_node.part",
        "snr.test_node.ticker",
        "snr.test_node",
    ]


def test_an_endpoint_and_a_loop_store_pages_that_they_have_made() -> None:
    def tick(loop: Loop) -> None:
        loop.store_page(loop.page("of_loop", 2))

    node = run(
        FunctionEndpointFactory(begin=lambda part: part.store_page(Page("of_part", 1, "elsewhere", 0.5))),
        FunctionLoopFactory(tick, rate_hz=1),
        TimeoutLoopFactory(seconds=0.5),
    )
    assert node.get_page("of_part") == Page("of_part", 1, "elsewhere", 0.5)
    assert node.get_data("of_loop") == 2


def test_a_loop_that_sets_its_terminate_flag_ticks_no_more() -> None:
    ticks: list[float] = []

    def tick(loop: Loop) -> None:
        ticks.append(loop.get_time_s())
        loop.set_terminate_flag()
        assert loop.is_terminated()

    run(FunctionLoopFactory(tick, rate_hz=10), TimeoutLoopFactory(seconds=1))
    assert ticks == [0.0]


def test_retired_member_in_handler_raises_with_line_and_fix() -> None:
    def on_go(task: Any, task_id: Any) -> None:
        part[0].task_store_data("depth", 1.0)

    part: list[Any] = []
    with pytest.raises(ComponentFailedError) as caught:
        run(
            FunctionEndpointFactory(
                {(TaskType.event, "go"): on_go},
                begin=lambda one: (part.append(one), one.schedule(tasks.event("go"))),
            )
        )
    line, what, where, fix = str(caught.value).split("\n  ")
    assert f"{Path(__file__).name}, line" in line
    assert 'task_store_data("depth", 1.0)' in line
    assert what == "'task_store_data' of the 2021 library is not in snr_sim."
    assert "component 'part'" in where
    assert fix == "Try: self.store_data_task(key, data)."


def test_a_component_may_have_a_member_of_its_own_by_a_retired_name() -> None:
    class Mine(Loop):
        delay_s = 0.25

        def setup(self) -> None:
            self.timer = "mine"

    mine = Mine.factory().get(run(TimeoutLoopFactory(ms=1)))
    mine.setup()
    assert (mine.timer, mine.delay_s) == ("mine", 0.25)


def test_a_factory_does_not_reload_by_itself() -> None:
    with pytest.raises(RetiredNameError, match=r"(?s)factory\.reload.*tasks\.reload_component"):
        FunctionEndpointFactory().reload()


def test_task_store_data_raises_with_fix() -> None:
    with pytest.raises(RetiredNameError, match=r"(?s)tasks\.store_data.*self\.store_data_task\(key, data\)"):
        tasks.store_data("depth", 1.0)
    assert TaskType.store_data is TaskType.store_page


def test_task_source_is_not_called_and_is_noted() -> None:
    class Polled(Endpoint):
        def task_source(self) -> None:
            raise AssertionError

    node = run(Polled.factory(), TimeoutLoopFactory(ms=1))
    assert "'polled' has a task_source(), which nothing calls: a Loop brings in what is outside." in node.notes


def test_a_factory_can_be_annotated_with_what_it_makes() -> None:
    assert FunctionEndpointFactory[Endpoint]().get is not None
    with pytest.raises(ConfigError):
        run(FunctionEndpointFactory[Endpoint])
