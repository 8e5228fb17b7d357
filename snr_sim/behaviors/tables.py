"""State machines written in Python.

    def is_near(m):
        return m.data("way")["way_m"] < 0.25

    MISSION = machine(
        "mission",
        initial="waiting",
        variables={"gate": 0},
        states=[
            state("waiting", after(2.0, to="passing", when=is_ready)),
            state("passing", on(is_near, to="done", do=count), after(30.0, to="done"), enter=arm, leave=disarm),
            state("done"),
        ],
        anywhere=[on("stop", to="done")],
    )

A text names a signal: an event of the node. A function takes `m`, a `MachineContext`: one of a condition returns
whether it holds, any other one returns tasks or None. An exception in one ends the node, as in any handler.
"""

from __future__ import annotations

import hashlib
import math
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

from snr_sim.behaviors.checks import problems_of
from snr_sim.behaviors.context import NS_PER_S, plain_value
from snr_sim.behaviors.export import as_text
from snr_sim.behaviors.program import (
    ANY,
    Bindings,
    Block,
    MachineDef,
    Place,
    Problem,
    Program,
    ProgramError,
    Spawn,
    StateDef,
    Transition,
)
from snr_sim.prelude.errors import ParameterError

Function: TypeAlias = Callable[[Any], Any]

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


def on(event: str | Function, to: str, do: Function | None = None, *, name: str = "") -> Transition:
    """Return a transition that is taken when something happens.

    Args:
        event: name of a signal, or a condition.
        to: the state that follows.
        do: executed between leaving and entering.
        name: of the transition; "a->b" if not given.
    """
    signal = event if isinstance(event, str) else None
    condition = None if signal is not None else _block(event, "on")
    return Transition("on", "", to, name, _place(), signal, condition, None, _optional(do, "do"))


def after(
    time_s: float | Function, to: str, when: Function | None = None, do: Function | None = None, *, name: str = ""
) -> Transition:
    """Return a transition that is taken after a time in the state, at the first step that is not earlier.

    Args:
        time_s: time [s]; a function is called in each step.
        to, do, name: as of `on`.
        when: condition that must hold as well.

    Raises:
        ParameterError: the time is negative or not finite.
    """
    if callable(time_s):
        text = _text_of(time_s)
        function = time_s
        time: int | Block = Block(text, _place(), _Given(lambda m: round(function(m) * NS_PER_S)))
    elif isinstance(time_s, (int, float)) and math.isfinite(time_s) and time_s >= 0.0:
        time = round(time_s * NS_PER_S)
    else:
        raise ParameterError(f"after({time_s!r}, to={to!r}).", fix="seconds, such as 2.0, or a function of m.")
    return Transition("ontime", "", to, name, _place(), None, _optional(when, "when"), time, _optional(do, "do"))


def always(to: str, when: Function | None = None, do: Function | None = None, *, name: str = "") -> Transition:
    """Return a transition that is taken at once, also in the step in which the state is entered; arguments as of
    `after`."""
    return Transition("eps", "", to, name, _place(), None, _optional(when, "when"), None, _optional(do, "do"))


def exits(transition: Transition) -> Transition:
    """Return a transition of a machine inside a state as one to another state of the machine around it.

    exits(on("lost", to="home"))
    """
    return replace(transition, kind="exit")


def state(
    name: str,
    *transitions: Transition,
    enter: Function | Sequence[Function] | None = None,
    during: Function | Sequence[Function] | None = None,
    leave: Function | Sequence[Function] | None = None,
    machines: Sequence[Program] = (),
) -> tuple[StateDef, tuple[Transition, ...]]:
    """Return a state with its transitions, in the order in which they are tried.

    Args:
        name: unique in its machine.
        transitions: made with `on`, `after`, `always` and `exits`.
        enter: executed on entry; a function, or several.
        during: executed in each step that no transition is taken in.
        leave: executed on exit, whichever transition is taken.
        machines: run while the state lasts, from their initial states, beginning after `enter`.
    """
    place = _place()
    spawns = [replace(spawn, place=place) for one in machines for spawn in _program(one, name).spawns]
    definition = StateDef(
        name, (*_blocks(enter, "enter"), *spawns), _blocks(during, "during"), _blocks(leave, "leave"), place
    )
    for one in transitions:
        if not isinstance(one, Transition):
            raise ParameterError(
                f"The state '{name}' is given {one!r} as a transition.", fix="on(...), after(...) or always(...)."
            )
    return definition, tuple(replace(one, source=name) for one in transitions)


