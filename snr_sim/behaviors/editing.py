"""What an edit of its program means for a running machine: which machine, state and variable is which.

Identity: a machine by its path, a state by its name in its machine, a variable by its path. A state whose name alone
has changed keeps its identity: one state of the machine has gone, one is new, and both have the same clauses.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import msgspec

from snr_sim.behaviors.bound import BoundMachine, BoundProgram
from snr_sim.behaviors.program import Block, MachineDef, StateDef, Transition


class Edited(msgspec.Struct):
    """What an edit did.

    Args:
        kept: paths of machines that continue in their state.
        restarted: of those whose state has gone; they are in the initial one.
        stopped: of those that have gone.
        notes: what may surprise.
    """

    kept: list[str] = []
    restarted: list[str] = []
    stopped: list[str] = []
    notes: list[str] = []


@dataclass
class Plan:
    """How each running machine continues.

    Args:
        kept: old and new machine, and the name of the state that the new one is in.
        restarted: old and new machine, and the initial state.
        stopped: machines that have gone.
    """

    kept: list[tuple[BoundMachine, BoundMachine, str]] = field(default_factory=list)
    restarted: list[tuple[BoundMachine, BoundMachine, str]] = field(default_factory=list)
    stopped: list[BoundMachine] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def plan(running: list[BoundMachine], new: BoundProgram) -> Plan:
    """Return how the machines that run at the top, and those inside them, continue."""
    made = Plan()
    initials = {machine.path: initial for machine, initial in new.top}
    for old in running:
        other = new.machines.get(old.path) if old.path in initials else None
        _plan(old, other, initials.get(old.path, ""), made)
    return made


def _plan(old: BoundMachine, new: BoundMachine | None, initial: str, made: Plan) -> None:
    if new is None:
        made.stopped.append(old)
        return
    assert old.state is not None
    name = same_state(old.definition, new.definition, old.state.name)
    if name is None:
        made.restarted.append((old, new, initial))
        made.notes.append(f"State '{old.state.name}' of '{old.path}' has gone: it begins in '{initial}'.")
        return
    made.kept.append((old, new, name))
    before = f"{old.path}/{old.state.name}/"
    spawned = {machine.path: (machine, first) for machine, first in _spawned(new, name)}
    for inner in old.running:
        path = f"{new.path}/{name}/{inner.path.removeprefix(before)}"
        machine, first = spawned.pop(path, (None, ""))
        _plan(inner, machine, first, made)
    made.notes += [f"'{path}' is spawned at the next entry of '{name}'." for path in spawned]


def _spawned(machine: BoundMachine, state: str) -> Iterator[tuple[BoundMachine, str]]:
    for _, spawned in machine.states[state].enter:
        if spawned is not None:
            yield spawned


def same_state(old: MachineDef, new: MachineDef, name: str) -> str | None:
    """Return the name in a new definition of a state of the old one; None if it has gone."""
    names = [one.name for one in new.states]
    if name in names:
        return name
    gone = [one for one in old.states if one.name not in names]
    come = [one for one in new.states if one.name not in [other.name for other in old.states]]
    if len(gone) == len(come) == 1 and _clauses(old, gone[0], name) == _clauses(new, come[0], come[0].name):
        return come[0].name
    return None


def _clauses(machine: MachineDef, state: StateDef, name: str) -> object:
    """Return what a state says, and the transitions of its machine, with the state's own name left out."""
    parts = [
        [one.text if isinstance(one, Block) else (one.machine.name, one.initial) for one in blocks]
        for blocks in (state.enter, state.during, state.leave)
    ]
    return parts, [_arrow(one, name) for one in machine.transitions]


def _arrow(one: Transition, name: str) -> object:
    after = one.after_ns.text if isinstance(one.after_ns, Block) else one.after_ns
    condition = None if one.condition is None else one.condition.text
    ends = ["" if end == name else end for end in (one.source, one.target)]
    return one.kind, ends, one.signal, condition, after


def values_after(old: BoundProgram, new: BoundProgram, renamed: dict[str, str]) -> list[str]:
    """Give the variables of a new program their values; return notes.

    A variable keeps its value, unless it is new or its initial value has changed in the text.

    Args:
        old: of which the values are.
        new: its slots are written.
        renamed: new beginnings of paths by the old ones, which end with '/'.
    """
    notes, longest_first = [], sorted(renamed, key=len, reverse=True)
    for path, place in old.places.items():
        begin = next((one for one in longest_first if path.startswith(one)), "")
        now = renamed.get(begin, "") + path[len(begin) :]
        if now not in new.places:
            continue
        first, value = old.first_values[path], old.slots[place]
        if (type(first), first) == (type(new.first_values[now]), new.first_values[now]):
            new.slots[new.places[now]] = value
        elif (type(first), first) != (type(value), value):
            notes.append(f"'{now}' was {value!r:.80}, and begins with its new initial value.")
    return notes


def parts_of(program: BoundProgram) -> dict[str, set[str]]:
    """Return the parts of the robot that the blocks of each machine command, by path."""
    found: dict[str, set[str]] = {}
    for path, machine in program.machines.items():
        blocks = [one for state in machine.definition.states for one in (*state.enter, *state.during, *state.leave)]
        found[path] = {part for one in blocks if isinstance(one, Block) for part in one.drives}
    return found
