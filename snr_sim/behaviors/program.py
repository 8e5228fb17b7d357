"""Programs: state machines as data, whichever front end made them. Frozen: what runs is in `interpreter.py`.

machine() and state() of tables.py --.
                                     +--> Program --> Interpreter --> MachineEndpoint
                          (text) ----'         `--> drawings: export.py
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, TypeAlias

from snr_sim.prelude.errors import SnrError

Kind: TypeAlias = Literal["on", "ontime", "eps", "exit"]
OnError: TypeAlias = Literal["go_on", "stop", "fail"]
ANY: str = "*"  # source of a transition from every state but its target


@dataclass(frozen=True)
class Place:
    """Where something is in a file: lines and columns from 1, 0 if unknown; the end is the character after it."""

    line: int = 0
    column: int = 0
    end_line: int = 0
    end_column: int = 0


@dataclass(frozen=True)
class Problem:
    """A mistake in a program, or what is doubtful in it.

    Args:
        place: of what is meant.
        message: what is wrong.
        fix: what to try.
        is_error: whether the program cannot run.
    """

    place: Place
    message: str
    fix: str = ""
    is_error: bool = True


def show_problem(problem: Problem, place: str, lines: list[str]) -> str:
    """Return a problem as text: where it is, what is wrong, the line with a mark below it, and what to try."""
    at = problem.place
    kind = "" if problem.is_error else "warning: "
    shown = [f"{place}:{at.line}:{at.column}: {kind}{problem.message}"]
    if 0 < at.line <= len(lines):
        line = lines[at.line - 1]
        width = at.end_column - at.column if at.end_line == at.line else len(line) - at.column + 1
        shown.append(f"{at.line:6}  {line}")
        shown.append(" " * (7 + at.column) + "^" * max(1, min(width, len(line) - at.column + 1)))
    if problem.fix:
        shown.append(f"  Try: {problem.fix}")
    return "\n".join(shown)


class ProgramError(SnrError):
    """A program has mistakes: `problems` has all of them."""

    def __init__(self, problems: list[Problem]) -> None:
        first = problems[0]
        where = ":".join(str(one) for one in (first.place.line, first.place.column) if one)
        super().__init__(f"Line {where}: {first.message}" if where else first.message, fix=first.fix)
        self.problems: list[Problem] = problems


@dataclass(frozen=True)
class Bindings:
    """What a block is bound to before it runs, at one place of a program.

    Args:
        slots: the values of all variables; the list stays the same.
        index: index in it of each variable that can be seen, by name.
        robot: what the program commands, if anything; see `bridge.py`.
        is_undone: whether a block that raises is undone.
    """

    slots: list[Any]
    index: Mapping[str, int]
    robot: Any = None
    is_undone: bool = True


@dataclass(frozen=True)
class Block:
    """A piece of code of a program.

    Args:
        text: as written in the program, for messages and drawings; of a function in Python, its name.
        place: of it.
        bind: returns what is called with a `MachineContext`. A condition returns whether it holds; any other block,
            tasks or None. Those of blocks that do the same are equal.
        drives: parts of the robot that it commands; of a block of text.
        writes: keys of the variables that it assigns; of a function in Python None: it may assign all.
        keys: of the variables that it names; of a function in Python none are known.
        is_atomic: whether it has changed nothing if it raises; of a function in Python that is not known.
        reads: parts of the robot that it reads; of a block of text.
        polls: what in it changes without a page, such as "now_ms"; of a block of text.
        parts: returns the parts of a condition in text, for an explanation: readings, variables, what is compared.
    """

    text: str
    place: Place
    bind: Callable[[Bindings], Callable[[Any], Any]] = field(repr=False)
    drives: frozenset[str] = frozenset()
    writes: frozenset[str] | None = None
    keys: tuple[str, ...] = ()
    is_atomic: bool = False
    reads: frozenset[str] = frozenset()
    polls: str = ""
    parts: Callable[[], list[Block]] | None = field(default=None, repr=False, compare=False)

    @property
    def code(self) -> str:
        """What it means, with the helpers that it calls; of a function in Python, its name."""
        code: str = getattr(self.bind, "code", self.text)
        return code

    @property
    def line(self) -> str:
        """Its text in one line, to be shown."""
        return " ".join(self.text.split())


@dataclass(frozen=True)
class Transition:
    """An arrow of a machine, as it is declared.

    Args:
        kind: 'on' of a condition or a signal, 'ontime' after a time, 'eps' at once, 'exit' to a state of the enclosing
            machine.
        source: a state, or ANY.
        target: a state.
        signal: name of the event that it waits for.
        condition: must hold as well.
        after_ns: least time in the source; a block returns it, and is called in each step.
        effect: executed between leaving and entering.
    """

    kind: Kind
    source: str
    target: str
    name: str
    place: Place = Place()
    signal: str | None = None
    condition: Block | None = None
    after_ns: int | Block | None = None
    effect: Block | None = None


@dataclass(frozen=True)
class Spawn:
    """A machine that begins to run in a state, whenever its place is entered."""

    machine: MachineDef
    initial: str
    place: Place = Place()


@dataclass(frozen=True)
class StateDef:
    """A state: what it does on entry, in each step, and on exit. Machines are spawned among the blocks of the entry."""

    name: str
    enter: tuple[Block | Spawn, ...] = ()
    during: tuple[Block, ...] = ()
    leave: tuple[Block, ...] = ()
    place: Place = Place()

    @property
    def spawns(self) -> tuple[Spawn, ...]:
        """The machines inside it, in the order in which they begin."""
        return tuple(one for one in self.enter if isinstance(one, Spawn))


@dataclass(frozen=True)
class MachineDef:
    """A machine: its states, and its transitions in the order in which they are tried.

    Args:
        variables: initial values by name. Where a name hides that of an outer machine, it is made unique by a prefix
            that ends with '.'.
    """

    name: str
    states: tuple[StateDef, ...]
    transitions: tuple[Transition, ...]
    variables: Mapping[str, Any] = field(default_factory=dict)
    place: Place = Place()

    def transitions_of(self, state: str) -> Iterator[Transition]:
        """Yield the transitions that can leave a state, in the order in which they are tried."""
        own, anywhere = self._by_source.get(state, []), self._by_source.get(ANY, [])
        for _, one in sorted((*own, *anywhere), key=lambda row: row[0]) if own and anywhere else (own or anywhere):
            if one.source != ANY or one.target != state:
                yield one

    @cached_property
    def by_name(self) -> dict[str, StateDef]:
        """Its states by name."""
        return {one.name: one for one in self.states}

    @cached_property
    def extent(self) -> tuple[int, int, int]:
        """How many states and transitions out of them it has, with those of machines in them; how many levels."""
        inside = [spawn.machine.extent for state in self.states for spawn in state.spawns]
        states, sources = len(self.states), [one.source for one in self.transitions]
        transitions = len(sources) + (states - 1) * sources.count(ANY)
        transitions += sum(count for _, count, _ in inside)  # exact: integers
        states += sum(count for count, _, _ in inside)  # exact: integers
        return states, transitions, 1 + max((levels for _, _, levels in inside), default=0)

    @cached_property
    def _by_source(self) -> dict[str, list[tuple[int, Transition]]]:
        found: dict[str, list[tuple[int, Transition]]] = {}
        for i, one in enumerate(self.transitions):
            found.setdefault(one.source, []).append((i, one))
        return found


@dataclass(frozen=True)
class Rule:
    """What is looked at after each step.

    Args:
        kind: 'always' must hold; 'break' pauses the machines when a state is entered.
        name: of the rule; of a break, of the state.
        condition: must hold; of a break, for it to pause; None: it pauses always.
    """

    kind: Literal["always", "break"]
    name: str
    condition: Block | None
    place: Place = Place()


@dataclass(frozen=True)
class Program:
    """Machines that run side by side.

    Args:
        text: of the program; of one made in Python a listing: see `export.as_text`.
        sha256: of the text.
        spawns: the machines that begin when the program does, in this order.
        on_error: what an exception in a block does: 'go_on' notes it; 'stop' ends its machine; 'fail' ends the node.
        warnings: what is doubtful.
        variables: initial values of those that all machines see, by name.
        rules: what is looked at after each step.
        files: texts of the programs that it imports, by the names of their files.
        actions: functions of Python files that its blocks may call, by file and name.
    """

    text: str
    sha256: str
    spawns: tuple[Spawn, ...]
    on_error: OnError = "fail"
    warnings: tuple[Problem, ...] = ()
    variables: Mapping[str, Any] = field(default_factory=dict)
    rules: tuple[Rule, ...] = ()
    files: Mapping[str, str] = field(default_factory=dict, repr=False)
    actions: Mapping[str, Mapping[str, Callable[..., Any]]] = field(default_factory=dict, repr=False)

    def walk(self) -> Iterator[tuple[str, Spawn]]:
        """Yield every machine with its path, such as "mission/lining_up/scan", outer ones first."""
        yield from _walk(self.spawns, "")

    def signals(self) -> list[str]:
        """Return the names of all signals that a transition waits for, in order of their first use."""
        found = dict[str, None]()
        for _, spawn in self.walk():
            found |= {one.signal: None for one in spawn.machine.transitions if one.signal is not None}
        return list(found)


def _walk(spawns: tuple[Spawn, ...], above: str) -> Iterator[tuple[str, Spawn]]:
    for name, spawn in with_names(spawns):
        yield above + name, spawn
        for state in spawn.machine.states:
            yield from _walk(state.spawns, f"{above}{name}/{state.name}/")


def with_names(spawns: tuple[Spawn, ...]) -> Iterator[tuple[str, Spawn]]:
    """Yield machines that run side by side with names that are unique among them: the second `scan` is `scan#2`."""
    count = dict[str, int]()
    for spawn in spawns:
        name = spawn.machine.name
        count[name] = count.get(name, 0) + 1
        yield (name if count[name] == 1 else f"{name}#{count[name]}"), spawn
