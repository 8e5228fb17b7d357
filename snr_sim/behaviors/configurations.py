"""What machines can do with the values that their variables really have: a search through all configurations.

A configuration is the values of the variables and the states of the machines. From each one a step as in
`interpreter.py` is taken, for every signal and for everything unknown: readings, time, random numbers. Machines side
by side are searched together only if they share variables. Not followed are variables that no condition depends on, and
those that have too many values.

Equal values are one: 1, 1.0 and True.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeAlias

from snr_sim.behaviors.bound import BoundMachine, BoundProgram
from snr_sim.behaviors.context import MAX_CHAIN
from snr_sim.behaviors.program import Block, Program, Rule, Transition
from snr_sim.behaviors.unknown import ANY_VALUE, BOTH, UnknownBlock, UnknownWorld, Values

MAX_CONFIGURATIONS = 100_000  # of machines that share variables
MAX_TRANSITIONS = 1_000_000  # that are tried for them
MAX_CASES = 10_000  # to which one step may lead
CERTAIN = (True,)
STEP = "step"  # in a way: a step without a transition, in which a variable has changed


class Way(NamedTuple):
    """How something is reached: the name of a transition, and the way to what was before it."""

    before: Way | None
    name: str


Ways: TypeAlias = dict[tuple[str, str], Way | None]  # by path of the machine and state; None: it begins there


class Violation(NamedTuple):
    """A rule does not hold: the shortest way there, and the values of the variables that it names."""

    way: Way | None
    values: str


@dataclass
class Found:
    """What a search has found of the machines that it has followed.

    Args:
        ways: the shortest to each state that is reached.
        taken: transitions that are taken: path of the machine, state, and index among those of the state.
        counts: numbers of configurations, by the names of the machines at the top.
        violations: of rules that can be false; also found before a variable was left out.
        undecided: names of rules that may be false: they depend on readings, or on variables that are not followed.
        left_out: paths of the variables that have too many values.
    """

    ways: Ways = field(default_factory=dict)
    taken: set[tuple[str, str, int]] = field(default_factory=set)
    counts: dict[tuple[str, ...], int] = field(default_factory=dict)
    violations: dict[Rule, Violation] = field(default_factory=dict)
    undecided: dict[str, None] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()


def search(program: Program) -> Found:
    """Search the machines of a program whose conditions, or rules, depend on variables."""
    bound = BoundProgram(replace(program, rules=()), None)
    named = list(_named(program, bound))
    followed, left_out, violations = _relevant(program, named), set[int](), dict[Rule, Violation]()
    while True:
        found, widest = Found(violations=violations), set[int]()
        for group in _groups(bound, named, followed):
            widest |= _Search(program, bound, group, followed, found).run()
        if not widest:
            found.left_out = tuple(path for path, place in bound.places.items() if place in left_out)
            return found
        followed, left_out = followed - widest, left_out | widest


# -- what is followed -------------------------------------------------------------------------------------------------


class _Named(NamedTuple):
    """The variables that a block names.

    Args:
        path: of its machine; empty of a rule.
        rule: whose condition it is.
        keys, writes: places of those that it names, and assigns.
        is_condition: whether it is one.
        is_known: whether it is of a text: of a function in Python, `writes` are all that it can see.
    """

    path: str
    rule: Rule | None
    keys: frozenset[int]
    writes: frozenset[int]
    is_condition: bool
    is_known: bool


def _named(program: Program, bound: BoundProgram) -> Iterator[_Named]:
    """Yield what each block of a program names."""

    def row(block: Block, index: Mapping[str, int], path: str, is_condition: bool, rule: Rule | None = None) -> _Named:
        keys = frozenset(index[key] for key in block.keys)
        writes = frozenset(index[name] for name in (index if block.writes is None else block.writes))
        return _Named(path, rule, keys, writes, is_condition, block.writes is not None)

    for path, machine in bound.machines.items():
        definition, index = machine.definition, machine.bindings.index
        conditions = [one.condition for one in definition.transitions]
        others = [one.effect for one in definition.transitions]
        others += [
            one if isinstance(one, Block) else None
            for state in definition.states
            for one in (*state.enter, *state.during, *state.leave)
        ]
        for blocks, is_condition in ((conditions, True), (others, False)):
            yield from (row(one, index, path, is_condition) for one in blocks if one is not None)
    for rule in program.rules:
        if rule.kind == "always" and rule.condition is not None:
            yield row(rule.condition, index_of_rules(program, bound), "", True, rule)


def index_of_rules(program: Program, bound: BoundProgram) -> dict[str, int]:
    """Return the places of the variables that rules can see, by name."""
    return {name: bound.places[name.rpartition(".")[2]] for name in program.variables}


def _relevant(program: Program, named: list[_Named]) -> set[int]:
    """Return the places of the variables on which a condition depends, also by other variables."""
    if program.on_error == "stop":  # what a machine leaves behind that an exception has ended is not followed
        return set()
    blocks = [one for one in named if not one.is_condition]
    found, count = set[int]().union(*(one.keys for one in named if one.is_condition)), -1
    while len(found) != count:
        count = len(found)
        found.update(*(one.keys for one in blocks if one.writes & found))
    return found.difference(*(one.writes for one in blocks if not one.is_known))


class _Group(NamedTuple):
    """Machines at the top, by their order, and rules, that share variables which change; `places` of all they name."""

    places: frozenset[int]
    top: tuple[int, ...]
    rules: tuple[Rule, ...]


def _groups(bound: BoundProgram, named: list[_Named], followed: set[int]) -> list[_Group]:
    """Return the groups to be searched."""
    written = frozenset[int]().union(*(one.writes for one in named))
    rows = [_Group(one.keys & followed, (), (one.rule,)) for one in named if one.rule is not None]
    for i, (top, _) in enumerate(bound.top):
        keys = (one.keys for one in named if f"{one.path}/".startswith(f"{top.path}/"))
        rows.append(_Group(frozenset(followed).intersection(frozenset().union(*keys)), (i,), ()))
    made: list[_Group] = []
    for row in rows:
        same = [row, *(one for one in made if one.places & row.places & written)]
        made = [one for one in made if one not in same]
        machines = sorted(i for one in same for i in one.top)
        rules = tuple(rule for one in same for rule in one.rules)
        made.append(_Group(frozenset().union(*(one.places for one in same)), tuple(machines), rules))
    return [one for one in made if one.places or one.rules]


# -- the search -------------------------------------------------------------------------------------------------------


@dataclass(eq=False)
class _Arrow:
    """A transition from one state. `after_ns` is 0 without one; one that is computed is not `is_certain`."""

    definition: Transition
    number: int
    holds: UnknownBlock | None
    effect: UnknownBlock | None
    after_ns: int
    is_certain: bool

    def tests(self, values: Values) -> tuple[bool, ...]:
        """Return what its condition can be."""
        found = CERTAIN if self.holds is None else self.holds.test(values)
        return BOTH if not self.is_certain and True in found else found


@dataclass(eq=False)
class _State:
    """A state, with the machines in it."""

    name: str
    enter: list[UnknownBlock | _Machine]
    during: list[UnknownBlock]
    leave: list[UnknownBlock]
    machines: list[_Machine]
    arrows: list[_Arrow]
    chains: bool
    signals: frozenset[str]


@dataclass(eq=False)
class _Machine:
    """A machine; `at` is the place of its state in a configuration."""

    path: str
    at: int
    around: _Machine | None
    initial: str
    states: dict[str, _State] = field(default_factory=dict)


Case: TypeAlias = tuple[Values, "Way | None", "_Machine | None"]  # after a step, also: the outer machine that has moved


class _TooManyError(Exception):
    """There are too many configurations."""


class _Search:
    """The search through the configurations of one group."""

    def __init__(self, program: Program, bound: BoundProgram, group: _Group, followed: set[int], found: Found) -> None:
        values = [value if i in followed else ANY_VALUE for i, value in enumerate(bound.slots)]
        actions = {name for functions in program.actions.values() for name in functions}
        self._world = UnknownWorld(values, actions)
        self._group, self._found = group, found
        self._begin, self._first = [*values], len(values)
        self._machines: list[_Machine] = []
        self._top = [self._machine(*bound.top[i], None) for i in group.top]
        index = index_of_rules(program, bound)
        self._rules = [
            (
                rule,
                UnknownBlock(rule.condition, index, self._world),
                {key.rpartition(".")[2]: index[key] for key in rule.condition.keys},
            )
            for rule in group.rules
            if rule.condition is not None
        ]
        self._seen: dict[Values, Way | None] = {}
        self._order: list[Values] = []
        self._signals: dict[Values, list[str | None]] = {}  # by the states of the machines
        self._chain: set[tuple[Values, _Machine, _Machine | None, int]] = set()  # that has been followed in a step
        self._count = 0

    def _machine(self, bound: BoundMachine, initial: str, around: _Machine | None) -> _Machine:
        made = _Machine(bound.path, len(self._begin), around, initial)
        self._begin.append(None)
        self._machines.append(made)
        index, world = bound.bindings.index, self._world

        def bound_to(block: Block) -> UnknownBlock:
            return UnknownBlock(block, index, world)

        def arrow(number: int, one: Transition) -> _Arrow:
            holds, effect = (None if block is None else bound_to(block) for block in (one.condition, one.effect))
            is_certain = not isinstance(one.after_ns, Block)
            return _Arrow(one, number, holds, effect, one.after_ns if isinstance(one.after_ns, int) else 0, is_certain)

        for state in bound.definition.states:
            inner = [self._machine(one, first, made) for one, first in bound.states.nested[state.name]]
            left, own = iter(inner), list(bound.definition.transitions_of(state.name))
            made.states[state.name] = _State(
                state.name,
                [bound_to(one) if isinstance(one, Block) else next(left) for one in state.enter],
                [bound_to(one) for one in state.during],
                [bound_to(one) for one in state.leave],
                inner,
                [arrow(i, one) for i, one in enumerate(own)],
                any(one.kind == "eps" for one in own),
                frozenset(one.signal for one in own if one.signal is not None),
            )  # fmt: skip
        return made

    def run(self) -> set[int]:
        """Search; if there are too many configurations, return the places of the variables with most values."""
        try:
            for values in self._spawned([tuple(self._begin)], None, self._top):
                self._add(values, None)
            for values in self._order:  # it grows
                way = self._seen[values]
                for signal in self._signals_in(values):
                    self._chain.clear()
                    for new, new_way, _ in self._stepped([(values, way, None)], self._top, signal):
                        if new not in self._seen:
                            self._add(new, Way(way, STEP) if new_way is way else new_way)
        except _TooManyError:
            return self._widest()
        if self._top:
            self._found.counts[tuple(machine.path for machine in self._top)] = len(self._order)
        return set()

    def _add(self, values: Values, way: Way | None) -> None:
        """Add a configuration, and look at the rules in it."""
        if values in self._seen:
            return
        if len(self._order) == MAX_CONFIGURATIONS:
            raise _TooManyError
        self._seen[values] = way
        self._order.append(values)
        for rule, holds, names in self._rules:
            results = holds.test(values)
            if True not in results and rule not in self._found.violations:
                shown = ", ".join(f"{name} = {values[place]!r}" for name, place in names.items())
                self._found.violations[rule] = Violation(way, shown)
            elif False in results and rule not in self._found.violations:
                self._found.undecided[rule.name] = None

    def _widest(self) -> set[int]:
        """Return the places of the variables that have at least half as many values as any."""
        counts = {place: len({values[place] for values in self._order}) for place in self._group.places}
        return {place for place, count in counts.items() if 2 * count >= max(counts.values())}

    def _signals_in(self, values: Values) -> list[str | None]:
        """Return the signals that a state waits for, and None."""
        states = values[self._first :]
        found = self._signals.get(states)
        if found is None:
            active = (one.states[values[one.at]] for one in self._machines if values[one.at] is not None)
            found = self._signals[states] = [None, *sorted(frozenset().union(*(one.signals for one in active)))]
        return found

    # -- one step: see interpreter.py ---------------------------------------------------------------------------------

    def _stepped(self, cases: list[Case], machines: list[_Machine], signal: str | None) -> list[Case]:
        """Return what can be after the steps of machines side by side; none follows an exit of one before it."""
        for machine in machines:
            cases = [
                case
                for values, way, moved in cases
                for case in ([(values, way, moved)] if moved else self._step(values, way, machine, signal))
            ]
            if len(cases) > MAX_CASES:
                raise _TooManyError
        return cases

    def _step(self, values: Values, way: Way | None, machine: _Machine, signal: str | None) -> list[Case]:
        state = machine.states[values[machine.at]]
        made: list[Case] = []
        limit_ns = math.inf  # from then on a transition above is taken for certain
        for arrow in state.arrows:
            if arrow.definition.signal not in (None, signal) or arrow.after_ns >= limit_ns:
                continue
            results = arrow.tests(values)
            if True in results:
                made += self._take(values, way, machine, arrow, MAX_CHAIN, None)
            if False not in results:
                limit_ns = arrow.after_ns
        if limit_ns <= 0:
            return made
        during = self._executed([values], state.during)
        if not state.machines:
            return made + [(one, way, None) for one in during]
        cases = self._stepped([(one, way, None) for one in during], state.machines, signal)
        return made + [(new, after, None if moved is machine else moved) for new, after, moved in cases]

    def _take(
        self, values: Values, way: Way | None, machine: _Machine, arrow: _Arrow, left: int, moved: _Machine | None
    ) -> list[Case]:
        """Return what can be after a transition and `left` more that follow at once."""
        self._count += 1
        if self._count > MAX_TRANSITIONS:
            raise _TooManyError
        self._found.taken.add((machine.path, values[machine.at], arrow.number))
        way = Way(way, arrow.definition.name)
        if arrow.definition.kind == "exit":
            assert machine.around is not None
            machine = moved = machine.around
        target = machine.states[arrow.definition.target]
        cases = self._left([values], machine)
        if arrow.effect is not None:
            cases = self._executed(cases, [arrow.effect])
        made: list[Case] = []
        for entered in self._entered(cases, way, machine, target):
            made += self._following(entered, way, machine, target, left - 1, moved)
        return made

    def _following(
        self, values: Values, way: Way, machine: _Machine, state: _State, left: int, moved: _Machine | None
    ) -> list[Case]:
        """Return what can be after a state was entered: it, or what follows at once."""
        if not (state.chains and left):
            return [(values, way, moved)]
        key = values, machine, moved, left
        if key in self._chain:  # another way to what has been followed
            return []
        self._chain.add(key)
        made: list[Case] = []
        for arrow in state.arrows:
            if arrow.definition.signal is not None or arrow.after_ns > 0:
                continue
            results = arrow.tests(values)
            if True in results:
                made += self._take(values, way, machine, arrow, left, moved)
            if False not in results:
                break
        else:
            made.append((values, way, moved))
        return made

    def _left(self, cases: list[Values], machine: _Machine) -> list[Values]:
        """Return what can be after the state of a machine is left; the machines inside first, the last one first."""
        state = machine.states[cases[0][machine.at]]
        for inner in reversed(state.machines):
            cases = [_with(values, inner.at, None) for values in self._left(cases, inner)]
        return self._executed(cases, state.leave)

    def _entered(self, cases: list[Values], way: Way | None, machine: _Machine, state: _State) -> list[Values]:
        self._found.ways.setdefault((machine.path, state.name), way)
        cases = [_with(values, machine.at, state.name) for values in cases]
        for one in state.enter:
            cases = self._spawned(cases, way, [one]) if isinstance(one, _Machine) else self._executed(cases, [one])
        return cases

    def _spawned(self, cases: list[Values], way: Way | None, machines: list[_Machine]) -> list[Values]:
        for one in machines:
            cases = self._entered(cases, way, one, one.states[one.initial])
        return cases

    def _executed(self, cases: list[Values], blocks: list[UnknownBlock]) -> list[Values]:
        for block in blocks:
            cases = [after for values in cases for after in block.after(values)]
        return cases


def _with(values: Values, place: int, value: object) -> Values:
    return (*values[:place], value, *values[place + 1 :])
