"""What the page of a running machine changes: program, variables, buttons. Each change is an input of the node."""

from __future__ import annotations

import pytest

from snr_sim import Config
from snr_sim.behaviors import machine_parts, parse
from snr_sim.scenario.machine_controller import guard_edits
from snr_sim.web import live_machine
from tests.web.dive import BRIDGE, DIVER, SHA, Live, edit, event_at, parts, with_push

WINKS = """(export winks)
(machine winks (state open) (state shut)
  (ontime 250 open -> shut)
  (ontime 250 shut -> open))
"""
WITH_WINKS = f'(import "winks.lrp")\n{DIVER}(spawn winks open)\n'
FASTER = WINKS.replace("250 open", "50 open")


@pytest.fixture
def winking() -> Live:
    """A dive whose program imports a file."""
    program = parse(WITH_WINKS, BRIDGE.parts, {"winks.lrp": WINKS})
    return Live(*machine_parts(program, "diver", bridge=BRIDGE))


# -- edits ------------------------------------------------------------------------------------------------------------


def test_edit_is_answered_and_shown_to_all(live: Live) -> None:
    browser, other = live.browser(), live.browser("look")
    live.until(0.5)
    edit(browser, 7, with_push(9))
    live.until(0.6)
    answer = browser.newest("edited")
    assert (answer["number"], answer["ok"], answer["is_stale"], answer["program"]) == (7, True, False, 2)
    assert answer["kept"] == ["diver"]
    assert other.of("edited") == []
    for one in (browser, other):
        program = one.newest("program")
        assert (program["number"], program["text"], program["by"]) == (2, with_push(9), "page")
        assert program["sha256"] == answer["sha256"] == parse(with_push(9), BRIDGE.parts).sha256
        assert one.received.index(program) < one.received.index(next(s for s in one.of("state") if s["number"] == 2))
    live.until(1.2)
    assert live.node.get_data("thrust") == {"up_n": 9.0}


def test_edit_is_an_input_of_the_node(live: Live) -> None:
    edit(live.browser(), 7, with_push(9))
    ((task, source),) = live.node.inbox.waiting
    assert (task.name, task.val_list, source) == ("diver.edit", [with_push(9), SHA], "live")


def test_text_with_mistakes_does_not_enter_the_node(live: Live) -> None:
    browser = live.browser()
    edit(browser, 3, DIVER.replace("-> rising)", "-> risin)"))
    assert not live.node.inbox.waiting
    answer = browser.newest("edited")
    assert (answer["number"], answer["ok"], answer["program"], answer["sha256"]) == (3, False, 1, SHA)
    (problem,) = answer["problems"]
    assert problem == {
        "line": 7, "column": 23, "end_line": 7, "end_column": 28, "message": "There is no state 'risin' here.",
        "fix": "did you mean 'rising'? One of: rising, sinking.", "is_error": True,
    }  # fmt: skip


def test_second_of_two_browsers_is_stale_and_gets_the_text(live: Live) -> None:
    one, other = live.browser(), live.browser()
    edit(one, 1, with_push(9))
    edit(other, 1, with_push(7))
    live.tick()
    assert one.newest("edited")["ok"]
    answer = other.newest("edited")
    assert (answer["ok"], answer["is_stale"], answer["text"], answer["program"]) == (False, True, with_push(9), 2)
    edit(other, 2, with_push(7), answer["sha256"])
    live.tick()
    assert other.newest("edited")["ok"]


def test_same_text_from_two_browsers_is_answered_to_each(live: Live) -> None:
    one, other = live.browser(), live.browser()
    edit(one, 1, with_push(9))
    edit(other, 2, with_push(9))
    live.tick()
    assert [(one["number"], one["ok"]) for one in one.of("edited")] == [(1, True)]
    assert [(one["number"], one["ok"]) for one in other.of("edited")] == [(2, False)]


