"""A machine in a node: when it takes a step, what it returns, and that its run is recorded and replayed exactly."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from snr_sim import Config, ListReplayerFactory, Node, SimClock, SimRunner, TimeoutLoopFactory, tasks
from snr_sim.behaviors import MachineFactory, Program, after, machine, machine_parts, on, state
from snr_sim.core.lockstep import LockStep
from snr_sim.prelude.errors import ComponentFailedError, ConfigError
from snr_sim.prelude.task import TaskType
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import LogLineRecord
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header
from snr_sim.testing.function_components import FunctionEndpointFactory

DEPTHS = [{"depth_m": 0.1 * i} for i in range(20)]


def is_deep(m: Any) -> bool:
    depth = m.data("depth")
    return depth is not None and depth["depth_m"] > 0.55


def push(m: Any) -> Any:
    m.variables["pushes"] += 1
    return m.store_data_task("thrust", {"up_n": 5.0})


def rest(m: Any) -> Any:
    return m.store_data_task("thrust", {"up_n": 0.0})


def diver(wait_s: float = 0.3) -> Program:
    return machine(
        "diver",
        "sinking",
        [
            state("sinking", on(is_deep, to="rising"), enter=rest),
            state("rising", after(wait_s, to="sinking"), enter=push, leave=rest),
            state("stopped", on("resume", to="sinking")),
        ],
        anywhere=[on("stop", to="stopped")],
        variables={"pushes": 0},
    )


def depths() -> ListReplayerFactory:
    return ListReplayerFactory(DEPTHS, "depth", rate_hz=10.0)


def event_at(time_s: float, name: str, *values: Any) -> TimeoutLoopFactory:
    return TimeoutLoopFactory(time_s, task=tasks.event(name, list(values)), name=f"{name} at {time_s}")


def run(*factories: Any, until_s: float = 2.0) -> Node:
    clock = SimClock()
    node = Node("r", Config(factories={"r": list(factories)}), clock=clock)
    LockStep([node], clock, until_s=until_s).run()
    return node


def transitions(*factories: Any, until_s: float = 2.0) -> list[tuple[float, str, str]]:
    """Return time, source and target of each transition of a run."""
    seen: list[tuple[float, str, str]] = []

    def note(task: Any, task_id: Any) -> None:
        (change,) = task.val_list
        seen.append((change["t_ns"] / 1e9, change["source"], change["target"]))

    run(*factories, FunctionEndpointFactory({(TaskType.event, "diver.transition"): note}, "listener"), until_s=until_s)
    return seen


def test_machine_takes_steps_at_its_rate() -> None:
    seen = transitions(depths(), *machine_parts(diver(), "diver", step_hz=50.0), until_s=1.2)
    assert seen == [
        (0.0, "", "sinking"),
        (0.6, "sinking", "rising"),
        (0.9, "rising", "sinking"),
        (0.92, "sinking", "rising"),
    ]


def test_page_that_it_reacts_to_causes_a_step_at_once() -> None:
    seen = transitions(depths(), MachineFactory(diver(), "diver", reacts_to=["depth"]), until_s=0.8)
    assert seen == [(0.0, "", "sinking"), (0.6, "sinking", "rising")]


def test_signals_are_events_of_the_node() -> None:
    seen = transitions(*machine_parts(diver(), "diver"), event_at(0.101, "stop"), event_at(0.303, "resume"))
    assert seen == [(0.0, "", "sinking"), (0.101, "sinking", "stopped"), (0.303, "stopped", "sinking")]


def test_two_signals_of_one_moment_cause_two_steps_in_their_order() -> None:
    seen = transitions(*machine_parts(diver(), "diver"), event_at(0.1, "stop"), event_at(0.1, "resume"))
    assert [target for _, _, target in seen] == ["sinking", "stopped", "sinking"]


def test_signal_that_no_state_waited_for_is_noted() -> None:
    node = run(*machine_parts(diver(), "diver"), event_at(0.1, "resume"), event_at(0.2, "resume"))
    assert any("was in no state that waits for 'resume' when it came, 2 times" in note for note in node.report.notes)


def test_page_has_states_times_and_variables() -> None:
    node = run(depths(), *machine_parts(diver(), "diver"), until_s=0.7)
    page = node.get_data("diver")
    assert page["active"] == {"diver": "rising"}
    assert page["entered_s"] == {"diver": 0.6}
    assert page["left"] == [{"machine": "diver", "state": "sinking", "held_s": 0.6}]
    assert page["entered"] == [{"machine": "diver", "state": "rising"}]
    assert (page["last"]["name"], page["last"]["kind"]) == ("sinking->rising", "on")
    assert page["variables"] == {"diver.pushes": 1}
    assert (page["problems"], page["ignored"], page["is_paused"]) == (0, 0, False)
    assert node.get_data("thrust") == {"up_n": 5.0}


def test_machine_that_does_not_change_stores_nothing() -> None:
    stored = 0

    def count(task: Any, task_id: Any) -> None:
        nonlocal stored
        stored += 1

    run(
        *machine_parts(diver(), "diver"),
        FunctionEndpointFactory({(TaskType.process_data, "diver"): count}, "listener"),
        until_s=5.0,
    )
    assert stored == 1


def test_time_stands_still_while_it_is_paused() -> None:
    seen = transitions(
        depths(), *machine_parts(diver(), "diver"), event_at(0.7, "diver.pause"), event_at(1.2, "diver.go"),
        event_at(0.8, "diver.pause"), event_at(1.3, "diver.go"), until_s=1.405,
    )  # fmt: skip
    assert seen[1:] == [(0.6, "sinking", "rising"), (1.4, "rising", "sinking")]


def test_no_step_while_it_is_paused() -> None:
    seen = transitions(*machine_parts(diver(), "diver"), event_at(0.1, "diver.pause"), event_at(0.2, "stop"))
    assert [target for _, _, target in seen] == ["sinking"]


def test_variable_is_set_by_an_event() -> None:
    node = run(*machine_parts(diver(), "diver"), event_at(0.1, "diver.set", "diver.pushes", 7))
    assert node.get_data("diver")["variables"] == {"diver.pushes": 7}


@pytest.mark.parametrize("values", [(), ("diver.pushes",), ("nothing", 1), ("diver.pushes", {}), (5, 5), ([], 1)])
def test_wrong_request_to_set_a_variable_is_noted_and_changes_nothing(values: Any) -> None:
    node = run(*machine_parts(diver(), "diver"), event_at(0.1, "diver.set", *values))
    assert node.get_data("diver")["variables"] == {"diver.pushes": 0}
    assert any("was rejected" in note for note in node.report.notes)


def test_error_in_a_function_names_its_line() -> None:
    def wrong(m: Any) -> Any:
        return m.data("depth")["depht_m"]

    program = machine("diver", "a", [state("a", on(wrong, to="a"))])
    with pytest.raises(ComponentFailedError, match=r"depht_m") as caught:
        run(depths(), *machine_parts(program, "diver"))
    assert f"{Path(__file__).name}" in str(caught.value)


def test_function_that_returns_no_task_is_named() -> None:
    def forgets(m: Any) -> Any:
        return {"up_n": 5.0}

    with pytest.raises(ComponentFailedError, match="forgets"):
        run(*machine_parts(machine("diver", "a", [state("a", enter=forgets)]), "diver"))


def test_program_must_be_one() -> None:
    with pytest.raises(ConfigError, match=r"MachineFactory is given 'mission\.lrp'"):
        MachineFactory("mission.lrp")  # type: ignore[arg-type]


def test_optional_events_are_not_noted() -> None:
    assert run(*machine_parts(machine("m", "a", [state("a")]), "m")).report.notes == []


def test_doubtful_state_is_noted() -> None:
    node = run(*machine_parts(machine("m", "a", [state("a"), state("b")]), "m"))
    assert any("can reach state 'b'" in note for note in node.report.notes)


# -- record and replay ------------------------------------------------------------------------------------------------


def factories(wait_s: float) -> list[Any]:
    events = [event_at(0.85, "stop"), event_at(1.1, "resume"), event_at(1.2, "diver.set", "diver.pushes", -3)]
    return [depths(), *machine_parts(diver(wait_s), "diver", step_hz=100.0), *events]


def recorded(folder: Path, wait_s: float) -> Trace:
    folder.mkdir()
    clock, config = SimClock(), Config(factories={"r": factories(wait_s)})
    writer = TraceWriter(folder / FILE_NAME, program_header(["r"], config, __file__, clock))
    try:
        SimRunner(config, clock=clock, recorder=writer, until_s=2.0).run()
    finally:
        writer.close()
    return read_trace(folder / FILE_NAME)


def test_two_runs_have_one_trace_and_the_replay_finds_no_difference(tmp_path: Path) -> None:
    one, two = recorded(tmp_path / "one", 0.3), recorded(tmp_path / "two", 0.3)
    lines = [(tmp_path / name / FILE_NAME).read_bytes().splitlines()[2:] for name in ("one", "two")]
    assert lines[0] == lines[1]
    for trace in (one, two):
        assert replay_node(trace, "r", Config(factories={"r": factories(0.3)})).divergences == []


def test_replay_with_another_condition_finds_the_step_that_it_first_decides(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trace = recorded(tmp_path / "one", 0.3)

    def is_deep(m: Any) -> bool:
        depth = m.data("depth")
        return depth is not None and depth["depth_m"] > 0.45

    monkeypatch.setitem(globals(), "is_deep", is_deep)
    first = replay_node(trace, "r", Config(factories={"r": factories(0.3)})).divergences[0]
    assert (first.t, first.component) == (0.5, "diver")


def test_replay_of_another_program_finds_the_step_at_which_it_differs(tmp_path: Path) -> None:
    trace = recorded(tmp_path / "one", 0.3)
    first = replay_node(trace, "r", Config(factories={"r": factories(0.2)})).divergences[0]
    assert (first.t, first.component) == (0.8, "diver")
    listing = [one.text for one in trace.records if isinstance(one, LogLineRecord) and one.level == "PROGRAM"]
    assert "  (ontime 300 rising -> sinking rising->sinking)" in listing
