"""Timeout and stopwatch: exact in virtual time, prompt on threads."""

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import (
    Config,
    Node,
    SNRTestCase,
    StopwatchEndpointFactory,
    SynchronousRunner,
    TaskType,
    TimeoutLoopFactory,
    WallClock,
    tasks,
)
from snr_sim.prelude.errors import ParameterError
from snr_sim.testing.function_components import FunctionLoopFactory

case = SNRTestCase()


@given(st.floats(0.0, 1e5))
def test_timeout_is_exact_in_virtual_time(seconds: float) -> None:
    node = case.run_test_node([TimeoutLoopFactory(seconds=seconds)], until_s=1e6)
    assert (node.exit_reason, node.get_time_s()) == ("timeout", seconds)


def test_seconds_and_milliseconds_add_up() -> None:
    assert case.run_test_node([TimeoutLoopFactory(seconds=1, ms=500)]).get_time_s() == 1.5
    assert case.run_test_node([TimeoutLoopFactory(ms=250)]).get_time_s() == 0.25


def test_any_task_may_follow_and_it_follows_once() -> None:
    times: list[float] = []
    node = case.run_test_node(
        [
            TimeoutLoopFactory(seconds=0.5, task=tasks.event("half"), name="half"),
            TimeoutLoopFactory(seconds=2.0),
            StopwatchEndpointFactory(times, [(TaskType.event, "half")]),
        ]
    )
    assert times == [0.5]
    assert node.notes == []


@pytest.mark.parametrize("seconds", [-1.0, float("nan"), float("inf")])
def test_invalid_delay_is_rejected(seconds: float) -> None:
    with pytest.raises(ParameterError, match="A timeout of"):
        TimeoutLoopFactory(seconds=seconds)


@pytest.mark.wall_clock
def test_wall_clock_timeout_fires_soon_after_its_time() -> None:
    took_s = []
    for _ in range(5):
        runner = SynchronousRunner("r", Config(factories={"r": [TimeoutLoopFactory(ms=80)]}))
        start_s = time.monotonic()
        runner.run()
        took_s.append(time.monotonic() - start_s)
    assert min(took_s) >= 0.08
    assert max(took_s) < 0.3


def test_stopwatch_records_time_of_each_matching_task() -> None:
    times: list[float] = []
    ticker = FunctionLoopFactory(lambda loop: loop.schedule([tasks.event("lap"), tasks.event("other")]), rate_hz=4)
    case.run_test_node([ticker, StopwatchEndpointFactory(times, [(TaskType.event, "lap")])], until_s=0.5)
    assert times == [0.0, 0.25, 0.5]


@pytest.mark.slow
def test_a_stopwatch_on_the_wall_clock_reads_the_nodes_time() -> None:
    times: list[float] = []
    watch = StopwatchEndpointFactory(times, [TaskType.terminate])
    node = Node("r", Config(factories={"r": [watch, TimeoutLoopFactory(ms=30)]}), clock=WallClock())
    node.loop()
    assert len(times) == 1
    assert 0.03 <= times[0] <= node.clock.now_s()
