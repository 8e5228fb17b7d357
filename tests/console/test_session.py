"""Commands on a running node: what they change, what they only read, and what they reject."""

import json
import math
from typing import Any

import numpy as np
import pytest

from snr_sim import Config, Mode, Node, Page, SimClock, Task, TaskType
from snr_sim.console import commands, session
from snr_sim.console.commands import TABLE
from snr_sim.console.formatting import MAX_TEXT_CHARS
from snr_sim.console.session import ConsoleSession
from snr_sim.testing.fake_recorder import FakeRecorder
from snr_sim.testing.function_components import FunctionEndpointFactory

from .conftest import Talk


def test_exit_ends_the_node_with_its_reason(talk: Talk) -> None:
    assert "urov_node" in talk.run("exit back to the shore")
    assert talk.node.is_terminated
    assert talk.node.exit_reason == "back to the shore"


def test_task_without_type_is_an_event_with_json_values(talk: Talk) -> None:
    talk.run('task start 1.5 [1, 2] {"a": null} "two words"')
    talk.run("task event start")
    assert [task.val_list for task in talk.events] == [[1.5, [1, 2], {"a": None}, "two words"], []]


@pytest.mark.parametrize("line", ["store depth_m 3.5", "task store_page depth_m 3.5"])
def test_store_command_stores_and_processes_a_page(talk: Talk, line: str) -> None:
    talk.run(line)
    assert talk.node.get_data("depth_m") == 3.5
    assert [(task.id(), task.page) for task in talk.events] == [
        ((TaskType.process_data, "depth_m"), talk.node.get_page("depth_m"))
    ]
    talk.run("task process_data depth_m")
    assert len(talk.events) == 2


@pytest.mark.parametrize("line", ["reload part", "task reload part"])
def test_reload_queues_the_task(talk: Talk, line: str) -> None:
    talk.run(line)
    assert talk.events == [Task(TaskType.reload, "part")]


def test_task_of_type_terminate_ends_the_node(talk: Talk) -> None:
    talk.run("task terminate enough")
    assert talk.node.exit_reason == "enough"


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("", "empty line"),
        ("stroe x 1", "'store'"),
        ("task", "needs NAME"),
        ("task strat", "'start'"),
        ("task event", "needs NAME"),
        ("task process_data dept_m", "'depth_m'"),
        ("task process_data depth_m 5", "no values"),
        ("task store_page depth_m", "takes one value"),
        ("task event add_component 1", "No component of this node handles|the node's own"),
        ("task terminate", "needs NAME"),
        ("store depth_m", "needs JSON"),
        ("store depth_m deep", 'text needs quotes: "deep"'),
        ("store depth_m NaN", "not JSON"),
        ("task evnt start foo", "'evnt' is not a valid TYPE"),
        ("task start foo", "not JSON"),
        ("store depth_m 1 2", "does not take '2'"),
        ("store depth_m 123456789012345678901234567890", "not JSON|too large"),
        ("store depth_m -9223372036854775809", "too large"),
        ("store depth_m [1, 2", "is not closed"),
        ('store depth_m "deep', "is not closed"),
        ("store depth_m 1]", "not JSON"),
        ("store \x1b[2J] 1", "is not a valid KEY"),
        (f"store {'k' * 201} 1", "is not a valid KEY"),
        ('store "" 1', "is not a valid KEY"),
        ("store 5 \ud800", "not JSON"),
        ("reload pat", "'part'"),
        ("reload node_core", "no component 'node_core'"),
        ("task reload node_core", "no component 'node_core'"),
        ("list pagse", "'pages'"),
        ("dump deth_m", "'depth_m'"),
        ("unwatch depth_m", "not watched"),
        ("help stroe", "'store'"),
        ("help store it", "does not take 'it'"),
        ("store depth_m " + "[" * 33 + "]" * 33, "nested more than 32 deep"),
        ("store depth_m " + "[" * 16_000, "nested more than 32 deep"),
        ("x" * 70_000, "70000 characters"),
        ("__import__('os')", "no command"),
    ],
)
def test_invalid_command_returns_error_with_reason(talk: Talk, line: str, expected: str) -> None:
    talk.run("store depth_m 1.0")
    before = dict(talk.node.datastore.pages)
    answer = talk.refused(line)
    assert any(part in answer for part in expected.split("|")), answer
    assert len(answer) < 600
    talk.settle()
    assert talk.node.datastore.pages == before
    assert not talk.node.is_terminated


