"""What differs between two programs: machines, states, transitions, variables; not comments, white space and lines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from snr_sim.behaviors.editing import cause_of, clauses_of, code_of, same_state
from snr_sim.behaviors.program import MachineDef, Program


class Difference(NamedTuple):
    """One difference.

    Args:
        what: 'machine', 'state', 'transition', 'variable', 'rule' or 'program'.
        machine: path of the machine; empty for the whole program.
        name: of what differs.
        how: 'added', 'removed', 'renamed to b', 'onentry changed', ...
        line: in the new program; of what was removed, in the old one.
        old_line: in the old program, of a transition that is in both.
    """

    what: str
    machine: str
    name: str
    how: str
    line: int
    old_line: int = 0


def differences(old: Program, new: Program) -> list[Difference]:
    """Return what differs, in the order of the machines."""
    found = list(_of_values("", old.variables, new.variables, 0))
    rules = [
        {f"{one.kind} {one.name}": (code_of(one.condition), one.place.line) for one in p.rules} for p in (old, new)
    ]
    found += _of_rows("rule", "", *rules)
    if old.on_error != new.on_error:
        found.append(Difference("program", "", "onerror", f"{old.on_error} is now {new.on_error}", 0))
    before, after = dict(old.walk()), dict(new.walk())
    for path, spawn in before.items():
        if path not in after:
            found.append(Difference("machine", path, path, "removed", spawn.place.line))
    for path, spawn in after.items():
        if path not in before:
            found.append(Difference("machine", path, path, "added", spawn.place.line))
            continue
        was = before[path]
        if was.initial != spawn.initial:
            how = f"begins in {spawn.initial}, not {was.initial}"
            found.append(Difference("machine", path, path, how, spawn.place.line))
        found += _of_machine(path, was.machine, spawn.machine)
    return found


def _of_machine(path: str, old: MachineDef, new: MachineDef) -> Iterator[Difference]:
    yield from _of_values(path, old.variables, new.variables, new.place.line)
    renamed = {one.name: same_state(old, new, one.name) or one.name for one in old.states}
    for state in old.states:
        name = renamed[state.name]
        if name not in new.by_name:
            yield Difference("state", path, state.name, "removed", state.place.line)
            continue
        line, were, clauses = new.by_name[name].place.line, clauses_of(state), clauses_of(new.by_name[name])
        if name != state.name:
            yield Difference("state", path, state.name, f"renamed to {name}", line)
        if changed := [clause for clause in were if were[clause] != clauses[clause]]:
            yield Difference("state", path, name, f"{', '.join(changed)} changed", line)
    for state in new.states:
        if state.name not in renamed.values():
            yield Difference("state", path, state.name, "added", state.place.line)
    arrows = _arrows(old, renamed), _arrows(new, {})
    yield from _of_rows("transition", path, *arrows)
    common = [[key for key in one if all(key in other for other in arrows)] for one in arrows]
    if common[0] != common[1]:
        yield Difference("machine", path, path, "order of its transitions changed", new.place.line)


def _of_values(path: str, old: Mapping[str, Any], new: Mapping[str, Any], line: int) -> Iterator[Difference]:
    rows = [{key.rpartition(".")[2]: (repr(value), line) for key, value in one.items()} for one in (old, new)]
    return _of_rows("variable", path, *rows)


def _of_rows(
    what: str, path: str, old: Mapping[str, tuple[Any, int]], new: Mapping[str, tuple[Any, int]]
) -> Iterator[Difference]:
    """Yield the differences of what has a name, a content and a line."""
    for name, (content, line) in {**old, **new}.items():
        if name not in new:
            yield Difference(what, path, name, "removed", line)
        elif name not in old:
            yield Difference(what, path, name, "added", line)
        elif old[name][0] != content:
            yield Difference(what, path, name, "changed", line, old[name][1])


def _arrows(machine: MachineDef, renamed: Mapping[str, str]) -> dict[str, tuple[Any, int]]:
    """Return what each transition says, and its line, by its name; a second one of a name gets a number."""
    found: dict[str, tuple[Any, int]] = {}
    names = Counter[str]()
    for one in machine.transitions:
        source, target = renamed.get(one.source, one.source), renamed.get(one.target, one.target)
        name = f"{source}->{target}" if one.name == f"{one.source}->{one.target}" else one.name
        names[name] += 1
        found[name if names[name] == 1 else f"{name} #{names[name]}"] = (source, target, *cause_of(one)), one.place.line
    return found
