"""What a program can do at all: a search through the states of its machines, without a robot.

Each signal, condition and time-out may come at any moment; values of variables and readings are not followed. So a
state that the search does not reach cannot be reached in any run; one that it reaches may still be out of reach for the
physics, or for what the variables are then. Machines that run side by side at the top are searched one by one.

Time-outs of one state are compared by their numbers: one that is due no earlier than another one above it never fires.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

from snr_sim.behaviors.program import MachineDef, Place, Program, Spawn, StateDef, Transition, with_names

MAX_CONFIGURATIONS = 100_000
# Names of states that are meant to be the last.
ENDS = ("done", "end", "ended", "stop", "stopped", "finished", "landed", "failed", "off", "home")

# The state of a machine, and the configurations of the machines inside it.
Configuration: TypeAlias = "tuple[str, tuple[Configuration, ...]]"


@dataclass(frozen=True)
class Finding:
    """Something that may be a mistake.

    Args:
        kind: 'unreachable', 'dead_end', 'hidden', 'eps_cycle', 'only_time' or 'unfinished'.
        machine: path of the machine.
        name: of the state or the transition.
        place: of it in the program.
        message: what was found.
        word: names of the transitions that lead there; empty at the start, and of what cannot be reached.
    """

    kind: str
    machine: str
    name: str
    place: Place
    message: str
    word: tuple[str, ...] = ()


def explore(program: Program) -> tuple[list[Finding], int]:
    """Return what was found in a program, in the order of its text, and how many configurations there are."""
    found: list[Finding] = []
    count = 0
    for name, spawn in with_names(program.spawns):
        words, size, is_whole = _search(spawn, name)
        count += size
        if not is_whole:
            found.append(
                Finding(
                    "unfinished", name, name, spawn.place,
                    f"More than {MAX_CONFIGURATIONS} configurations: what was not reached is not reported.",
                )
            )  # fmt: skip
        found += _findings(spawn, name, words, is_whole, has_way_out=False)
    return sorted(found, key=lambda one: (one.place.line, one.place.column)), count


# -- the search -------------------------------------------------------------------------------------------------------


def _search(spawn: Spawn, name: str) -> tuple[dict[tuple[str, str], tuple[str, ...]], int, bool]:
    """Return the shortest word to each state, by path of the machine and name; the number of configurations; and
    whether that is all of them."""
    machine = spawn.machine
    begin: Configuration = spawn.initial, _inside(machine, spawn.initial)
    words: dict[tuple[str, str], tuple[str, ...]] = {}
    before: dict[Configuration, tuple[str, ...]] = {begin: ()}
    left = deque([begin])
    while left:
        configuration = left.popleft()
        word = before[configuration]
        for key in _states_in(machine, configuration, name):
            words.setdefault(key, word)
        for label, following, _ in _moves(machine, configuration):
            if following is not None and following not in before:
                if len(before) >= MAX_CONFIGURATIONS:
                    return words, len(before), False
                before[following] = (*word, label)
                left.append(following)
    return words, len(before), True


def _inside(machine: MachineDef, state: str) -> tuple[Configuration, ...]:
    """Return the configurations in which the machines inside a state begin."""
    return tuple((one.initial, _inside(one.machine, one.initial)) for one in _state(machine, state).spawns)


def _state(machine: MachineDef, name: str) -> StateDef:
    return next(one for one in machine.states if one.name == name)


def _states_in(machine: MachineDef, configuration: Configuration, path: str) -> Iterator[tuple[str, str]]:
    state, inside = configuration
    yield path, state
    for (name, spawn), inner in zip(with_names(_state(machine, state).spawns), inside, strict=True):
        yield from _states_in(spawn.machine, inner, f"{path}/{state}/{name}")


def _moves(machine: MachineDef, configuration: Configuration) -> Iterator[tuple[str, Configuration | None, str | None]]:
    """Yield each transition: its name, the configuration after it, and of an exit the state around that it leads to."""
    state, inside = configuration
    for one in machine.transitions_of(state):
        if one.kind == "exit":
            yield one.name, None, one.target
        else:
            yield one.name, (one.target, _inside(machine, one.target)), None
    for i, (spawn, inner) in enumerate(zip(_state(machine, state).spawns, inside, strict=True)):
        for label, following, target in _moves(spawn.machine, inner):
            if target is not None:
                yield label, (target, _inside(machine, target)), None
            elif following is not None:
                yield label, (state, (*inside[:i], following, *inside[i + 1 :])), None


# -- what it says -----------------------------------------------------------------------------------------------------


def _findings(
    spawn: Spawn, path: str, words: dict[tuple[str, str], tuple[str, ...]], is_whole: bool, *, has_way_out: bool
) -> Iterator[Finding]:
    """Yield what was found in a machine and in those inside its states.

    Args:
        spawn: the machine, at its place.
        path: of it.
        words: to the states that are reached.
        is_whole: whether the search looked at everything.
        has_way_out: whether the state around it can be left.
    """
    machine = spawn.machine
    yield from _eps_cycles(machine, path)
    for state in machine.states:
        word = words.get((path, state.name))
        own = list(machine.transitions_of(state.name))
        if word is None:
            if is_whole:
                message = f"No run can reach state '{state.name}'."
                yield Finding("unreachable", path, state.name, state.place, message)
            continue
        can_leave = bool(own) or has_way_out
        exits = any(one.kind == "exit" for inner in state.spawns for one in inner.machine.transitions)
        if not (can_leave or exits or state.name.lower() in ENDS):
            message = f"State '{state.name}' cannot be left."
            yield Finding("dead_end", path, state.name, state.place, message, word)
        elif own and not exits and not has_way_out and all(one.kind == "ontime" for one in own):
            message = f"Only time leaves state '{state.name}': no event can end it earlier."
            yield Finding("only_time", path, state.name, state.place, message, word)
        yield from _hidden(own, path, word)
        for name, inner in with_names(state.spawns):
            yield from _findings(inner, f"{path}/{state.name}/{name}", words, is_whole, has_way_out=can_leave)


def _hidden(own: list[Transition], path: str, word: tuple[str, ...]) -> Iterator[Finding]:
    """Yield the transitions of a state that one above them always comes before."""
    for i, one in enumerate(own):
        above = next((other for other in own[:i] if _hides(other, one)), None)
        if above is not None:
            message = f"Transition '{one.name}' is never taken: '{above.name}' in line {above.place.line} comes first."
            yield Finding("hidden", path, one.name, one.place, message, word)


def _hides(above: Transition, one: Transition) -> bool:
    """Return whether a transition is given whenever another one, which is tried later, is."""
    if above.signal is not None and above.signal != one.signal:
        return False
    if above.condition is not None and (one.condition is None or above.condition.bind != one.condition.bind):
        return False
    if above.after_ns is None:
        return True
    both = isinstance(above.after_ns, int), isinstance(one.after_ns, int)
    if all(both):
        return above.after_ns <= one.after_ns  # type: ignore[operator]
    return False


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
        before: dict[str, Transition] = {}  # by its target, the first transition that leads there
        left = [begin.name]
        for state in left:  # breadth first: it grows
            new = [one for one in following.get(state, ()) if one.target in following and one.target not in before]
            before |= {one.target: one for one in reversed(new)}
            left += dict.fromkeys(one.target for one in new)
        if begin.name not in before:
            following.pop(begin.name, None)  # no circle leads through it
            continue
        way = [before[begin.name]]
        while way[0].source != begin.name:
            way.insert(0, before[way[0].source])
        reported.update(one.source for one in way)
        message = f"These states follow each other at once: {' -> '.join([*(one.source for one in way), begin.name])}."
        yield Finding("eps_cycle", path, begin.name, way[-1].place, message)