def test_event_of_the_node_core_returns_error(talk: Talk) -> None:
    core = talk.node.components["node_core"]
    core.task_handlers[TaskType.event, "inner"] = lambda task, task_id: None
    assert "No component of this node handles" not in talk.refused("task inner")


def test_list_returns_components_pages_links_and_loops(talk: Talk) -> None:
    talk.run('store link_topside {"up": true, "age_s": 0.25, "dropped": 3, "rtt_s": null}')
    text = talk.run("list")
    for word in ("part", "endpoint", "ticker", "loop", "10", "link_topside", "topside", "beat"):
        assert word in text
    assert "depth_m" not in talk.run("list components")
    data = talk.session.execute("list links").data
    assert data == {"links": [{"link": "topside", "up": True, "age_s": 0.25, "dropped": 3, "rtt_s": None}]}


def test_list_accepts_the_names_of_the_thesis(talk: Talk) -> None:
    assert talk.run("list commands") == talk.run("help")
    assert talk.run("list endpoints") == talk.run("list components")


def test_loops_are_shown_with_their_ticks_and_lag(talk: Talk) -> None:
    talk.tick()
    talk.tick()
    (row,) = talk.session.execute("dump loops").data["loops"]
    assert row == {"loop": "ticker", "rate_hz": 10.0, "ticks": 3, "late_s": 0.0, "runs": "yes"}


def test_the_profiler_is_shown_if_there_is_one(talk: Talk) -> None:
    assert "Mode.DEBUG" in talk.run("dump profiler")
    debug = Talk(Mode.DEBUG)
    debug.run("task start")
    assert "part._note" in debug.run("dump profiler")


def test_every_dump_together_and_each_alone(talk: Talk) -> None:
    whole = talk.session.execute("dump").data
    assert list(whole) == list(commands.DUMPS)
    for what in commands.DUMPS:
        assert list(talk.session.execute(f"dump {what}").data) == [what]


class Nasty:
    def __repr__(self) -> str:
        raise AssertionError("the console called a student's code")

    __str__ = __hash__ = __eq__ = __repr__  # type: ignore[assignment]
    __iter__ = __len__ = __bool__ = __repr__  # type: ignore[assignment]

    def __init__(self) -> None:
        self.inside: Any = [1, self]


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (math.nan, "x = nan "),
        ([math.inf, -0.0], "[inf, -0.0]"),
        (np.array([[1.0, math.nan]]), "float64 1 x 2"),
        (np.zeros((3000, 4000)), "... 11999000 more"),
        (np.float32(0.5), "x = 0.5 "),
        (np.array(5), "int64"),
        (np.array([Nasty()], dtype=object), "Nasty"),
        (Nasty(), "Nasty"),
        ("y" * 10**8, "... 100000000 characters"),
        (list(range(10**6)), "... 999000 more"),
        ({i: i for i in range(2000)}, '...: "1000 more"'),
        ([["z" * 3000] * 10] * 100, "... 3000 characters"),
        ({(1, 2): {3}, None: b"ab"}, "2 bytes 6162"),
        pytest.param(10**5000, "whole number of 16610 bits", id="huge"),
        (10**30, "1000000000000000000000000000000"),
        ("\x1b[2Jred\n", "\\x1b[2Jred\\n"),
        ("half \ud800 a pair", "half \\\\ud800 a pair|half \\ud800 a pair"),
        (1 + 2j, "(1+2j)"),
        (Page("inner", 1, "n", 0.0), "inner"),
    ],
)
def test_unusual_page_data_is_shown_readably_and_bounded(talk: Talk, value: Any, expected: str) -> None:
    talk.node.store_data("x", value, process=False)
    talk.settle()
    for line in ("dump x", "dump", "list", "watch x"):
        answer = talk.session.execute(line)
        assert not answer.is_error, answer.text
        assert len(answer.text) < MAX_TEXT_CHARS + 100
        assert answer.text.replace("\n", "").isprintable()
        assert len(json.dumps(answer.data)) < 1 << 18
    assert any(part in talk.run("dump x") for part in expected.split("|")), talk.run("dump x")


def test_page_that_contains_itself_is_truncated(talk: Talk) -> None:
    loop: list[Any] = []
    loop.append(loop)
    talk.node.store_data("x", loop, process=False)
    talk.settle()
    assert "nested deeper" in talk.run("dump x")


