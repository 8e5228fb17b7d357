"""What machines can do at all: a search through their states, without a robot.

Each signal, reading and time-out may come at any moment. So a state that the search does not reach cannot be reached in
any run, unless a user sets a variable; one that it reaches may still be out of reach for the physics.

Where conditions depend on variables, their values are followed: see `configurations.py`. Other machines side by side do
not hold each other up, so each is searched by itself, in the states in which it runs. Time-outs of one state are
compared by their numbers: one that is due no earlier than another one above it never fires.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from math import prod
from typing import NamedTuple

from snr_sim.behaviors.configurations import Way, Ways, search
from snr_sim.behaviors.program import MachineDef, Place, Program, Spawn, Transition, with_names

# Names of states that are meant to be the last.
ENDS = ("done", "end", "ended", "stop", "stopped", "finished", "landed", "failed", "off", "home")


@dataclass(frozen=True)
class Finding:
    """Something that may be a mistake.

    Args:
        kind: 'unreachable', 'dead_end', 'hidden', 'never', 'violated', 'eps_cycle' or 'only_time'.
        machine: path of the machine; empty of a rule.
        name: of the state, the transition or the rule.
        place: of it in the program.
        message: what was found.
        way: to the state; None at the start, and of what cannot be reached.
    """

    kind: str
    machine: str
    name: str
    place: Place
    message: str
    way: Way | None = field(default=None, compare=False, repr=False)

    @property
    def word(self) -> tuple[str, ...]:
        """Names of the transitions that lead there, as few as possible."""
        names, way = list[str](), self.way
        while way is not None:
            names.append(way.name)
            way = way.before
        return tuple(reversed(names))


class Explored(NamedTuple):
    """What a search has found.

    Args:
        findings: in the order of the text.
        configurations: how many there are.
        left_out: paths of variables that have too many values: what depends on them may be true or false.
        undecided: names of rules of which a reading decides.
    """

    findings: list[Finding]
    configurations: int
    left_out: tuple[str, ...]
    undecided: tuple[str, ...]


def explore(program: Program) -> Explored:
    """Search a program."""
    found, named = search(program), dict(with_names(program.spawns))
    followed = {name for names in found.counts for name in names}
    ways = {key: way for key, way in _ways(program.spawns).items() if key[0].split("/")[0] not in followed} | found.ways
    others = [_configurations(spawn.machine, name, ways) for name, spawn in named.items() if name not in followed]
    count = sum(others) + sum(found.counts.values())  # exact: integers
    rows = [
        Finding("violated", "", rule.name, rule.place, f"'{rule.name}' can be false: {values or 'always'}.", way)
        for rule, (way, values) in found.violations.items()
    ]
    violated = {one.name for one in rows}
    for name, spawn in named.items():
        taken = found.taken if name in followed else None
        rows += _findings(spawn.machine, name, ways, taken, has_way_out=False)
    return Explored(
        _ordered(rows), count, found.left_out, tuple(name for name in found.undecided if name not in violated)
    )


def findings(spawns: tuple[Spawn, ...]) -> list[Finding]:
    """Return what is found in machines that run side by side without following variables, in the order of the text."""
    ways = _ways(spawns)
    return _ordered(
        one
        for name, spawn in with_names(spawns)
        for one in _findings(spawn.machine, name, ways, None, has_way_out=False)
    )


def _ordered(found: Iterable[Finding]) -> list[Finding]:
    return sorted(found, key=lambda one: (one.place.line, one.place.column))


# -- the search -------------------------------------------------------------------------------------------------------


class _At(NamedTuple):
    """A machine at its place, and the one around it."""

    path: str
    machine: MachineDef
    around: _At | None


def _ways(spawns: tuple[Spawn, ...]) -> Ways:
    """Return the shortest way to each state that can be reached."""
    found: Ways = {}
    left: deque[tuple[_At, str, Way | None]] = deque(
        (_At(name, spawn.machine, None), spawn.initial, None) for name, spawn in with_names(spawns)
    )
    expected = set[tuple[str, str]]()  # those that a transition leads to
    while left:
        at, name, way = left.popleft()
        if (at.path, name) in found:
            continue
        found[at.path, name] = way
        for one in at.machine.transitions_of(name):
            to = at.around if one.kind == "exit" else at
            if to is not None and (to.path, one.target) not in expected:
                expected.add((to.path, one.target))
                left.append((to, one.target, Way(way, one.name)))
        left.extendleft(  # first, as no transition is needed
            (_At(f"{at.path}/{name}/{inner}", spawn.machine, at), spawn.initial, way)
            for inner, spawn in with_names(at.machine.by_name[name].spawns)
        )
    return found


def _configurations(machine: MachineDef, path: str, ways: Ways) -> int:
    """Return in how many ways a machine and those inside it can be in their states."""
    reached = [one for one in machine.states if (path, one.name) in ways]
    inside = [[(f"{path}/{one.name}/{name}", spawn) for name, spawn in with_names(one.spawns)] for one in reached]
    return sum(prod(_configurations(spawn.machine, at, ways) for at, spawn in row) for row in inside)  # exact: integers


# -- what it says -----------------------------------------------------------------------------------------------------


def _findings(
    machine: MachineDef, path: str, ways: Ways, taken: set[tuple[str, str, int]] | None, *, has_way_out: bool
) -> Iterator[Finding]:
    """Yield what was found in a machine and in those inside its states.

    Args:
        machine: at its place.
        path: of it.
        ways: to the states that are reached.
        taken: transitions that are; None: any may be. See `configurations.Found`.
        has_way_out: whether the state around it can be left.
    """
    yield from _eps_cycles(machine, path)
    for state in machine.states:
        if (path, state.name) not in ways:
            yield Finding("unreachable", path, state.name, state.place, f"No run can reach state '{state.name}'.")
            continue
        way, own = ways[path, state.name], list(machine.transitions_of(state.name))
        possible = [one for i, one in enumerate(own) if taken is None or (path, state.name, i) in taken]
        impossible = {id(one) for one in own} - {id(one) for one in possible}
        can_leave = bool(possible) or has_way_out
        exits = any(one.kind == "exit" for inner in state.spawns for one in inner.machine.transitions)
        if not (can_leave or exits or state.name.lower() in ENDS):
            message = f"State '{state.name}' cannot be left."
            yield Finding("dead_end", path, state.name, state.place, message, way)
        elif possible and not exits and not has_way_out and all(one.kind == "ontime" for one in possible):
            message = f"Only time leaves state '{state.name}': no event can end it earlier."
            yield Finding("only_time", path, state.name, state.place, message, way)
        hidden = {id(one): above for one, above in _hidden(own)}
        for one in own:
            if above := hidden.get(id(one)):
                message = (
                    f"Transition '{one.name}' is never taken: '{above.name}' in line {above.place.line} comes first."
                )
                yield Finding("hidden", path, one.name, one.place, message, way)
            elif id(one) in impossible:
                message = (
                    f"Transition '{one.name}' is never taken from state '{state.name}', whatever the readings are."
                )
                yield Finding("never", path, one.name, one.place, message, way)
        for name, inner in with_names(state.spawns):
            yield from _findings(inner.machine, f"{path}/{state.name}/{name}", ways, taken, has_way_out=can_leave)


def _hidden(own: list[Transition]) -> Iterator[tuple[Transition, Transition]]:
    """Yield the transitions of a state that one above them always comes before, with that one."""
    earliest: dict[tuple[object, object], tuple[int, int, Transition]] = {}  # by signal and condition: time, index
    for i, one in enumerate(own):
        bind = None if one.condition is None else one.condition.bind
        time = one.after_ns if isinstance(one.after_ns, int) else 0 if one.after_ns is None else None
        causes = {(signal, holds) for signal in (None, one.signal) for holds in (None, bind)}
        rows = [earliest[cause] for cause in causes if cause in earliest]
        above = [row for row in rows if row[0] <= (time or 0)]
        if above:
            yield one, min(above, key=lambda row: row[1])[2]
        elif time is not None:  # of a time that is computed nothing is known
            earliest[one.signal, bind] = time, i, one


def _eps_cycles(machine: MachineDef, path: str) -> Iterator[Finding]:
    """Yield circles of transitions that are taken at once, which a step would cut: the shortest through each state that
    is in none of those before."""
    following = {
        state.name: [one for one in machine.transitions_of(state.name) if one.kind == "eps" and not one.after_ns]
        for state in machine.states
    }
    reported: set[str] = set()
    for begin in machine.states:
        if begin.name in reported:
            continue
        before: dict[str, tuple[str, Transition]] = {}  # by its target, the first that leads there, and from where
        left = [begin.name]
        for state in left:  # breadth first: it grows
            new = [one for one in following.get(state, ()) if one.target in following and one.target not in before]
            before |= {one.target: (state, one) for one in reversed(new)}
            left += dict.fromkeys(one.target for one in new)
        if begin.name not in before:
            following.pop(begin.name, None)  # no circle leads through it
            continue
        names = [begin.name, before[begin.name][0]]
        while names[-1] != begin.name:
            names.append(before[names[-1]][0])
        reported.update(names)
        message = f"These states follow each other at once: {' -> '.join(reversed(names))}."
        yield Finding("eps_cycle", path, begin.name, before[begin.name][1].place, message)
