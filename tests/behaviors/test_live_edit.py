"""A run that is edited in flight: each edit is an input, a broken text changes nothing, and the replay is exact."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import Config, ListReplayerFactory, Node, SimClock, SimRunner, TimeoutLoopFactory, tasks
from snr_sim.behaviors import Bridge, Drive, MachineFactory, Read, machine_parts, parse
from snr_sim.core.lockstep import LockStep
from snr_sim.core.reload.watch import WatchLoopFactory
from snr_sim.prelude.errors import ConfigError
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header
from snr_sim.testing.function_components import FunctionLoopFactory
from tests.behaviors.diver import DEPTHS, DIVER

BRIDGE = Bridge({"depth": Read("depth", "depth_m")}, {"up": Drive("thrust", "up_n", -50.0, 50.0)})


def event_at(time_s: float, name: str, *values: Any) -> TimeoutLoopFactory:
    return TimeoutLoopFactory(time_s, task=tasks.event(name, list(values)), name=f"{name} at {time_s}")


def parts(*more: Any) -> list[Any]:
    diver = machine_parts(parse(DIVER, BRIDGE.parts), "diver", bridge=BRIDGE)
    return [ListReplayerFactory(DEPTHS, "depth", rate_hz=10.0), *diver, *more]


def run(*more: Any, until_s: float = 3.0) -> Node:
    clock = SimClock()
    node = Node("r", Config(factories={"r": parts(*more)}), clock=clock)
    LockStep([node], clock, until_s=until_s).run()
    return node


def with_push(newtons: int) -> str:
    return DIVER.replace(":= [5]", f":= [{newtons}]")


def test_edit_takes_effect_and_is_answered() -> None:
    node = run(event_at(0.5, "diver.edit", with_push(9)), until_s=1.2)
    assert node.get_data("thrust") == {"up_n": 9.0}
    answer = node.get_data("diver.edited")
    assert (answer["ok"], answer["program"], answer["problems"]) == (True, 2, [])
    assert (answer["kept"], answer["restarted"], answer["stopped"]) == (["diver"], [], [])
    assert node.get_data("diver")["program"] == 2
    assert answer["sha256"] == parse(with_push(9), BRIDGE.parts).sha256


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([DIVER.replace("-> rising)", "-> risin)")], "There is no state 'risin' here."),
        (["(machine"], "'(' is not closed."),
        (["(machine m (state a (running [while True: pass])))(spawn m a)"], "'while' cannot be used in a block."),
        ([5], "The edit is not text."),
        ([with_push(9), "0" * 64], "Another edit came first."),
        ([with_push(9), 7], "The edit is not text."),
    ],
)
def test_text_with_mistakes_changes_nothing(values: list[Any], message: str) -> None:
    node = run(event_at(0.5, "diver.edit", *values), until_s=1.2)
    assert node.get_data("thrust") == {"up_n": 5.0}
    answer = node.get_data("diver.edited")
    assert (answer["ok"], answer["program"]) == (False, 1)
    assert answer["problems"][0]["message"] == message
    assert node.get_data("diver")["active"] == {"diver": "rising"}


def test_edit_is_logged_with_lines_and_what_to_try(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    run(event_at(0.5, "diver.edit", DIVER.replace("(on deep", "(on depe")), until_s=0.6)
    (text, after) = caplog.messages[-2:]
    assert text.splitlines() == [
        "diver:7:7: There is no event 'depe' here.", "     7    (on depe sinking -> rising)", "              ^^^^",
        "  Try: did you mean 'deep'? One of: deep, halt.",
    ]  # fmt: skip
    assert after == "diver: program 1 continues."
    run(event_at(0.5, "diver.edit", with_push(9)), until_s=0.6)
    assert caplog.messages[-1] == "diver: program 2 runs."


@pytest.mark.parametrize("name", ["depth", "thrust"])
def test_machine_that_is_named_as_a_page_of_the_robot_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match=f"named '{name}', and so is a page"):
        machine_parts(parse(DIVER, BRIDGE.parts), name, bridge=BRIDGE)


def test_refused_edit_has_the_present_text() -> None:
    node = run(event_at(0.5, "diver.edit", with_push(9), "0" * 64), until_s=1.0)
    assert node.get_data("diver.edited")["text"] == DIVER


def test_empty_text_stops_the_machine_and_its_motor() -> None:
    node = run(event_at(1.25, "diver.edit", ""), until_s=1.4)
    assert node.get_data("thrust") == {"up_n": 0.0}
    assert node.get_data("diver")["active"] == {}


def test_new_signal_is_handled_and_an_old_one_no_more() -> None:
    text = DIVER.replace("(event halt)", "(event halt_now)").replace("(on halt *", "(on halt_now *")
    node = run(event_at(1.15, "diver.edit", text), event_at(1.204, "halt_now"), until_s=1.206)
    assert node.get_data("diver")["active"] == {"diver": "sinking"}


def test_edit_while_it_is_paused_is_taken_and_moves_nothing() -> None:
    node = run(event_at(1.15, "diver.pause"), event_at(1.2, "diver.edit", with_push(9)), until_s=1.4)
    assert node.get_data("thrust") == {"up_n": 0.0}
    assert node.get_data("diver")["is_paused"]


RISEN = DIVER.replace("(state rising", "(state risen").replace("-> rising", "-> risen").replace("rising ->", "risen ->")
RISEN = RISEN.replace("[robot.up.start(push)]", "[robot.up.start(33)]").replace(
    "(spawn diver sinking)", "(spawn diver risen)"
)


def test_edit_that_moves_a_paused_machine_commands_the_robot_when_it_goes() -> None:
    pause, change = event_at(1.15, "diver.pause"), event_at(1.2, "diver.edit", RISEN)
    node = run(pause, change, until_s=1.4)
    page = node.get_data("diver")
    assert (page["active"], page["is_paused"], page["entered_s"]) == ({"diver": "risen"}, True, {"diver": 1.15})
    assert node.get_data("thrust") == {"up_n": 0.0}
    node = run(pause, change, event_at(1.4, "diver.go"), until_s=1.45)
    assert node.get_data("thrust") == {"up_n": 33.0}
    assert node.get_data("diver")["entered_s"] == {"diver": 1.4}


TEXTS = [
    DIVER,
    RISEN,
    with_push(9),
    "",
    DIVER.replace("sinking", "diving"),
    RISEN.replace("(onexit [", "(onexit [x = "),
]


@given(st.lists(st.sampled_from(["pause", "go", "halt", *range(len(TEXTS))]), max_size=12))
def test_paused_robot_is_at_neutral_in_any_history(words: list[str | int]) -> None:
    events = [
        event_at(0.9 + 0.1 * i, "halt" if word == "halt" else f"diver.{word}")
        if isinstance(word, str)
        else event_at(0.9 + 0.1 * i, "diver.edit", TEXTS[word])
        for i, word in enumerate(words)
    ]
    clock, seen = SimClock(), list[Any]()
    node = Node("r", Config(factories={"r": parts(*events)}), clock=clock)
    node.add_store_listener("thrust", lambda page: seen.append((diver.is_paused, page.data["up_n"])))
    node.add_store_listener(
        "diver", lambda page: seen.append((True, max([0, *page.data["entered_s"].values()]) > clock.now_s()))
    )
    diver: Any = node.components["diver"]
    LockStep([node], clock, until_s=2.3).run()
    assert not any(value for is_paused, value in seen if is_paused), seen


def test_commands_that_stood_before_a_pause_are_given_again() -> None:
    node = run(event_at(1.15, "diver.pause"), event_at(1.3, "diver.go"), until_s=1.35)
    assert node.get_data("thrust") == {"up_n": 5.0}


# -- record and replay ------------------------------------------------------------------------------------------------

EDITS = [
    with_push(7), "(machine", DIVER.replace("300", "100"), "", with_push(9), DIVER.replace("rising", "climbing"),
    DIVER.replace("(state sinking", "(state extra)(state sinking"), DIVER.replace("> 1.0", "> 0.5"), with_push(3),
    DIVER,
]  # fmt: skip


def edits() -> list[Any]:
    return [event_at(0.45 + 0.21 * i, "diver.edit", text) for i, text in enumerate(EDITS)]


def recorded(folder: Path) -> Trace:
    folder.mkdir()
    clock, config = SimClock(), Config(factories={"r": parts(*edits())})
    writer = TraceWriter(folder / FILE_NAME, program_header(["r"], config, __file__, clock))
    try:
        SimRunner(config, clock=clock, recorder=writer, until_s=4.0).run()
    finally:
        writer.close()
    return read_trace(folder / FILE_NAME)


def test_run_that_was_edited_ten_times_is_replayed_without_a_difference(tmp_path: Path) -> None:
    one, _ = recorded(tmp_path / "one"), recorded(tmp_path / "two")
    lines = [(tmp_path / name / FILE_NAME).read_bytes().splitlines()[2:] for name in ("one", "two")]
    assert lines[0] == lines[1]
    assert sum(b'"diver.edited"' in line for line in lines[0]) >= len(EDITS)
    replayed = replay_node(one, "r", Config(factories={"r": parts()}))
    assert replayed.is_identical, replayed.divergences


# -- from a file ------------------------------------------------------------------------------------------------------


def test_saved_file_is_an_edit(tmp_path: Path) -> None:
    path = tmp_path / "diver.lrp"
    path.write_text(DIVER)

    def save(loop: Any) -> None:
        if abs(loop.get_time_s() - 0.5) < 0.01:
            path.write_text(with_push(9))
        if abs(loop.get_time_s() - 0.8) < 0.01:
            path.write_text("(machine")
            os.utime(path, (1, 1))

    clock = SimClock()
    factories = [
        ListReplayerFactory(DEPTHS, "depth", rate_hz=10.0),
        *machine_parts(parse(DIVER, BRIDGE.parts), "diver", bridge=BRIDGE, path=path),
        FunctionLoopFactory(save, "editor", 10.0),
        WatchLoopFactory(rate_hz=20.0),
    ]
    node = Node("r", Config(factories={"r": factories}), clock=clock)
    LockStep([node], clock, until_s=1.2).run()
    assert node.get_data("thrust") == {"up_n": 9.0}
    answer = node.get_data("diver.edited")
    assert (answer["ok"], answer["program"]) == (False, 2)
    assert answer["problems"][0]["message"] == "'(' is not closed."


def test_factory_without_a_file_watches_none() -> None:
    node = run()
    component: Any = node.components["diver"]
    assert component.watched_files == {}
    assert MachineFactory(parse(DIVER, BRIDGE.parts)).path is None