def test_edit_of_an_imported_file_is_answered_shown_and_undone(winking: Live) -> None:
    browser, other = winking.browser(), winking.browser("look")
    sha256 = browser.newest("hello")["sha256"]
    browser.send("edit", number=1, text=FASTER, base_sha256=sha256, file="winks.lrp")
    winking.until(0.1)
    answer = browser.newest("edited")
    assert (answer["ok"], answer["program"], answer["text"]) == (True, 2, None)
    program = other.newest("program")
    assert (program["text"], program["files"], program["sha256"]) == (
        WITH_WINKS,
        {"winks.lrp": FASTER},
        answer["sha256"],
    )
    assert [one["file"] for one in program["graph"]] == ["", "winks.lrp"]
    browser.send("edit", number=2, text=WINKS, base_sha256=sha256, file="winks.lrp")
    winking.until(0.2)
    stale = browser.newest("edited")
    assert (stale["is_stale"], stale["text"], stale["files"]) == (True, WITH_WINKS, {"winks.lrp": FASTER})
    browser.send("do", what="undo")
    winking.until(0.3)
    undone = browser.newest("edited")
    assert (undone["ok"], undone["files"], undone["sha256"]) == (True, {"winks.lrp": WINKS}, sha256)
    assert winking.node.components["diver"].interpreter.program.files == {"winks.lrp": WINKS}


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (WINKS.replace("-> shut", "-> shutt"), 3, "There is no state 'shutt' here."),
        (WINKS.replace("(export winks)", ""), 0, "There is no machine 'winks' here."),
    ],
)
def test_mistake_in_an_imported_file_has_its_line_there(winking: Live, text: str, line: int, message: str) -> None:
    browser = winking.browser()
    browser.send("edit", number=1, text=text, base_sha256=browser.newest("hello")["sha256"], file="winks.lrp")
    (problem,) = browser.newest("edited")["problems"]
    assert (problem["line"], problem["message"]) == (line, message)
    assert not winking.node.inbox.waiting


def test_edit_of_a_file_that_is_not_imported_is_refused(winking: Live) -> None:
    browser = winking.browser()
    browser.send("edit", number=1, text=WINKS, base_sha256=SHA, file="wink.lrp")
    assert "imports no file 'wink.lrp'.\n  Try: did you mean 'winks.lrp'?" in browser.newest("refused")["reason"]


def test_edit_that_is_tried_is_checked_and_does_not_enter_the_node(live: Live) -> None:
    browser = live.browser()
    for number, text in enumerate(
        (with_push(9), f"(var unused := [1])\n{DIVER}", DIVER.replace("-> rising)", "-> risin)"))
    ):
        browser.send("edit", number=number, text=text, base_sha256=SHA, is_tried=True)
    assert not live.node.inbox.waiting
    answers = browser.of("edited")
    assert [(one["number"], one["ok"], one["program"]) for one in answers] == [
        (0, False, 1),
        (1, False, 1),
        (2, False, 1),
    ]
    assert [[row["is_error"] for row in one["problems"]] for one in answers] == [[], [False], [True]]


def test_edit_from_elsewhere_is_shown() -> None:
    live = Live(*parts(event_at(0.5, "diver.edit", with_push(9))))
    browser = live.browser()
    live.until(0.6)
    assert (browser.newest("program")["by"], browser.newest("program")["t_s"]) == ("elsewhere", 0.5)
    assert browser.of("edited") == []


def test_guarded_edit_that_fails_is_undone_and_shown() -> None:
    factories = parts()
    guard_edits(Config(factories={"r": factories}), 3.0)
    live = Live(*factories)
    browser = live.browser()
    live.until(0.5)
    edit(browser, 1, DIVER.replace("start(push)", "start(push / 0)"))
    live.until(0.6)
    live.until(1.2)
    assert [(one["number"], one["by"]) for one in browser.of("program")] == [(2, "page"), (3, "elsewhere")]
    assert browser.newest("program")["text"] == DIVER
    assert browser.newest("edited")["ok"]


def test_undo_goes_back_one_edit_each_time(live: Live) -> None:
    browser = live.browser()
    sha = SHA
    for i, newtons in enumerate((7, 9)):
        edit(browser, i, with_push(newtons), sha)
        live.tick()
        sha = browser.newest("edited")["sha256"]
    texts = []
    for _ in range(2):
        browser.send("do", what="undo")
        live.tick()
        answer = browser.newest("edited")
        assert (answer["ok"], answer["number"]) == (True, None)
        texts.append(answer["text"])
    assert texts == [with_push(7), DIVER]
    assert live.machine.newest().variables == {"push": 5}
    browser.send("do", what="undo")
    assert "no edit to undo" in browser.newest("refused")["reason"]


