"""Programs of several files: imports, exports, actions; rules that always hold, and breaks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from snr_sim import Config, Node, SimClock, TimeoutLoopFactory, tasks
from snr_sim.behaviors import (
    Bridge,
    Drive,
    Interpreter,
    MachineFactory,
    Program,
    ProgramError,
    Read,
    action,
    language,
    machine_parts,
    parse,
)
from snr_sim.behaviors.imports import actions_of, why_not
from snr_sim.core.lockstep import LockStep
from snr_sim.core.reload.watch import WatchLoopFactory
from snr_sim.prelude.errors import ConfigError
from snr_sim.scenario.library import load_program
from snr_sim.scenario.machine_controller import read_program

LIBRARY = """(var limit := [3])
(var hidden := [7])
(def twice x [2 * x])
(machine counter
  (var n := [0])
  (state counting (running [n = n + twice(1)]))
  (state full (onentry [log(f"full at {n}, hidden {hidden}")]))
  (on [n >= limit * 2] counting -> full))
(export counter) (export limit) (export twice)
"""
MAIN = """(import "lib.lrp")
(var m := [twice(limit)])
(machine main (state on (machine counter2 (state a)) (onentry (spawn counter counting))))
(spawn main on)
"""
FILES = {"lib.lrp": LIBRARY}


def test_exported_forms_are_used_as_own_ones() -> None:
    program = parse(MAIN, files=FILES)
    assert program.files == FILES
    machine = Interpreter(program)
    machine.spawn(0)
    for i in range(1, 6):
        machine.step(i)
    assert machine.active == {"main": "on", "main/on/counter": "full"}
    assert machine.context.logged == [] or "full at 6" in machine.context.logged[0]
    assert machine.variables["m"] == 6
    assert machine.variables["lib:limit"] == 3
    assert machine.variables["lib:hidden"] == 7


def test_text_of_import_counts_in_the_digest() -> None:
    other = {"lib.lrp": LIBRARY.replace("[3]", "[4]")}
    assert parse(MAIN, files=FILES).sha256 != parse(MAIN, files=other).sha256
    assert parse("(machine m (state a))(spawn m a)", files=FILES).files == {}, "a file that is not imported"


@pytest.mark.parametrize(
    ("main", "files", "message"),
    [
        (MAIN, {}, "There is no file 'lib.lrp' in the folder of the program."),
        (MAIN.replace("lib.lrp", "../lib.lrp"), FILES, "it leaves the folder"),
        (MAIN.replace("lib.lrp", "/lib.lrp"), FILES, "it leaves the folder"),
        (MAIN.replace("lib.lrp", "lib.py"), FILES, "it is not a .lrp file"),
        (MAIN.replace('"lib.lrp"', "lib"), FILES, "(import ...) is not complete"),
        (MAIN, {"lib.lrp": LIBRARY.replace("full)", "ful)")}, "lib.lrp:8:36: There is no state 'ful' here."),
        (MAIN, {"lib.lrp": LIBRARY + "(export nothing)"}, "There is no 'nothing' to export."),
        (MAIN, {"lib.lrp": LIBRARY.replace("(export twice)", "")}, "'twice' cannot be called."),
        (MAIN, {"lib.lrp": LIBRARY + '(import "lib.lrp")'}, "'lib.lrp' imports itself."),
        (MAIN, {"lib.lrp": "(machine"}, "lib.lrp:1:1: '(' is not closed."),
        ('(actions "moves.py")' + MAIN, FILES, "There are no actions of 'moves.py'."),
        ('(actions "moves.lrp")' + MAIN, FILES, "it is not a .py file"),
    ],
)
def test_wrong_import_is_explained(main: str, files: dict[str, str], message: str) -> None:
    with pytest.raises(ProgramError) as caught:
        parse(main, files=files)
    assert message in " ".join(one.message for one in caught.value.problems)


@pytest.mark.parametrize("name", ["..", "a/../b.lrp", "/etc/x.lrp", "C:x.lrp", "a\\b.lrp", "x.txt", ".lrp", ""])
def test_names_that_leave_the_folder_are_refused(name: str) -> None:
    assert why_not(name, ".lrp")
    assert not why_not("parts/x.lrp", ".lrp")


@action
def next_turn(left_cm: float, right_cm: float) -> float:
    return 90.0 if left_cm > right_cm else -90.0


def unmarked() -> None:
    """Not for programs."""


ACTIONS = {"moves.py": actions_of({"next_turn": next_turn, "unmarked": unmarked})}
WITH_ACTION = """(actions "moves.py")
(var turn := [next_turn(1, 2)])
(machine m (state a (running [turn = next_turn(20, 10) + turn])))
(spawn m a)
"""


def test_actions_are_called_with_values() -> None:
    machine = Interpreter(parse(WITH_ACTION, actions=ACTIONS))
    machine.spawn(0)
    machine.step(1)
    assert machine.variables["turn"] == 0.0
    with pytest.raises(ProgramError, match="'unmarked' cannot be called"):
        parse(WITH_ACTION.replace("next_turn(20, 10)", "unmarked()"), actions=ACTIONS)
    with pytest.raises(ProgramError, match="cannot be assigned"):
        parse(WITH_ACTION.replace("turn = next_turn(20, 10)", "next_turn = 1"), actions=ACTIONS)
    with pytest.raises(ProgramError, match="must be called"):
        parse(WITH_ACTION.replace("next_turn(20, 10)", "next_turn"), actions=ACTIONS)


def test_action_that_fails_is_a_problem_of_its_block() -> None:
    machine = Interpreter(parse(WITH_ACTION.replace("next_turn(20, 10)", "next_turn(20)"), actions=ACTIONS))
    machine.spawn(0)
    machine.step(1)
    (problem,) = machine.problems.values()
    assert "TypeError" in problem.message
    assert machine.variables["turn"] == -90.0


def test_files_in_the_folder_of_the_program_are_read(tmp_path: Path) -> None:
    (tmp_path / "main.lrp").write_text('(import "lib.lrp")(actions "moves.py")\n' + MAIN.partition("\n")[2])
    (tmp_path / "lib.lrp").write_text('(import "deep/base.lrp")(export limit)\n' + LIBRARY)
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "base.lrp").write_text("(var unused := [1])")
    (tmp_path / "moves.py").write_text(
        "from snr_sim.behaviors import action\n\n\n@action\ndef turn():\n    return 1\n\n\ndef other():\n    return 2\n"
    )
    program = read_program(tmp_path / "main.lrp", load_program)
    assert sorted(program.files) == ["deep/base.lrp", "lib.lrp"]
    assert list(program.actions["moves.py"]) == ["turn"]
    (tmp_path / "lib.lrp").write_bytes(b"\xff")
    with pytest.raises(ConfigError, match=r"lib\.lrp, line 1: byte 0xff is not text"):
        read_program(tmp_path / "main.lrp", load_program)


# -- rules ------------------------------------------------------------------------------------------------------------

RULES = """(var n := [0])
(always small [n < 3])
(break two [n > 1])
(machine m
  (state one (running [n = n + 1]))
  (state two)
  (on [n >= 5] one -> two)
  (ontime 1000 two -> one))
