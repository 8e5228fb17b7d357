"""The profiler counts all of a run, not only its last calls, and loops as well as handlers."""

import time
from typing import Any

import pytest

from snr_sim import Config, Mode, Node, Profiler, SimClock, TaskType, tasks
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory


def test_weakness_27_mean_covers_all_calls_and_max_is_kept() -> None:
    profiler = Profiler()
    for duration_s in [0.001] * 968 + [0.0] * 32:
        profiler.store_task("part.handler", duration_s)
    timing = profiler.timings["part.handler"]
    assert timing.count == 1000
    assert timing.mean_s == pytest.approx(0.000968)
    assert timing.max_s == 0.001


def test_shares_sum_to_one_and_the_most_expensive_comes_first() -> None:
    profiler = Profiler()
    for name, duration_s in (("cheap", 1.0), ("dear", 3.0)):
        profiler.store_task(name, duration_s)
    rows = profiler.rows()
    assert [(row["name"], row["share"]) for row in rows] == [("dear", 0.75), ("cheap", 0.25)]
    assert "75.0%" in profiler.dump()
    assert Profiler().rows() == []


def test_a_call_that_raises_is_counted_too() -> None:
    profiler = Profiler()
    with pytest.raises(ZeroDivisionError):
        profiler.time("div", lambda: 1 / 0)
    assert profiler.timings["div"].count == 1


def test_debug_mode_times_each_handler_and_loop() -> None:
    def work(task: Any, task_id: Any) -> None:
        time.sleep(0.002)

    loop = FunctionLoopFactory(lambda loop: loop.schedule(tasks.event("x")), rate_hz=10)
    end = FunctionLoopFactory(
        lambda loop: loop.get_time_s() > 0.4 and loop.schedule(tasks.terminate("done")), "end", 10
    )
    config = Config(Mode.DEBUG, {"r": [FunctionEndpointFactory({(TaskType.event, "x"): work}), loop, end]})
    node = Node("r", config, clock=SimClock())
    node.loop()
    assert node.profiler is not None
    timings = node.profiler.timings
    assert timings["part.work"].count == timings["ticker.loop"].count == 6
    assert timings["part.work"].mean_s >= 0.002
    assert {"ticker.setup", "end.loop", "node_core.end_node"} <= set(timings)
