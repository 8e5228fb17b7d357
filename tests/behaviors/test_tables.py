"""A machine in Python is checked when it is made, and its errors name the line and the nearest name."""

from __future__ import annotations

import sys
from typing import Any

import pytest

from snr_sim.behaviors import Program, ProgramError, after, always, exits, machine, on, state
from snr_sim.prelude.errors import ParameterError


def here() -> int:
    return sys._getframe(1).f_lineno


def test_unknown_target_is_answered_with_the_nearest_state_and_the_line() -> None:
    with pytest.raises(ProgramError) as caught:
        machine("m", "waiting", [state("waiting", on("go", to="pasing")), state("passing")])
    line = here() - 1  # not in the assertion: what pytest makes of it has other lines, by its version
    assert str(caught.value) == (
        f"Line {line}: Transition 'waiting->pasing' of machine 'm' leads to 'pasing', which is not a state.\n"
        "  Try: did you mean 'passing'? One of: passing, waiting."
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: machine("m", "a", [state("a"), state("a")]), "two states 'a'"),
        (lambda: machine("m", "b", [state("a")]), "begins in 'b', which is not one of its states"),
        (lambda: machine("m", "a", []), "has no state"),
        (lambda: machine("m x", "a", [state("a")]), "'m x' cannot be a name"),
        (lambda: machine("m", "a", [state("a")], variables={"a.b": 1}), r"'a\.b' cannot be a name"),
        (lambda: machine("m", "a", [state("")]), "'' cannot be a name"),
        (lambda: machine("m", 5, [state("a")]), "begins in '5'"),  # type: ignore[arg-type]
        (
            lambda: machine(
                "m", "a", [state("a", machines=[machine("i", "p", [state("p", exits(on("x", to="nowhere")))])])]
            ),
            "'p->nowhere' of machine 'i' leads to 'nowhere'",
        ),
    ],
)
def test_mistake_in_a_machine_is_refused(make: Any, message: str) -> None:
    with pytest.raises(ProgramError, match=message):
        make()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: machine("m", "a", [on("go", to="a")]), "as a state"),  # type: ignore[list-item]
        (lambda: state("a", "go"), "'go' as a transition"),  # type: ignore[arg-type]
        (lambda: state("a", machines=[state("b")]), "as a machine"),  # type: ignore[list-item]
        (lambda: state("a", enter=5), "enter=5 is not a function"),  # type: ignore[arg-type]
        (lambda: on(5, to="a"), "on=5 is not a function"),  # type: ignore[arg-type]
        (lambda: on("go", to="a", do="x"), "do='x' is not a function"),  # type: ignore[arg-type]
        (lambda: after(-1.0, to="a"), r"after\(-1\.0"),
        (lambda: after(float("nan"), to="a"), r"after\(nan"),
        (lambda: after("2", to="a"), r"after\('2'"),  # type: ignore[arg-type]
        (lambda: machine("m", "a", [state("a")], variables={"v": {}}), "variable 'v' cannot be a dict"),
    ],
)
def test_wrong_argument_is_refused(make: Any, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        make()


def test_all_mistakes_are_reported_at_once() -> None:
    with pytest.raises(ProgramError) as caught:
        machine("m", "x", [state("a", on("go", to="b"), after(1.0, to="c"))])
    assert len(caught.value.problems) == 3


def test_state_that_no_transition_leads_to_is_doubtful() -> None:
    program = machine("m", "a", [state("a"), state("b")])
    assert [one.message for one in program.warnings] == ["No run can reach state 'b'."]


def test_state_that_only_an_exit_leads_to_is_not_doubtful() -> None:
    inner = machine("i", "p", [state("p", exits(on("lost", to="home")))])
    assert machine("m", "a", [state("a", machines=[inner]), state("home")]).warnings == ()


def test_equal_tables_have_one_digest_and_different_ones_have_others() -> None:
    def made(wait_s: float) -> Program:
        return machine("m", "a", [state("a", after(wait_s, to="b")), state("b", always(to="a"))])

    assert made(1.0).sha256 == made(1.0).sha256 != made(1.5).sha256


def test_signals_of_all_levels_in_order() -> None:
    inner = machine("i", "p", [state("p", on("one", to="p"), exits(on("two", to="a")))])
    program = machine("m", "a", [state("a", on("three", to="a"), machines=[inner])], anywhere=[on("stop", to="a")])
    assert program.signals() == ["stop", "three", "one", "two"]


def test_machines_in_too_many_levels_are_refused() -> None:
    def nested(levels: int) -> Program:
        made = machine("m", "a", [state("a")])
        for _ in range(levels):
            made = machine("m", "a", [state("a", machines=[made])])
        return made

    assert len(list(nested(99).walk())) == 100
    with pytest.raises(ProgramError, match="more than 100 levels"):
        nested(1000)