(spawn m one)
"""


def test_two_rules_in_one_line_are_both_noted() -> None:
    interpreter = Interpreter(parse("(machine m (state a))(always one [1 > 2])(always two [1 > 3])(spawn m a)"))
    interpreter.spawn(0)
    interpreter.step(1)
    assert {(block, one.count) for (_, block), one in interpreter.problems.items()} == {("one", 1), ("two", 1)}


def test_rule_that_does_not_hold_is_noted_once_each_time_that_it_begins() -> None:
    machine = Interpreter(parse(RULES))
    machine.spawn(0)
    for i in range(1, 5):
        machine.step(i)
    (problem,) = machine.problems.values()
    assert (problem.block, problem.count, problem.t_ns) == ("small", 1, 3)
    machine.set("n", 0)
    machine.step(5)
    machine.set("n", 4)
    machine.step(6)
    assert problem.count == 2


def test_break_names_its_line_when_its_state_is_entered() -> None:
    machine = Interpreter(parse(RULES))
    machine.spawn(0)
    found = []
    for i in range(1, 9):
        machine.step(i)
        found.append(list(machine.breaks))
    assert found == [[], [], [], [], [], [3], [], []]


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        ("(break thre)", "There is no state 'thre' here."),
        ("(break)", "(break ...) is not complete"),
        ("(always x)", "(always ...) is not complete"),
        ("(always [n <])", "Python"),
        ("(break two [n] [n])", "(break ...) is not complete"),
    ],
)
def test_wrong_rule_is_explained(rule: str, message: str) -> None:
    with pytest.raises(ProgramError) as caught:
        parse(RULES + rule)
    assert message in " ".join(one.message for one in caught.value.problems)


def test_break_pauses_machine_by_an_event_and_go_continues() -> None:
    bridge = Bridge({"depth": Read("depth", "depth_m")}, {"up": Drive("thrust", "up_n", -50.0, 50.0)})
    text = """(break rising)
