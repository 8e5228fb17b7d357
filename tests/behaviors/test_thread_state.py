"""States whose function blocks: it runs on a thread of its own, and its outcome comes as an event."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim import Config, Node, SimClock, SimRunner, TimeoutLoopFactory, WallClock, tasks
from snr_sim.behaviors.flow import Concurrence, Flow, FlowFactory, State, ThreadState, flow_parts, wait
from snr_sim.core.lockstep import LockStep
from snr_sim.prelude.errors import ComponentFailedError, ConfigError
from snr_sim.recording.reader import read_trace
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header

SCAN = {"input_keys": ("goal",), "output_keys": ("way_m",)}


def scanning(function: Callable[..., Any], **settings: Any) -> Flow:
    flow = Flow("mission", outcomes=("seen", "missed"))
    flow.add("SCAN", ThreadState(function, ("seen", "missed"), **settings))
    return flow


def run(*factories: Any) -> Node:
    clock = SimClock()
    node = Node("r", Config(factories={"r": list(factories)}), clock=clock)
    LockStep([node], clock, until_s=2.0).run()
    return node


def test_function_gets_data_and_gives_outcome_and_data_back() -> None:
    def scan(goal: dict[str, float]) -> tuple[str, dict[str, float]]:
        goal["x"] += 1.0  # its own copy
        return "missed", {"way_m": 2.0 * goal["x"]}

    node = run(*flow_parts(scanning(scan, **SCAN), userdata={"goal": {"x": 1.0}}))
    page = node.get_data("mission")
    assert (page["outcome"], page["userdata"]) == ("missed", {"goal": {"x": 1.0}, "way_m": 4.0})
    assert any("'mission/SCAN' is called by the virtual clock" in note for note in node.notes)


def test_replay_does_not_call_the_function(tmp_path: Path) -> None:
    def scan() -> str:
        calls.append(1)
        return "seen"

    calls: list[int] = []
    config = Config(factories={"r": flow_parts(scanning(scan))})  # type: ignore[dict-item]
    clock = SimClock()
    writer = TraceWriter(tmp_path / FILE_NAME, program_header(["r"], config, __file__, clock))
    SimRunner(config, clock=clock, recorder=writer, until_s=1.0).run()
    writer.close()
    found = replay_node(read_trace(tmp_path / FILE_NAME), "r", config)
    assert (found.divergences, found.executed > 50, len(calls)) == ([], True, 1)


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        ("sene", "did you mean 'seen'?"),
        (None, 'return "done"'),
        (("seen", 5), 'return "done"'),
        (("seen", {"wya_m": 1.0}), "way_m"),
        (("seen", {"way_m": threading.Lock()}), "an object of the type lock"),
    ],
)
def test_function_that_returns_something_else_ends_the_node_with_its_name(returned: Any, message: str) -> None:
    with pytest.raises(ComponentFailedError) as caught:
        run(*flow_parts(scanning(lambda: returned, output_keys=("way_m",))))
    assert message in str(caught.value)
    assert "mission/SCAN" in str(caught.value)


def test_flow_without_its_threads_is_refused() -> None:
    with pytest.raises(ComponentFailedError, match=r"'mission/SCAN' has no thread[\s\S]*flow_parts"):
        run(FlowFactory(scanning(lambda: "seen")))
    with pytest.raises(ConfigError, match="without brackets"):
        ThreadState("scan")  # type: ignore[arg-type]


class Counting(State):
    """Counts in steps of 10 ms, and ends after 0.3 s."""

    outcomes = ("done",)

    def run(self, userdata: Any) -> Any:
        for _ in range(30):
            counted.append(threading.current_thread().name)
            yield wait(0.01)
        return "done"


counted: list[str] = []


@pytest.mark.slow
@pytest.mark.wall_clock
def test_states_beside_it_continue_while_the_function_blocks() -> None:
    def scan() -> str:
        assert threading.current_thread().name == "mission/BOTH/SCAN"
        before = len(counted)
        time.sleep(0.2)
        passed.append(len(counted) - before)
        return "done"

    passed: list[int] = []
    both = Concurrence(("done",), "done")
    both.add("COUNT", Counting())
    both.add("SCAN", ThreadState(scan))
    flow = Flow("mission", outcomes=("done",))
    flow.add("BOTH", both)
    parts = [*flow_parts(flow), TimeoutLoopFactory(seconds=1.0)]
    node = Node("r", Config(factories={"r": parts}), clock=WallClock())
    node.loop()
    assert node.get_data("mission")["outcome"] == "done"
    assert passed[0] > 5


@pytest.mark.slow
@pytest.mark.wall_clock
def test_call_of_a_preempted_state_is_not_the_outcome_of_the_next() -> None:
    """The first call takes until after the flow has begun again; the second waits for it."""

    def scan() -> str:
        calls.append(time.monotonic())
        time.sleep(0.4)
        return "missed" if len(calls) == 1 else "seen"

    calls: list[float] = []
    parts = [
        *flow_parts(scanning(scan)),
        TimeoutLoopFactory(0.1, task=tasks.event("mission.preempt"), name="preempt"),
        TimeoutLoopFactory(0.2, task=tasks.event("mission.start"), name="start"),
        TimeoutLoopFactory(seconds=1.5),
    ]
    node = Node("r", Config(factories={"r": parts}), clock=WallClock())
    node.loop()
    assert len(calls) == 2
    assert calls[1] - calls[0] >= 0.4
    assert node.get_data("mission")["outcome"] == "seen"