def machine(
    name: str,
    initial: str,
    states: Iterable[tuple[StateDef, tuple[Transition, ...]]],
    *,
    anywhere: Iterable[Transition] = (),
    variables: Mapping[str, Any] | None = None,
) -> Program:
    """Return a program with one machine.

    Args:
        name: of the machine.
        initial: name of the state in which it begins.
        states: made with `state`.
        anywhere: transitions from every state but their target. They are tried before those of the states.
        variables: initial values by name: numbers, text, True, False, None, and tuples of these. A machine that is
            entered again finds them as it left them.

    Raises:
        ProgramError: a name is used twice, or a state that is named does not exist; it has all mistakes.
        ParameterError: a variable cannot have its value.
    """
    given = list(states)
    for one in given:
        if not (isinstance(one, tuple) and len(one) == 2 and isinstance(one[0], StateDef)):
            raise ParameterError(f"The machine '{name}' is given {one!r} as a state.", fix='state("waiting", ...).')
    found = [replace(one, source=ANY) for one in anywhere]
    found += [one for _, own in given for one in own]
    named = [one if one.name else replace(one, name=f"{one.source}->{one.target}") for one in found]
    values = {key: plain_value(key, value) for key, value in (variables or {}).items()}
    definition = MachineDef(str(name), tuple(one for one, _ in given), tuple(named), values, _place())
    spawns = (Spawn(definition, initial, _place()),)
    names = [definition.name, *values, *(one.name for one in definition.states)]
    problems = [*_bad_names(names, definition.place), *problems_of(spawns)]
    if any(one.is_error for one in problems):
        raise ProgramError([one for one in problems if one.is_error])
    return _program_of(spawns, problems)


def side_by_side(*programs: Program) -> Program:
    """Return the program in which the machines of all given ones run side by side, stepped in this order."""
    spawns = tuple(spawn for one in programs for spawn in one.spawns)
    return _program_of(spawns, [warning for one in programs for warning in one.warnings])


def _program_of(spawns: tuple[Spawn, ...], warnings: list[Problem]) -> Program:
    text = as_text(spawns)
    return Program(text, hashlib.sha256(text.encode()).hexdigest(), spawns, "fail", tuple(warnings))


def _place() -> Place:
    """Return the line from which the public function was called."""
    return Place(sys._getframe(2).f_lineno)


def _program(one: object, name: str) -> Program:
    if not isinstance(one, Program):
        raise ParameterError(f"The state '{name}' is given {one!r} as a machine.", fix="what machine(...) returns.")
    return one


@dataclass(frozen=True)
class _Given:
    """Binds a function that needs no bindings. Those of one function are equal."""

    function: Function

    def __hash__(self) -> int:
        return hash(_text_of(self.function))  # of an object that is called there may be no hash

    def __call__(self, bindings: Bindings) -> Function:
        """Return the function."""
        return self.function


def _text_of(function: Any) -> str:
    """Return a function's name, with where it is if it has none, and with the plain values that it was made with."""
    if isinstance(function, partial):
        return f"{_text_of(function.func)}{_shown(enumerate(function.args))}{_shown(function.keywords.items())}"
    name, code = getattr(function, "__name__", type(function).__name__), getattr(function, "__code__", None)
    if code is None:
        return name
    if name == "<lambda>":
        column = next((begin for _, _, begin, _ in code.co_positions() if begin), 0)
        name = f"lambda in line {code.co_firstlineno}, column {column + 1}"
    cells = [(key, cell.cell_contents) for key, cell in zip(code.co_freevars, function.__closure__ or (), strict=True)]
    return f"{name}{_shown(enumerate(function.__defaults__ or ()))}{_shown(cells)}"


def _shown(values: Iterable[tuple[Any, Any]]) -> str:
    return "".join(f" {key}={value!r}" for key, value in values if isinstance(value, (int, float, str, tuple)))


def _block(function: object, what: str) -> Block:
    if not callable(function):
        raise ParameterError(
            f"{what}={function!r} is not a function.", fix="its name without brackets, such as is_near."
        )
    line = getattr(getattr(function, "__code__", None), "co_firstlineno", 0)
    return Block(_text_of(function), Place(line), _Given(function))


def _optional(function: object, what: str) -> Block | None:
    return None if function is None else _block(function, what)


def _blocks(functions: Function | Sequence[Function] | None, what: str) -> tuple[Block, ...]:
    if functions is None:
        return ()
    several = functions if isinstance(functions, Sequence) else [functions]
    return tuple(_block(one, what) for one in several)


def _bad_names(names: Iterable[object], place: Place) -> list[Problem]:
    return [
        Problem(place, f"{name!r} cannot be a name.", "letters, digits, '_' and '-', beginning with a letter.")
        for name in names
        if not (isinstance(name, str) and _NAME.fullmatch(name))
    ]
