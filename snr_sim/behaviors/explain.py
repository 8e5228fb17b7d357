"""Why a transition was taken, or not: each evaluation of a run, with the values that its condition had.

A flight pays nothing for this: a replay executes the same steps again, and logs them. A condition has no effects, so
its parts can be evaluated once more; but for random numbers, which would change those that follow.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any, Protocol

import msgspec

from snr_sim.behaviors.program import Bindings, Block, Program, Transition

MAX_EVALUATIONS = 200_000
MAX_VALUE = 60  # characters


class Evaluation(msgspec.Struct, frozen=True):
    """One transition that was looked at in one step.

    Args:
        t_ns: when.
        machine, state: path of the machine, and the state that it was in.
        transition: name of the transition.
        kind, target, line: of it.
        elapsed_ns: time in the state.
        after_ns: least time; None without one.
        is_true: whether it was taken.
        error: of the condition; empty without one.
        values: of the parts of its condition, as text.
    """

    t_ns: int
    machine: str
    state: str
    transition: str
    kind: str
    target: str
    line: int
    elapsed_ns: int
    after_ns: int | None
    is_true: bool
    error: str = ""
    values: dict[str, str] = {}


@dataclass
class EvaluationLog:
    """Keeps the evaluations in an interval of a run.

    Args:
        from_ns, until_ns: the interval, inclusive.
        machine: path of the machine; empty for all.
        target: only transitions to this state; empty for all.
    """

    from_ns: int
    until_ns: int
    machine: str = ""
    target: str = ""
    found: list[Evaluation] = field(default_factory=list)
    left_out: int = 0  # more than are kept

    def keep(self, one: Evaluation, values: Callable[[], dict[str, str]]) -> None:
        """Keep an evaluation, if it is selected, with its values."""
        is_selected = self.machine in ("", one.machine) and self.target in ("", one.target)
        if not (is_selected and self.from_ns <= one.t_ns <= self.until_ns):
            return
        if len(self.found) < MAX_EVALUATIONS:
            self.found.append(msgspec.structs.replace(one, values=values()))
        else:
            self.left_out += 1


class Evaluations(Protocol):
    """What takes evaluations: an `EvaluationLog`, or a count of them."""

    def keep(self, one: Evaluation, values: Callable[[], dict[str, str]]) -> None:
        """Keep an evaluation; `values` returns those of the parts of its condition."""


_of_program: ContextVar[Callable[[Program], Evaluations] | None] = ContextVar("_of_program", default=None)


@contextmanager
def explaining(of_program: Callable[[Program], Evaluations]) -> Iterator[None]:
    """Have every interpreter that is made meanwhile keep its evaluations, also one that is inside a component.

    Args:
        of_program: returns what takes them.
    """
    token = _of_program.set(of_program)
    try:
        yield
    finally:
        _of_program.reset(token)


def evaluations_for(program: Program) -> Evaluations | None:
    """Return what takes the evaluations of a program's interpreter; None if none is asked for."""
    of_program = _of_program.get()
    return None if of_program is None else of_program(program)


def watched(
    machine: Any,
    definition: Transition,
    after: int | Callable[[Any], Any] | None,
    holds: Callable[[Any], Any] | None,
    bindings: Bindings,
    evaluations: Evaluations,
) -> Callable[[Any], bool]:
    """Return the condition of a transition, with its time, and logs each evaluation."""
    parts: list[tuple[str, Callable[[Any], Any]]] | None = None  # bound when they are asked for

    def values(context: Any) -> dict[str, str]:
        nonlocal parts
        if parts is None:
            blocks = [one for one in (definition.after_ns, definition.condition) if isinstance(one, Block)]
            parts = [(part.text, part.bind(bindings)) for one in blocks if one.parts for part in one.parts()]
        return {text: _value(part, context) for text, part in parts}

    def condition(context: Any) -> bool:
        elapsed_ns = context.now_ns - machine.since_ns
        after_ns: int | None = None
        error: Exception | None = None
        is_true = False
        try:
            after_ns = after(context) if callable(after) else after
            is_due = after_ns is None or elapsed_ns >= after_ns
            is_true = is_due and (holds is None or bool(holds(context)))
        except Exception as raised:
            error = raised
        shown = "" if error is None else f"{type(error).__name__}: {error}"
        one = definition
        evaluation = Evaluation(
            context.now_ns, machine.path, machine.state.name, one.name, one.kind, one.target, one.place.line,
            elapsed_ns, after_ns, is_true, shown,
        )  # fmt: skip
        evaluations.keep(evaluation, lambda: values(context))
        if error is not None:
            raise error
        return is_true

    return condition


def _value(part: Callable[[Any], Any], context: Any) -> str:
    work = context.work
    try:
        value = part(context)
    except Exception as error:
        return f"{type(error).__name__}: {error}"[:MAX_VALUE]
    finally:
        context.work = work  # what is looked at takes nothing from the blocks of the step
    shown = f"{value:.6g}" if isinstance(value, float) else repr(value)
    return shown if len(shown) <= MAX_VALUE else shown[: MAX_VALUE - 3] + "..."


def summary(found: list[Evaluation]) -> list[dict[str, Any]]:
    """Return for each transition how often it was looked at and taken, and the range of each value.

    Values that are numbers are given as "from ... to ..."; of others, up to four different ones.
    """
    groups: dict[tuple[str, str, str, int], list[Evaluation]] = {}
    for one in found:
        groups.setdefault((one.machine, one.state, one.transition, one.line), []).append(one)
    return [_row(group) for group in groups.values()]


def _row(group: list[Evaluation]) -> dict[str, Any]:
    first, after_ns = group[0], group[-1].after_ns  # the newest, if a variable gives it
    values: dict[str, dict[str, None]] = {}
    for one in group:
        for text, value in one.values.items():
            values.setdefault(text, {})[value] = None
    return {
        "machine": first.machine, "state": first.state, "transition": first.transition, "target": first.target,
        "line": first.line, "evaluated": len(group), "taken": [one.is_true for one in group].count(True),
        "longest_s": max(one.elapsed_ns for one in group) / 1e9,
        "after_s": None if after_ns is None else after_ns / 1e9,
        "errors": dict(Counter(one.error for one in group if one.error)),
        "values": {text: _range(list(seen)) for text, seen in values.items()},
    }  # fmt: skip


def _range(seen: list[str]) -> str:
    try:
        numbers = sorted(map(float, seen))
    except ValueError:
        return ", ".join(seen[:4]) + (", ..." if len(seen) > 4 else "")
    if len(numbers) == 1:
        return seen[0]
    return f"{numbers[0]:g} to {numbers[-1]:g}"
