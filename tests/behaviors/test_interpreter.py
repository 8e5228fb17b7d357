"""The interpreter follows its rules: order, nesting, time-outs, signals, chains, errors; and a second one agrees."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.behaviors import (
    Bridge,
    Drive,
    FixedPages,
    Interpreter,
    Program,
    ProgramError,
    after,
    always,
    exits,
    machine,
    on,
    parse,
    side_by_side,
    state,
)
from snr_sim.prelude.errors import ConfigError, ParameterError, UnknownNameError
from tests.behaviors.programs import programs, steps
from tests.behaviors.reference_model import ReferenceModel

MS = 1_000_000


def holds(key: str) -> Any:
    return lambda m: m.data(key)


def started(program: Program, **pages: Any) -> tuple[Interpreter, dict[str, Any]]:
    interpreter = Interpreter(program, pages)
    interpreter.spawn(0)
    return interpreter, pages


def path_of(interpreter: Interpreter, name: str = "m") -> str:
    return interpreter.active[name]


# -- one machine ------------------------------------------------------------------------------------------------------


def test_first_transition_in_the_order_of_the_program_is_taken() -> None:
    program = machine("m", "a", [state("a", on(holds("x"), to="b"), on(holds("x"), to="c")), state("b"), state("c")])
    interpreter, _ = started(program, x=True)
    (change,) = interpreter.step(5)
    assert (change.kind, change.name, change.source, change.target, change.held_ns) == ("on", "a->b", "a", "b", 5)


def test_one_transition_in_a_step() -> None:
    program = machine("m", "a", [state("a", on(holds("x"), to="b")), state("b", on(holds("x"), to="a"))])
    interpreter, _ = started(program, x=True)
    assert [path_of(interpreter) for i in range(3) if interpreter.step(i)] == ["b", "a", "b"]


def test_time_out_is_due_at_its_nanosecond_and_not_before() -> None:
    interpreter, _ = started(machine("m", "a", [state("a", after(0.6, to="b")), state("b")]))
    assert interpreter.step(600 * MS - 1) == []
    assert interpreter.step(600 * MS)[0].kind == "ontime"


def test_leaving_a_state_cancels_its_time_out() -> None:
    program = machine(
        "m", "a", [state("a", after(0.1, to="late"), on("go", to="b")), state("b", on("back", to="a")), state("late")]
    )
    interpreter, _ = started(program)
    interpreter.step(90 * MS, "go")
    interpreter.step(95 * MS, "back")
    assert interpreter.step(194 * MS) == []
    assert interpreter.step(195 * MS)[0].target == "late"


def test_time_out_of_a_function_counts_from_the_entry_and_may_change() -> None:
    program = machine("m", "a", [state("a", after(lambda m: m.data("wait_s"), to="b")), state("b")])
    interpreter, pages = started(program, wait_s=9.0)
    assert interpreter.step(200 * MS) == []
    pages["wait_s"] = 0.1
    assert interpreter.step(200 * MS + 1)[0].held_ns == 200 * MS + 1


def test_time_out_with_a_condition_needs_both() -> None:
    program = machine("m", "a", [state("a", after(0.1, to="b", when=holds("x"))), state("b")])
    interpreter, pages = started(program, x=True)
    assert interpreter.step(99 * MS) == []
    pages["x"] = False
    assert interpreter.step(101 * MS) == []
    pages["x"] = True
    assert interpreter.step(102 * MS)[0].target == "b"


def test_anywhere_comes_first_and_leaves_its_target_alone() -> None:
    program = machine(
        "m", "a", [state("a", on("stop", to="b")), state("b"), state("halt")], anywhere=[on("stop", to="halt")]
    )
    interpreter, _ = started(program)
    assert interpreter.step(1, "stop")[0].target == "halt"
    assert interpreter.step(2, "stop") == []


def test_transition_to_its_own_state_leaves_and_enters_it() -> None:
    log: list[str] = []
    program = machine(
        "m", "a", [state("a", on("again", to="a"), enter=lambda m: log.append("in"), leave=lambda m: log.append("out"))]
    )
    interpreter, _ = started(program)
    interpreter.step(5, "again")
    assert log == ["in", "out", "in"]
    assert interpreter.since_ns == {"m": 5}


def test_blocks_run_in_order_leave_effect_enter() -> None:
    log: list[str] = []

    def logs(word: str) -> Any:
        return lambda m: log.append(word)

    program = machine(
        "m",
        "a",
        [
            state(
                "a",
                on("go", to="b", do=logs("effect")),
                enter=logs("in a"),
                during=logs("in step"),
                leave=logs("out a"),
            ),
            state("b", enter=[logs("in b"), logs("and again")]),
        ],
    )
    interpreter, _ = started(program)
    interpreter.step(1)
    interpreter.step(2, "go")
    assert log == ["in a", "in step", "out a", "effect", "in b", "and again"]


# -- chains -----------------------------------------------------------------------------------------------------------


def test_state_with_always_is_left_in_the_step_in_which_it_was_entered() -> None:
    program = machine("m", "a", [state("a", on("go", to="b")), state("b", always(to="c", when=holds("x"))), state("c")])
    interpreter, _ = started(program, x=True)
    assert [one.target for one in interpreter.step(1, "go")] == ["b", "c"]


def test_always_after_other_transitions_is_their_fallback() -> None:
    program = machine(
        "m",
        "a",
        [
            state("a", on("go", to="b")),
            state("b", on(holds("x"), to="yes"), always(to="no")),
            state("yes"),
            state("no"),
        ],
    )
    for x, due in ((True, "yes"), (False, "no")):
        interpreter, _ = started(program, x=x)
        interpreter.step(1, "go")
        assert path_of(interpreter) == due


def test_endless_chain_is_cut_after_sixteen_and_continues_in_the_next_step() -> None:
    program = machine("m", "z", [state("z", on("go", to="a")), state("a", always(to="b")), state("b", always(to="a"))])
    interpreter, _ = started(program)
    assert len(interpreter.step(1, "go")) == 16
    assert "more than 16 transitions" in next(iter(interpreter.problems.values())).message
    assert len(interpreter.step(2)) == 16


def test_signal_is_used_up_by_the_transition_it_caused() -> None:
    program = machine(
        "m", "a", [state("a", on("go", to="b")), state("b", on("go", to="c"), always(to="d")), state("c"), state("d")]
    )
    interpreter, _ = started(program)
    interpreter.step(1, "go")
    assert path_of(interpreter) == "d"


# -- signals ----------------------------------------------------------------------------------------------------------


def test_signal_that_no_active_state_waits_for_is_counted() -> None:
    interpreter, _ = started(machine("m", "a", [state("a", on("go", to="b")), state("b")]))
    interpreter.step(1, "go")
    interpreter.step(2, "go")
    interpreter.step(3, "unknown")
    assert interpreter.ignored == {"go": 1, "unknown": 1}


def test_effect_sees_the_values_of_its_signal() -> None:
    seen: list[Any] = []
    program = machine("m", "a", [state("a", on("go", to="b", do=lambda m: seen.append(m.signal))), state("b")])
    interpreter, _ = started(program)
    interpreter.step(1, "go", (3, "x"))
    assert seen == [(3, "x")]


# -- machines inside states -------------------------------------------------------------------------------------------

SCAN = machine(
    "scan",
    "left",
    [state("left", after(0.1, to="right"), exits(on("lost", to="home"))), state("right", after(0.1, to="left"))],
)


def looking(**more: Any) -> Program:
    return machine(
        "m", "look", [state("look", on("stop", to="home"), machines=[SCAN], **more), state("home", on("go", to="look"))]
    )


def test_machine_inside_restarts_with_its_state() -> None:
    interpreter, _ = started(looking())
    interpreter.step(100 * MS)
    assert interpreter.active == {"m": "look", "m/look/scan": "right"}
    interpreter.step(110 * MS, "stop")
    assert interpreter.active == {"m": "home"}
    interpreter.step(120 * MS, "go")
    assert interpreter.active == {"m": "look", "m/look/scan": "left"}
    assert interpreter.since_ns["m/look/scan"] == 120 * MS


def test_outer_transition_is_taken_before_the_inner_one_of_the_same_step() -> None:
    inner = machine("inner", "p", [state("p", on("stop", to="q")), state("q")])
    program = machine("m", "a", [state("a", on("stop", to="b"), machines=[inner]), state("b")])
    interpreter, _ = started(program)
    assert [(one.machine, one.target) for one in interpreter.step(1, "stop")] == [("m", "b")]


def test_inner_machines_are_left_first_and_the_last_one_before_the_first() -> None:
    log: list[str] = []

    def named(name: str) -> Program:
        return machine(
            name, "s", [state("s", enter=lambda m: log.append(f"+{name}"), leave=lambda m: log.append(f"-{name}"))]
        )

    program = machine(
        "m",
        "a",
        [
            state("a", on("go", to="b"), machines=[named("one"), named("two")], leave=lambda m: log.append("-a")),
            state("b"),
        ],
    )
    interpreter, _ = started(program)
    interpreter.step(1, "go")
    assert log == ["+one", "+two", "-two", "-one", "-a"]
    assert [state for _, state, _ in interpreter.left] == ["s", "s", "a"]


def test_exit_moves_the_machine_around_it() -> None:
    interpreter, _ = started(looking())
    (change,) = interpreter.step(1, "lost")
    assert (change.machine, change.kind, change.source, change.target) == ("m", "exit", "look", "home")
    assert interpreter.active == {"m": "home"}


def test_exit_of_a_machine_at_the_top_is_refused() -> None:
    with pytest.raises(
        ProgramError, match="'left->home' of machine 'scan' leaves the machine around it; there is none"
    ):
        Interpreter(SCAN)


def test_after_an_exit_the_machines_beside_it_take_no_step() -> None:
    log: list[str] = []
    one = machine("one", "s", [state("s", exits(on("lost", to="home")))])
    two = machine("two", "s", [state("s", during=lambda m: log.append("two"))])
    program = machine("m", "a", [state("a", machines=[one, two]), state("home")])
    interpreter, _ = started(program)
    interpreter.step(1, "lost")
    assert log == []


def test_two_machines_of_one_name_have_paths_of_their_own() -> None:
    interpreter, _ = started(side_by_side(looking(), looking()))
    assert interpreter.active == {"m": "look", "m/look/scan": "left", "m#2": "look", "m#2/look/scan": "left"}


# -- variables --------------------------------------------------------------------------------------------------------


def test_variables_are_seen_from_inside_and_kept_when_a_machine_is_entered_again() -> None:
    def count(m: Any) -> None:
        m.variables["entered"] += 1
        m.variables["own"] += 10

    inner = machine("inner", "s", [state("s", enter=count)], variables={"own": 0})
    program = machine("m", "a", [state("a", on("go", to="a"), machines=[inner])], variables={"entered": 0, "own": -1})
    interpreter, _ = started(program)
    interpreter.step(1, "go")
    assert interpreter.variables == {"m.entered": 2, "m.own": -1, "m/a/inner.own": 20}


@pytest.mark.parametrize("value", [{}, object(), 2**63, "x" * 70_000, [0] * 1001, {1}, 1j, b"", [[{}]]])
def test_value_that_is_not_plain_is_refused(value: Any) -> None:
    interpreter, _ = started(machine("m", "a", [state("a")], variables={"v": 0}))
    with pytest.raises(ParameterError, match=r"The variable 'm\.v' (cannot be|has more than)"):
        interpreter.set("m.v", value)
    assert interpreter.variables == {"m.v": 0}


def test_deep_list_is_refused_without_exhausting_the_stack() -> None:
    deep: list[Any] = []
    for _ in range(900):
        deep = [deep]
    interpreter, _ = started(machine("m", "a", [state("a")], variables={"v": 0}))
    with pytest.raises(ParameterError, match="more than 20 levels"):
        interpreter.set("m.v", deep)


def test_unknown_variable_is_answered_with_the_nearest_one() -> None:
    def wrong(m: Any) -> None:
        m.variables["gats"] = 1

    interpreter, _ = started(machine("m", "a", [state("a", during=wrong)], variables={"gate": 0}))
    with pytest.raises(UnknownNameError, match="no variable 'gats'") as caught:
        interpreter.step(1)
    assert "did you mean 'gate'?" in str(caught.value)
    with pytest.raises(UnknownNameError, match=r"'m\.gat'"):
        interpreter.set("m.gat", 1)


# -- errors in blocks -------------------------------------------------------------------------------------------------


def fails(m: Any) -> None:
    m.variables["v"] = 7
    raise ValueError("no bottom in sight")


def failing(on_error: Any) -> Program:
    beside = machine("n", "a", [state("a", after(0.0, to="b")), state("b")])
    program = machine("m", "a", [state("a", on("go", to="b")), state("b", enter=fails)], variables={"v": 0})
    return replace(side_by_side(program, beside), on_error=on_error)


def test_error_in_a_block_ends_the_step_if_the_program_fails_on_it() -> None:
    interpreter, _ = started(failing("fail"))
    with pytest.raises(ValueError, match="no bottom"):
        interpreter.step(1, "go")


def test_error_in_a_block_undoes_the_block_and_no_more_if_the_program_continues() -> None:
    interpreter, _ = started(failing("go_on"))
    interpreter.step(1, "go")
    assert interpreter.active == {"m": "b", "n": "b"}
    assert interpreter.variables == {"m.v": 0}
    (problem,) = interpreter.problems.values()
    assert (problem.machine, problem.block, problem.message) == ("m", "fails", "ValueError: no bottom in sight")


def test_error_in_a_block_ends_its_machine_if_the_program_stops_on_it() -> None:
    interpreter, _ = started(failing("stop"))
    changes = interpreter.step(1, "go")
    assert interpreter.active == {"n": "b"}
    assert [(one.machine, one.kind, one.source, one.target) for one in changes][-1] == ("m", "stop", "b", "")
    assert interpreter.step(2) == []


def test_step_without_a_change_has_left_no_state() -> None:
    program = machine("m", "a", [state("a", during=lambda m: 1 / 0)])
    interpreter, _ = started(replace(program, on_error="stop"))
    interpreter.step(1)
    assert interpreter.left == [("m", "a", 1)]
    interpreter.step(2)
    assert interpreter.left == []


def test_condition_that_raises_is_false_and_counted_once_for_each_time() -> None:
    program = machine(
        "m", "a", [state("a", on(lambda m: 1 / 0, to="b"), on(holds("x"), to="c")), state("b"), state("c")]
    )
    interpreter, pages = started(replace(program, on_error="go_on"), x=False)
    interpreter.step(1)
    interpreter.step(2)
    pages["x"] = True
    assert interpreter.step(3)[0].target == "c"
    assert [one.count for one in interpreter.problems.values()] == [3]


# -- snapshots, delay -------------------------------------------------------------------------------------------------


def test_snapshot_of_another_program_is_refused() -> None:
    one, _ = started(machine("m", "a", [state("a")]))
    two, _ = started(machine("m", "b", [state("b")]))
    with pytest.raises(ConfigError, match="another program"):
        two.restore(one.snapshot())


def test_snapshot_has_what_the_next_steps_depend_on() -> None:
    """Also random numbers, commands and problems."""
    text = """(var x := [0.0])