(machine diver (state down (onentry [robot.up.start(-5)])) (state rising (onentry [robot.up.start(5)]))
  (ontime 500 down -> rising) (ontime 500 rising -> down))
(spawn diver down)
"""
    parts = machine_parts(parse(text, bridge.parts), "diver", bridge=bridge)
    go = TimeoutLoopFactory(2.0, task=tasks.event("diver.go"), name="go")
    clock = SimClock()
    node = Node("r", Config(factories={"r": [*parts, go]}), clock=clock)
    LockStep([node], clock, until_s=1.0).run()
    assert node.get_data("diver")["is_paused"]
    assert node.get_data("thrust") == {"up_n": 0.0}
    clock = SimClock()
    node = Node(
        "r",
        Config(factories={"r": [*machine_parts(parse(text, bridge.parts), "diver", bridge=bridge), go]}),
        clock=clock,
    )
    LockStep([node], clock, until_s=2.3).run()
    assert not node.get_data("diver")["is_paused"]
    assert node.get_data("thrust") == {"up_n": 5.0}


# -- edits of files ---------------------------------------------------------------------------------------------------


def edited(*events: tuple[str, list[Any]]) -> Node:
    program = parse(MAIN, files=FILES)
    at = [
        TimeoutLoopFactory(0.105 + 0.1 * i, task=tasks.event(name, values), name=f"edit {i}")
        for i, (name, values) in enumerate(events)
    ]
    clock = SimClock()
    parts = machine_parts(program, "m", step_hz=10.0, path=Path("/nowhere/main.lrp"))
    node = Node("r", Config(factories={"r": [*parts, *at]}), clock=clock)
    LockStep([node], clock, until_s=1.0).run()
    return node


def test_helper_sees_what_is_declared_where_it_stands() -> None:
    """Also a helper and an action that its file does not export, and not one of the same name where it is called."""
    inner = '(actions "b.py")(def half x [act(x) / 2])(def quarter x [half(x) / 2])(export quarter)'
    text = """(import "lib.lrp") (actions "a.py") (var y := [0])