def test_page_with_invalid_time_or_origin_is_shown(talk: Talk) -> None:
    talk.node.schedule(Task.store_page(Page("x", 1, object(), None, False)))  # type: ignore[arg-type]
    talk.settle()
    assert "x = 1 (time unknown" in talk.run("dump x").replace("  ", " ")
    talk.run("list")


def test_watched_page_is_shown_on_change_at_a_limited_rate(talk: Talk) -> None:
    assert "Nothing has stored" in talk.run("watch depth_m")
    assert talk.session.changes(0.0) == []
    shown = []
    for i in range(100):  # pages at 100 Hz, for a second
        talk.run(f"store depth_m {i}")
        shown += talk.session.changes(i / 100)
    assert len(shown) == 10
    assert {answer.about for answer in shown} == {"depth_m"}
    assert [answer.data["data"] for answer in talk.session.changes(2.0)] == [99]
    assert talk.session.changes(3.0) == []
    assert talk.run("unwatch depth_m") == "watched: nothing"
    talk.run("store depth_m 5")
    assert talk.session.changes(4.0) == []


def test_watch_shows_current_data_and_unwatch_ends_all(talk: Talk) -> None:
    talk.run("store depth_m 2.5")
    assert "depth_m = 2.5" in talk.run("watch depth_m")
    talk.run("watch beat")
    assert talk.session.is_watching
    talk.run("unwatch")
    assert not talk.session.is_watching


def test_watch_beyond_the_maximum_returns_error(talk: Talk) -> None:
    for i in range(session.MAX_WATCHES):
        talk.run(f"watch k{i}")
    talk.run("watch k0")
    assert "16 pages, the maximum" in talk.refused("watch more")


def test_new_names_beyond_the_maximum_return_error(talk: Talk) -> None:
    for i in range(session.MAX_NEW_NAMES):
        talk.run(f"store k{i} 0")
    assert "new names" in talk.refused("store more 0")
    other = ConsoleSession(talk.node, TABLE, new_names=talk.session.new_names)
    assert other.execute("store more 0").is_error
    talk.run("store k0 1")
    talk.run("store beat 1")  # a name that the node knows already


def test_overloaded_node_rejects_commands(talk: Talk) -> None:
    for _ in range(session.MAX_WAITING_TASKS):
        assert not talk.session.execute("task start").is_error
    assert "does not keep up" in talk.session.execute("task start").text
    talk.settle()
    talk.run("task start")


def test_ended_node_rejects_tasks_and_answers_list(talk: Talk) -> None:
    talk.run("exit")
    talk.node.end()
    assert "has ended" in talk.session.execute("task start").text
    assert "part" in talk.run("list")


def test_help_has_one_line_per_command(talk: Talk) -> None:
    assert talk.run("help").count("\n") + 1 == len(commands.TABLE)
    for name, command in commands.TABLE.items():
        assert talk.run(f"help {name}").startswith(command.usage)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", sorted(commands.TABLE)),
        ("re", ["reload"]),
        ("reload ", ["all", "part", "ticker"]),
        ("reload p", ["part"]),
        ("reload part ", []),
        ("task st", ["start", "store_page"]),
        ("task event st", ["start"]),
        ("task start ", []),
        ("dump b", ["beat"]),
        ("dump l", ["links", "loops"]),
        ("list pa", ["pages"]),
        ("watch ", ["beat"]),
        ("help unw", ["unwatch"]),
        ("nonsense ", []),
        ('task "\ud800 [', []),
    ],
)
def test_completion_returns_commands_components_keys_and_events(talk: Talk, line: str, words: list[str]) -> None:
    assert talk.session.complete(line) == words


def test_changing_commands_are_recorded_inputs_and_reads_are_not() -> None:
    recorder = FakeRecorder()
    config = Config(factories={"r": [FunctionEndpointFactory({(TaskType.event, "start"): lambda task, task_id: None})]})
    node = Node("r", config, clock=SimClock(), recorder=recorder)
    node.begin()
    mine = ConsoleSession(node, TABLE, "my_console")
    for line in ("list", "dump", "watch depth_m", "help", "task start", "store depth_m 1", "reload part", "exit"):
        assert not mine.execute(line).is_error
    node.run_ready()
    assert [source for source, _ in recorder.inputs] == ["my_console"] * 4
    assert {task.type for _, task in recorder.inputs} == {
        TaskType.event,
        TaskType.store_page,
        TaskType.reload,
        TaskType.terminate,
    }
    assert node.datastore.missed == {}
