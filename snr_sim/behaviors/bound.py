"""A program bound to run: each block to the variables it sees, each transition to its target.

Nothing here is executed; what is made once here is not looked up in each step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, TypeAlias

from snr_sim.behaviors.bridge import Robot
from snr_sim.behaviors.context import Variables, plain_value
from snr_sim.behaviors.explain import Evaluations, watched
from snr_sim.behaviors.program import (
    Bindings,
    Block,
    MachineDef,
    Program,
    Rule,
    Spawn,
    StateDef,
    Transition,
    with_names,
)

Call: TypeAlias = tuple[Callable[[Any], Any], Block]  # a block that is bound to its place


def _calls(blocks: Iterable[Block], bindings: Bindings) -> tuple[Call, ...]:
    """Return blocks bound to their place; one that raises has done nothing, unless that ends the node."""
    return tuple(
        (one.bind(bindings) if one.is_atomic or not bindings.is_undone else _undone(one, bindings), one)
        for one in blocks
    )


def _undone(block: Block, bindings: Bindings) -> Callable[[Any], Any]:
    """Return a block that undoes what it has assigned and commanded when it raises."""
    call, slots, index, robot = block.bind(bindings), bindings.slots, bindings.index, bindings.robot
    places = sorted({index[name] for name in (index if block.writes is None else block.writes)})

    def all_or_nothing(context: Any) -> Any:
        before = [slots[place] for place in places]
        if robot is not None:
            robot.mark()
        try:
            return call(context)
        except Exception:
            if robot is not None:
                robot.undo()
            for place, value in zip(places, before, strict=True):
                slots[place] = value
            raise

    return all_or_nothing


class BoundState:
    """A state as it runs: its blocks, and its transitions as (least time, condition, transition).

    Args:
        definition: of it.
        machine: whose it is.
        inner: the machines inside it.
        evaluations: keeps what each condition finds.

    Attributes:
        enter: blocks and no machine, or no block and a machine that is spawned, in order.
    """

    __slots__ = ("by_signal", "chains", "during", "enter", "leave", "name", "plain")

    def __init__(
        self, definition: StateDef, machine: BoundMachine, inner: Iterable[Spawned], evaluations: Evaluations | None
    ) -> None:
        bindings, spawned = machine.bindings, iter(inner)
        self.name: str = definition.name
        self.enter: list[tuple[tuple[Call, ...], Spawned | None]] = [
            (_calls([one], bindings), None) if isinstance(one, Block) else ((), next(spawned))
            for one in definition.enter
        ]
        self.during: tuple[Call, ...] = _calls(definition.during, bindings)
        self.leave: tuple[Call, ...] = _calls(definition.leave, bindings)
        own = list(machine.definition.transitions_of(definition.name))
        rows = [(one.signal, _row(machine, one, evaluations)) for one in own]
        self.plain: tuple[Row, ...] = tuple(row for signal, row in rows if signal is None)
        # For each signal, the transitions without one, and its own.
        self.by_signal: dict[str, tuple[Row, ...]] = {
            given: tuple(row for signal, row in rows if signal in (None, given))
            for given in dict.fromkeys(one.signal for one in own)
            if given is not None
        }
        self.chains: bool = any(one.kind == "eps" for one in own)


# A transition, its least time or what computes that, its effect, and its kind, name, target and line: looked up once.
BoundTransition: TypeAlias = tuple[Transition, int | Callable[[Any], Any] | None, tuple[Call, ...], str, str, str, int]
Row = tuple[int | None, Callable[[Any], Any] | None, BoundTransition]
Spawned: TypeAlias = "tuple[BoundMachine, str]"  # with its initial state


class BoundStates(dict[str, BoundState]):
    """The states of a machine, each bound when it is first entered: an edit of a large program binds only a few."""

    def __init__(self, machine: BoundMachine, evaluations: Evaluations | None) -> None:
        super().__init__()
        self.nested: dict[str, list[Spawned]] = {}
        self._machine, self._evaluations = machine, evaluations

    def __missing__(self, name: str) -> BoundState:
        definition = self._machine.definition.by_name[name]
        self[name] = state = BoundState(definition, self._machine, self.nested[name], self._evaluations)
        return state


class BoundMachine:
    """A machine as it runs, at one place of the program."""

    __slots__ = ("bindings", "definition", "parent", "path", "running", "since_ns", "state", "states", "variables")

    def __init__(
        self,
        path: str,
        definition: MachineDef,
        parent: BoundMachine | None,
        bindings: Bindings,
        evaluations: Evaluations | None,
    ) -> None:
        self.path: str = path
        self.definition: MachineDef = definition
        self.parent: BoundMachine | None = parent
        self.bindings: Bindings = bindings
        self.variables: Variables = Variables(bindings.slots, bindings.index)
        self.states: BoundStates = BoundStates(self, evaluations)
        self.state: BoundState | None = None  # None: it does not run
        self.since_ns: int = 0
        self.running: list[BoundMachine] = []  # inside its state, in the order in which they were spawned

    def walk(self) -> Iterator[BoundMachine]:
        """Yield it and all machines inside it that run, outer ones first."""
        yield self
        for inner in self.running:
            yield from inner.walk()


class BoundProgram:
    """All machines of a program, at their places.

    Args:
        program: of which it is.
        robot: what blocks of text command.
        evaluations: keeps what each condition finds; see `explain.py`.

    Attributes:
        slots: the values of all variables.
        places: index of each variable in `slots`, by path, such as "mission.gate".
        first_values: with which the variables began, by path.
        machines: by path, whether they run or not.
        top: those that are spawned at the top, each with its initial state.
        rules: what is looked at after each step, with its condition.
    """

    def __init__(self, program: Program, robot: Robot | None, evaluations: Evaluations | None = None) -> None:
        self.slots: list[Any] = []
        self.places: dict[str, int] = {}
        self.first_values: dict[str, Any] = {}
        self.machines: dict[str, BoundMachine] = {}
        self._robot, self._is_undone, self._evaluations = robot, program.on_error != "fail", evaluations
        index = self._declare(program.variables, "", {})
        self.top: list[Spawned] = [
            (self._build(name, spawn, None, index), spawn.initial) for name, spawn in with_names(program.spawns)
        ]
        bindings = Bindings(self.slots, index, robot, self._is_undone)
        self.rules: list[tuple[Rule, Callable[[Any], Any] | None]] = [
            (rule, None if rule.condition is None else rule.condition.bind(bindings)) for rule in program.rules
        ]

    def _declare(self, values: Mapping[str, Any], above: str, seen: Mapping[str, int]) -> dict[str, int]:
        """Add variables; return the places of all that are seen then."""
        index = dict(seen)
        for name, value in values.items():
            path = above + name.rpartition(".")[2]
            index[name] = self.places[path] = len(self.slots)
            self.first_values[path] = value
            self.slots.append(plain_value(name, value))
        return index

    def _build(self, path: str, spawn: Spawn, parent: BoundMachine | None, seen: Mapping[str, int]) -> BoundMachine:
        definition = spawn.machine
        index = self._declare(definition.variables, f"{path}.", seen)
        bindings = Bindings(self.slots, index, self._robot, self._is_undone)
        machine = BoundMachine(path, definition, parent, bindings, self._evaluations)
        self.machines[path] = machine
        for state in definition.states:
            machine.states.nested[state.name] = [
                (self._build(f"{path}/{state.name}/{name}", one, machine, index), one.initial)
                for name, one in with_names(state.spawns)
            ]
        return machine


def _row(machine: BoundMachine, transition: Transition, evaluations: Evaluations | None) -> Row:
    condition, effect, after_ns = transition.condition, transition.effect, transition.after_ns
    bindings = machine.bindings
    holds = None if condition is None else condition.bind(bindings)
    due = after_ns.bind(bindings) if isinstance(after_ns, Block) else after_ns
    calls, one = _calls(() if effect is None else (effect,), bindings), transition
    arrow = one, due, calls, one.kind, one.name, one.target, one.place.line
    if evaluations is not None:
        return None, watched(machine, transition, due, holds, bindings, evaluations), arrow
    return (due, holds, arrow) if not callable(due) else (None, _with_time(due, holds), arrow)


def _with_time(after_ns: Callable[[Any], Any], condition: Callable[[Any], Any] | None) -> Callable[[Any], Any]:
    """Return the condition that a time, which is computed in each step, is over, and another one holds."""

    def holds(context: Any) -> Any:
        if context.now_ns - context.machine.since_ns < after_ns(context):
            return False
        return condition is None or condition(context)

    return holds