(def half x [act(x)]) (def both x [half(x) + quarter(x)])
(machine m (def half x [both(x) + 1000]) (state s (running [y = half(8)]))) (spawn m s)"""
    actions = {"a.py": {"act": lambda x: 100 * x}, "b.py": {"act": lambda x: 10 * x}}
    interpreter = Interpreter(parse(text, files={"lib.lrp": inner}, actions=actions))
    interpreter.spawn(0)
    interpreter.step(1)
    assert (interpreter.variables["y"], interpreter.problems) == (1820.0, {})


def test_file_is_edited_without_the_program() -> None:
    more = LIBRARY.replace("twice x [2 * x]", "twice x [10 * x]")
    node = edited(("m.edit_file", [more, "lib.lrp"]))
    assert node.get_data("m.edited")["ok"]
    assert node.get_data("m")["variables"]["main/on/counter.n"] >= 10
    node = edited(("m.edit_file", [more, "other.lrp"]))
    assert "imports no file 'other.lrp'" in node.get_data("m.edited")["problems"][0]["message"]
    node = edited(("m.edit", [MAIN + "; more"]))
    assert node.get_data("m.edited")["ok"], "imports are known from before"
    node = edited(("m.edit", [MAIN, "", {"lib.lrp": "(machine"}]))
    assert not node.get_data("m.edited")["ok"]
    node = edited(("m.edit", [MAIN, "", ["lib.lrp"]]))
    assert "not text" in node.get_data("m.edited")["problems"][0]["message"]


def test_imported_files_are_watched() -> None:
    clock = SimClock()
    factory = MachineFactory(parse(MAIN, files=FILES), "m", path=Path("/x/main.lrp"))
    node = Node("r", Config(factories={"r": [factory]}), clock=clock)
    component: Any = node.components["m"]
    assert set(component.watched_files) == {Path("/x/main.lrp"), Path("/x/lib.lrp")}


def watched(folder: Path, program: Program, *saves: tuple[str, str]) -> tuple[list[Any], Node]:
    """Run a program whose files are saved, one each second; return what each was answered, and the node."""
    answers: list[Any] = []
    clock = SimClock()
    parts = [*machine_parts(program, "m", step_hz=10.0, path=folder / "main.lrp"), WatchLoopFactory(rate_hz=10.0)]
    node = Node("r", Config(factories={"r": parts}), clock=clock)
    node.add_store_listener("m.edited", lambda page: answers.append(page.data))
    for i, (name, text) in enumerate(saves, 1):
        clock.call_at(float(i), lambda name=name, text=text: (folder / name).write_text(text) and None)  # type: ignore[misc]
    LockStep([node], clock, until_s=len(saves) + 1.0).run()
    return answers, node


def test_import_that_is_added_removed_and_added_again_is_found(tmp_path: Path) -> None:
    alone = "(machine main (state on))(spawn main on)"
    (tmp_path / "main.lrp").write_text(alone)
    more = LIBRARY.replace("twice x [2 * x]", "twice x [10 * x]")
    saves = [("main.lrp", MAIN), ("lib.lrp", LIBRARY), ("main.lrp", alone), ("main.lrp", MAIN), ("lib.lrp", more)]
    answers, node = watched(tmp_path, parse(alone), *saves, ("main.lrp", ""))
    assert [one["ok"] for one in answers] == [False, True, True, True, True, True]
    assert answers[0]["problems"][0]["message"] == "There is no file 'lib.lrp' in the folder of the program."
    assert node.get_data("m")["active"] == {}, "an empty text is one, too"


def test_text_that_is_saved_is_parsed_by_the_sender(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "main.lrp").write_text(MAIN)
    (tmp_path / "lib.lrp").write_text(LIBRARY)
    component: Any = watched(tmp_path, parse(MAIN, files=FILES))[1].components["m"]
    (tmp_path / "main.lrp").write_text(MAIN + "; saved by the test of the sender")
    task = component.watched_files[tmp_path / "main.lrp"]()
    monkeypatch.setattr(language, "read", None)  # whatever parses now fails
    assert component.on_edit(task, (task.type, task.name))[-1].val_list[0].data["ok"]


def test_changed_file_of_actions_is_answered(tmp_path: Path) -> None:
    (tmp_path / "main.lrp").write_text("")
    (tmp_path / "moves.py").write_text("x = 1")
    program = parse('(actions "moves.py")(machine m (state a))(spawn m a)', actions={"moves.py": {}})
    answers, _ = watched(tmp_path, program, ("moves.py", "x = 2"))
    assert "they count from the next start" in answers[0]["problems"][0]["message"]
