"""Live edits: what happens to states, times, variables and commands for every kind of change of a running program."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.behaviors import Bridge, Drive, Interpreter, Program, Read, parse
from snr_sim.behaviors.export import as_text
from snr_sim.behaviors.program import Block, MachineDef, Place, Rule, Spawn
from tests.behaviors.programs import programs, steps

MS = 1_000_000
BRIDGE = Bridge(
    {"range": Read("range")},
    {"left": Drive("motors", "left", -100.0, 100.0), "right": Drive("motors", "right", -100.0, 100.0)},
)
EXPLORER = """
(var speed := [40])
(machine dora
  (var turns := [0])
  (event wall [robot.range.read() < 20])
  (state ahead (onentry [robot.left.start(speed); robot.right.start(speed)]))
  (state looking
    (onentry [robot.left.stop(); robot.right.stop()])
    (onexit [turns = turns + 1])
    (machine nod
      (var nods := [0])
      (state up (onexit [nods = nods + 1]))
      (state down)
      (ontime 100 up -> down)
      (ontime 100 down -> up))
    (onentry (spawn nod up)))
  (on wall ahead -> looking)
  (ontime 1000 looking -> ahead))
(machine lamp (state on (onentry [log("on")])))
(spawn dora ahead)
(spawn lamp on)
"""


def edited(text: str, old: str, new: str) -> str:
    assert text.count(old) == 1, old
    return text.replace(old, new)


def looking(text: str = EXPLORER) -> tuple[Interpreter, dict[str, Any]]:
    """Return an explorer that has been looking since 10 ms, at 250 ms: nod is up again, since 210 ms."""
    pages: dict[str, Any] = {"range": 10.0}
    interpreter = Interpreter(parse(text, BRIDGE.parts), pages, bridge=BRIDGE)
    interpreter.spawn(0)
    for ms in (10, 110, 210, 250):
        interpreter.step(ms * MS)
    commands(interpreter)
    assert {"dora": "looking", "dora/looking/nod": "up", "lamp": "on"}.items() <= interpreter.active.items()
    assert {"dora": 10 * MS, "dora/looking/nod": 210 * MS, "lamp": 0}.items() <= interpreter.since_ns.items()
    return interpreter, pages


def commands(interpreter: Interpreter) -> list[Any]:
    assert interpreter.robot is not None
    return [task.val_list[0].data for task in interpreter.robot.take_tasks()]


def edit(interpreter: Interpreter, text: str, at_ms: int = 260) -> tuple[Any, list[tuple[str, str, str, str]]]:
    found, changes = interpreter.edit(parse(text, BRIDGE.parts), at_ms * MS)
    return found, [(one.machine, one.kind, one.source, one.target) for one in changes]


KEPT = {"dora": "looking", "dora/looking/nod": "up", "lamp": "on"}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("(machine lamp", "; a remark\n\n(machine lamp"),
        ("[turns = turns + 1]", "[turns = turns + 100]"),
        ("[robot.left.start(speed); robot.right.start(speed)]", "[robot.left.start(5)]"),
        ("robot.range.read() < 20", "robot.range.read() < 30"),
        ("(ontime 1000 looking -> ahead)", "(ontime 5000 looking -> ahead)"),
        ("(on wall ahead -> looking)", "(on wall ahead -> looking)(event go)(on go looking -> ahead)"),
        ("(on wall ahead -> looking)", ""),
        ("(state looking", "(state elsewhere)\n  (state looking"),
        ("(state ahead", "(state ahead (machine extra (state x)) (onentry (spawn extra x))"),
        ("(var speed := [40])", "(var speed := [40])(var more := [7])"),
        ("(machine lamp", "(machine never (state s))\n(machine lamp"),
    ],
)
def test_edit_that_leaves_the_active_states_keeps_them_and_their_times(old: str, new: str) -> None:
    interpreter, _ = looking()
    interpreter.set("speed", 66)
    found, changes = edit(interpreter, edited(EXPLORER, old, new))
    assert changes == []
    assert (found.restarted, found.stopped) == ([], [])
    assert interpreter.active == KEPT
    assert {"dora": 10 * MS, "dora/looking/nod": 210 * MS, "lamp": 0}.items() <= interpreter.since_ns.items()
    kept = {"speed": 66, "dora.turns": 0, "dora/looking/nod.nods": 1}
    assert kept.items() <= interpreter.variables.items()
    assert commands(interpreter) == []


def test_new_code_counts_from_the_next_step_and_entry_blocks_are_not_run_again() -> None:
    interpreter, _ = looking()
    text = edited(EXPLORER, "[turns = turns + 1]", "[turns = turns + 100]")
    edit(interpreter, edited(text, "(onentry [robot.left.stop(); robot.right.stop()])", "(onentry [turns = -5])"))
    assert interpreter.variables["dora.turns"] == 0
    interpreter.step(1010 * MS)
    assert interpreter.variables["dora.turns"] == 100


def test_time_out_that_is_made_shorter_is_due_at_once() -> None:
    interpreter, _ = looking()
    edit(interpreter, edited(EXPLORER, "(ontime 1000", "(ontime 200"))
    (change,) = interpreter.step(261 * MS)
    assert (change.target, change.held_ns) == ("ahead", 251 * MS)


def test_transition_that_is_moved_before_another_is_tried_first() -> None:
    interpreter, _ = looking()
    text = edited(EXPLORER, "(on wall ahead -> looking)", "(on wall ahead -> looking)(on wall looking -> looking)")
    edit(interpreter, text)
    assert interpreter.step(261 * MS)[0].target == "looking"


def test_new_variable_gets_its_initial_value_and_a_removed_one_goes() -> None:
    interpreter, _ = looking()
    text = edited(EXPLORER, "(var turns := [0])", "(var count := [3])")
    edit(interpreter, edited(text, "[turns = turns + 1]", "[count = count + 1]"))
    assert interpreter.variables == {"speed": 40, "dora.count": 3, "dora/looking/nod.nods": 1}


def test_variable_whose_initial_value_is_changed_begins_with_it() -> None:
    interpreter, _ = looking()
    interpreter.set("speed", 66)
    found, _ = edit(interpreter, edited(EXPLORER, "(var speed := [40])", "(var speed := [50])"))
    assert interpreter.variables["speed"] == 50
    assert found.notes == ["'speed' was 66, and begins with its new initial value."]
    assert commands(interpreter) == []


def test_active_state_that_is_removed_is_left_and_the_machine_restarts() -> None:
    interpreter, _ = looking()
    text = EXPLORER.replace("(on wall ahead -> looking)", "").replace("(ontime 1000 looking -> ahead)", "")
    i, j = text.index("(state looking"), text.index("(machine lamp")
    found, changes = edit(interpreter, text[:i] + ")\n" + text[j:])
    assert changes == [("dora", "edit", "looking", "ahead")]
    assert interpreter.active == {"dora": "ahead", "lamp": "on"}
    assert interpreter.since_ns["dora"] == 260 * MS
    assert found.restarted == ["dora"]
    assert found.notes == ["State 'looking' of 'dora' has gone: it begins in 'ahead'."]
    assert interpreter.variables["dora.turns"] == 1  # its exit block was executed
    assert commands(interpreter) == [{"left": 40.0, "right": 40.0}]


def test_active_state_that_is_renamed_is_kept_with_its_time_and_what_is_inside() -> None:
    interpreter, _ = looking()
    found, changes = edit(interpreter, EXPLORER.replace("looking", "searching"))
    assert changes == []
    assert interpreter.active == {"dora": "searching", "dora/searching/nod": "up", "lamp": "on"}
    assert interpreter.since_ns["dora/searching/nod"] == 210 * MS
    assert interpreter.variables["dora/searching/nod.nods"] == 1
    assert found.kept == ["dora", "dora/searching/nod", "lamp"]


def test_machine_inside_the_active_state_that_is_removed_is_left_and_the_state_stays() -> None:
    interpreter, _ = looking()
    i, j = EXPLORER.index("    (machine nod"), EXPLORER.index("  (on wall")
    found, changes = edit(interpreter, EXPLORER[:i] + "  )\n" + EXPLORER[j:])
    assert changes == [("dora/looking/nod", "stop", "up", "")]
    assert interpreter.active == {"dora": "looking", "lamp": "on"}
    assert found.stopped == ["dora/looking/nod"]


def test_machine_that_is_added_to_the_active_state_waits_for_its_next_entry() -> None:
    interpreter, _ = looking()
    text = edited(EXPLORER, "(onentry (spawn nod up))", "(onentry (spawn nod up)) (onentry (spawn nod down))")
    found, changes = edit(interpreter, text)
    assert changes == []
    assert found.notes == ["'dora/looking/nod#2' is spawned at the next entry of 'looking'."]


def test_machine_that_is_no_longer_spawned_stops_and_its_motors_too() -> None:
    interpreter, _ = looking()
    interpreter.step(1010 * MS)
    assert commands(interpreter) == [{"left": 40.0, "right": 40.0}]
    found, changes = edit(interpreter, edited(EXPLORER, "(spawn dora ahead)", ""), 1020)
    assert changes == [("dora", "stop", "ahead", "")]
    assert found.stopped == ["dora"]
    assert commands(interpreter) == [{"left": 0.0, "right": 0.0}]


def test_motor_that_another_machine_commands_is_not_stopped() -> None:
    text = EXPLORER + "(machine helm (state s (running [robot.right.start(7)])))(spawn helm s)"
    interpreter, _ = looking(text)
    interpreter.step(1010 * MS)
    commands(interpreter)
    edit(interpreter, edited(text, "(spawn dora ahead)", ""), 1020)
    assert commands(interpreter) == [{"left": 0.0, "right": 7.0}]


def test_spawn_that_is_added_enters_at_once() -> None:
    interpreter, _ = looking()
    text = EXPLORER + "(machine horn (state silent (onentry [robot.left.start(9)])))(spawn horn silent)"
    _, changes = edit(interpreter, text)
    assert changes == [("horn", "spawn", "", "silent")]
    assert commands(interpreter) == [{"left": 9.0, "right": 0.0}]


def test_changed_initial_state_counts_at_the_next_spawn() -> None:
    interpreter, _ = looking()
    _, changes = edit(interpreter, edited(EXPLORER, "(spawn dora ahead)", "(spawn dora looking)"))
    assert changes == []
    assert interpreter.active == KEPT


def test_everything_deleted_stops_the_robot_and_a_later_program_begins_new() -> None:
    interpreter, _ = looking()
    interpreter.step(1010 * MS)
    commands(interpreter)
    found, changes = edit(interpreter, "; nothing", 1020)
    assert [kind for _, kind, _, _ in changes] == ["stop", "stop"]
    assert interpreter.active == interpreter.variables == {}
    assert commands(interpreter) == [{"left": 0.0, "right": 0.0}]
    assert found.stopped == ["dora", "lamp"]
    _, changes = edit(interpreter, EXPLORER, 1030)
    assert interpreter.active == {"dora": "ahead", "lamp": "on"}
    assert interpreter.variables["dora.turns"] == 0


def test_variables_deep_in_inactive_states_are_kept_in_a_state_that_is_renamed() -> None:
    deep = "(state down (machine deep (var d := [0]) (state s)) (onentry (spawn deep s)))"
    text = edited(EXPLORER, "(state down)", deep)
    interpreter, _ = looking(text)
    interpreter.set("dora/looking/nod/down/deep.d", 7)
    found, _ = edit(interpreter, text.replace("looking", "searching"))
    assert found.notes == []
    assert interpreter.variables["dora/searching/nod/down/deep.d"] == 7


def test_problems_of_a_block_that_was_repaired_are_past() -> None:
    interpreter, _ = looking(EXPLORER.replace("[turns = turns + 1]", "[turns = 1 / 0]"))
    interpreter.step(1010 * MS)
    assert [one.block for one in interpreter.problems.values()] == ["turns = 1 / 0"]
    edit(interpreter, EXPLORER, 1020)
    assert interpreter.problems == {}
    assert [one.count for one in interpreter.past_problems.values()] == [1]


# -- random edits -----------------------------------------------------------------------------------------------------


def fail(m: Any) -> None:
    raise ValueError("planted")


BLOCKS = st.sampled_from([(), (), (Block("fail", Place(), lambda bindings: fail),)])


def failing(draw: Any, spawn: Spawn) -> Spawn:
    """Return a machine some of whose blocks raise, and of those inside it."""
    states = [
        replace(
            one,
            enter=(*(failing(draw, inner) for inner in one.spawns), *draw(BLOCKS)),
            during=draw(BLOCKS),
            leave=draw(BLOCKS),
        )
        for one in spawn.machine.states
    ]
    return replace(spawn, machine=replace(spawn.machine, states=tuple(states)))


def changed_program(draw: Any, program: Program) -> Program:
    """Return the program with one element of its first machine changed."""
    first = program.spawns[0]
    machine = first.machine
    how = draw(st.sampled_from(["same", "arrow", "state", "initial", "other", "gone", "none"]))
    if how == "none" or (how == "gone" and len(machine.states) == 1):
        return replace(program, sha256="none", spawns=program.spawns[1:])
    if how == "gone":
        states = tuple(replace(one, enter=()) for one in machine.states[1:])  # what is inside may exit to the one gone
        kept = {one.name for one in states}
        arrows = [one for one in machine.transitions if one.target in kept or one.kind == "exit"]
        machine = replace(machine, states=states, transitions=tuple(arrows))
        first = Spawn(machine, states[0].name)
    if how == "arrow" and machine.transitions:
        machine = replace(machine, transitions=machine.transitions[1:])
    elif how == "state":
        machine = replace(machine, states=(*machine.states, replace(machine.states[0], name="extra")))
    elif how == "other":
        machine = MachineDef("other", machine.states, machine.transitions)
    initial = machine.states[-1].name if how == "initial" else first.initial
    spawns = (Spawn(machine, initial), *program.spawns[1:])
    text = as_text(spawns)
    return replace(program, text=text, sha256=hashlib.sha256(text.encode()).hexdigest(), spawns=spawns)


@given(programs(), st.lists(steps, max_size=15), st.lists(steps, max_size=10), st.data())
def test_edit_keeps_every_machine_that_both_programs_have(
    program: Program, before: list[Any], later: list[Any], data: Any
) -> None:
    pages: dict[str, Any] = {"holding": set()}
    interpreter = Interpreter(program, pages)
    interpreter.spawn(0)
    now_ns = 0
    for passed_ns, pages["holding"], signal in before:
        now_ns += passed_ns
        interpreter.step(now_ns, signal)
    was, since = interpreter.active, interpreter.since_ns
    other = changed_program(data.draw, program)
    found, _ = interpreter.edit(other, now_ns)
    for path in found.kept:
        assert (interpreter.active[path], interpreter.since_ns[path]) == (was[path], since[path])
    if other.sha256 == program.sha256:
        assert (interpreter.active, interpreter.since_ns) == (was, since)
    for passed_ns, pages["holding"], signal in later:
        now_ns += passed_ns
        interpreter.step(now_ns, signal)
        for path in interpreter.active:
            if "/" in path:
                above, _, place = path.rpartition("/")[0].rpartition("/")
                assert interpreter.active[above] == place


@given(programs(), st.lists(st.one_of(steps, st.just(None)), max_size=15), st.data())
def test_edits_of_machines_that_stop_at_errors_leave_only_whole_machines(
    program: Program, history: list[Any], data: Any
) -> None:
    """At each None of the history the program is edited."""
    program = replace(program, on_error="stop", spawns=tuple(failing(data.draw, one) for one in program.spawns))
    rules = (Rule("always", "planted", Block("fail", Place(), lambda bindings: fail)),)
    pages: dict[str, Any] = {"holding": set()}
    interpreter, now_ns = Interpreter(replace(program, rules=rules), pages), 0
    interpreter.spawn(0)
    for row in (None, *history, None):
        if row is None:
            found, changes = interpreter.edit(changed_program(data.draw, program), now_ns)
            assert len({(one.machine, one.kind) for one in changes}) == len(changes), "none is left twice"
            assert not set(found.stopped) & set(found.kept)
        else:
            now_ns, pages["holding"] = now_ns + row[0], row[1]
            interpreter.step(now_ns, row[2])
        for path in interpreter.active:
            if "/" in path:
                above, _, place = path.rpartition("/")[0].rpartition("/")
                assert interpreter.active[above] == place


@given(programs(), st.lists(steps, max_size=10), st.lists(steps, max_size=10))
def test_edit_to_the_same_program_changes_nothing_that_follows(
    program: Program, before: list[Any], later: list[Any]
) -> None:
    pages: dict[str, Any] = {"holding": set()}
    one, two = Interpreter(program, pages), Interpreter(program, pages)
    now_ns = 0
    assert one.spawn(0) == two.spawn(0)
    for passed_ns, pages["holding"], signal in before:
        now_ns += passed_ns
        assert one.step(now_ns, signal) == two.step(now_ns, signal)
    assert two.edit(replace(program), now_ns)[1] == []
    for passed_ns, pages["holding"], signal in later:
        now_ns += passed_ns
        assert one.step(now_ns, signal) == two.step(now_ns, signal)
    # An edit begins to count the problems of blocks from 0, so that those which it repairs are over.
    after = [{key: value for key, value in of.snapshot().items() if key != "problems"} for of in (one, two)]
    assert after[0] == after[1]