def test_deleted_program_stops_and_can_be_undone(live: Live) -> None:
    browser = live.browser()
    live.until(1.2)
    edit(browser, 1, "")
    live.tick()
    assert browser.newest("state")["active"] == {}
    assert live.node.get_data("thrust") == {"up_n": 0.0}
    browser.send("do", what="undo")
    live.tick()
    assert browser.newest("state")["active"] == {"diver": "sinking"}


def test_old_programs_are_forgotten(live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_machine, "MAX_PROGRAMS", 3)
    browser, sha = live.browser(), SHA
    for i in range(6):
        edit(browser, i, with_push(10 + i), sha)
        live.tick()
        sha = browser.newest("edited")["sha256"]
    assert [live.machine.program(number) is not None for number in (1, 4, 5, 7)] == [False, False, True, True]


# -- variables, buttons, signals --------------------------------------------------------------------------------------


def test_variable_is_set_and_used(live: Live) -> None:
    browser = live.browser()
    browser.send("set", path="push", value=12.5)
    live.tick()
    assert browser.newest("state")["variables"] == {"push": 12.5}
    live.until(1.2)
    assert live.node.get_data("thrust") == {"up_n": 12.5}


def test_unknown_variable_is_refused_with_a_suggestion(live: Live) -> None:
    browser = live.browser()
    browser.send("set", path="pusch", value=1)
    assert not live.node.inbox.waiting
    refused = browser.newest("refused")
    assert refused["message"] == "set"
    assert "There is no variable 'pusch'." in refused["reason"]
    assert "'push'" in refused["reason"]


def test_pause_stops_the_robot_and_go_continues(live: Live) -> None:
    browser = live.browser()
    live.until(1.2)
    browser.send("do", what="pause")
    live.until(2.0)
    state = browser.newest("state")
    assert (state["is_paused"], state["active"]) == (True, {"diver": "rising"})
    assert live.node.get_data("thrust") == {"up_n": 0.0}
    browser.send("do", what="go")
    live.tick()
    assert not browser.newest("state")["is_paused"]
    assert live.node.get_data("thrust") == {"up_n": 5.0}


def test_single_steps_advance_a_paused_machine_by_10_ms(live: Live) -> None:
    browser = live.browser()
    live.until(1.2)
    browser.send("do", what="pause")
    live.tick()
    for _ in range(19):
        browser.send("do", what="step")
        live.tick()
    assert browser.newest("state")["active"] == {"diver": "rising"}  # since 1.1 s; its time is 1.39 s
    browser.send("do", what="step")
    live.tick()
    assert browser.newest("state")["active"] == {"diver": "sinking"}
    assert live.node.get_data("thrust") == {"up_n": 0.0}


def test_command_of_a_single_step_is_given_by_go() -> None:
    text = DIVER.replace(
        "(state sinking (onentry [robot.up.start(0)]))", "(state sinking (onentry [robot.up.start(-3)]))"
    )
    live = Live(*parts()[:1], *machine_parts(parse(text, BRIDGE.parts), "diver", bridge=BRIDGE))
    browser = live.browser()
    live.until(1.2)
    browser.send("do", what="pause")
    live.tick()
    for _ in range(20):
        browser.send("do", what="step")
    live.tick()
    assert (browser.newest("state")["active"], live.node.get_data("thrust")) == ({"diver": "sinking"}, {"up_n": 0.0})
    browser.send("do", what="go")
    live.tick()
    assert live.node.get_data("thrust") == {"up_n": -3.0}


def test_step_of_a_running_machine_is_refused(live: Live) -> None:
    browser = live.browser()
    browser.send("do", what="step")
    assert "while the machine is paused" in browser.newest("refused")["reason"]
    assert not live.node.inbox.waiting


def test_signal_is_given_and_an_unknown_one_is_refused(live: Live) -> None:
    browser = live.browser()
    live.until(1.2)
    browser.send("give", signal="halt")
    live.tick()
    assert browser.newest("state")["active"] == {"diver": "sinking"}
    browser.send("give", signal="terminate")
    assert "No transition waits for a signal 'terminate'." in browser.newest("refused")["reason"]
    assert not live.node.inbox.waiting