(machine m (state a (onentry [robot.up.start(5)]) (running [x = random()]) (running [x = 1 / 0])))(spawn m a)"""
    bridge = Bridge({}, {"up": Drive("thrust", "n", -9.0, 9.0, repeat_s=0.0)})
    one, two = (Interpreter(parse(text), bridge=bridge, rng=np.random.default_rng(seed)) for seed in (1, 2))
    one.spawn(0)
    one.step(1)
    assert one.robot is not None
    assert two.robot is not None
    one.robot.take_tasks()
    two.restore(json.loads(json.dumps(one.snapshot())))
    one.step(2)
    two.step(2)
    assert one.snapshot() == two.snapshot()
    assert [task.val_list[0].data for task in two.robot.take_tasks()] == [{"n": 5.0}]
    assert next(iter(two.problems.values())).count == 2


def test_delay_lets_time_stand_still() -> None:
    interpreter, _ = started(machine("m", "a", [state("a", after(0.1, to="b")), state("b")]))
    interpreter.delay(50 * MS)
    assert interpreter.step(149 * MS) == []
    assert interpreter.step(150 * MS) != []


# -- random programs --------------------------------------------------------------------------------------------------


def as_rows(changes: list[Any]) -> list[tuple[Any, ...]]:
    return [(one.kind, one.machine, one.source, one.target, one.held_ns) for one in changes]


@given(programs(), st.lists(steps, max_size=30))
def test_second_interpreter_agrees_on_random_programs(program: Program, word: list[Any]) -> None:
    pages: dict[str, Any] = {"holding": set()}
    interpreter, model = Interpreter(program, pages), ReferenceModel(program)
    assert as_rows(interpreter.spawn(0)) == model.spawn(0)
    now_ns = 0
    for passed_ns, holding, signal in word:
        now_ns += passed_ns
        pages["holding"] = holding
        assert as_rows(interpreter.step(now_ns, signal)) == model.step(now_ns, holding, signal)
        assert interpreter.active == model.active()


@given(programs(), st.lists(steps, max_size=20), st.lists(steps, max_size=10))
def test_interpreter_restored_from_a_snapshot_continues_as_the_first(
    program: Program, before: list[Any], later: list[Any]
) -> None:
    pages: dict[str, Any] = {"holding": set()}
    first, second = Interpreter(program, pages), Interpreter(program, FixedPages(pages))
    first.spawn(0)
    now_ns = 0
    for passed_ns, pages["holding"], signal in before:
        now_ns += passed_ns
        first.step(now_ns, signal)
    second.restore(first.snapshot())
    assert list(second.active.items()) == list(first.active.items())
    for passed_ns, pages["holding"], signal in later:
        now_ns += passed_ns
        assert first.step(now_ns, signal) == second.step(now_ns, signal)


@given(programs(), st.lists(steps, max_size=30))
def test_each_machine_is_in_one_state_and_inside_an_active_one(program: Program, word: list[Any]) -> None:
    pages: dict[str, Any] = {"holding": set()}
    interpreter = Interpreter(program, pages)
    interpreter.spawn(0)
    now_ns = 0
    for passed_ns, pages["holding"], signal in word:
        now_ns += passed_ns
        interpreter.step(now_ns, signal)
        active = interpreter.active
        for path in active:
            if "/" in path:
                above, _, place = path.rpartition("/")[0].rpartition("/")
                assert active[above] == place
