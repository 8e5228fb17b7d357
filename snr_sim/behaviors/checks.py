"""What is wrong with machines, whichever front end made them, before they run."""

from __future__ import annotations

from collections.abc import Iterator

from snr_sim.behaviors.explore import findings
from snr_sim.behaviors.program import ANY, MachineDef, Problem, Spawn, StateDef
from snr_sim.prelude.errors import suggest

MAX_STATES = 10_000  # of a program, in all places of its machines
MAX_TRANSITIONS = 50_000  # that leave these states; one of `*` leaves each
MAX_LEVELS = 100  # of machines in states of machines
_FIXES = {
    "unreachable": "let a transition lead there, or leave it out.",
    "hidden": "write it above that one, or leave one of them out.",
    "eps_cycle": "a condition for one of these transitions.",
    "dead_end": "let a transition leave it; a state that is the end can be named done.",
}


def problems_of(spawns: tuple[Spawn, ...]) -> list[Problem]:
    """Return the mistakes in machines that run side by side, and in those inside them; then what is doubtful."""
    extents = [spawn.machine.extent for spawn in spawns]
    states, transitions = (sum(one[i] for one in extents) for i in (0, 1))  # exact: integers
    if states > MAX_STATES or transitions > MAX_TRANSITIONS or any(levels > MAX_LEVELS for *_, levels in extents):
        what = f"The program has more than {MAX_STATES} states, more than {MAX_TRANSITIONS} transitions out of them, "
        what += f"or more than {MAX_LEVELS} levels of machines."
        return [Problem(spawns[0].place, what, "a machine counts as often as it is spawned: split the program.")]
    mistakes = [problem for spawn in spawns for problem in _problems(spawn, None)]
    return mistakes or doubts_of(spawns)


def doubts_of(spawns: tuple[Spawn, ...], *, also_ends: bool = False) -> list[Problem]:
    """Return what is doubtful in machines without mistakes.

    Args:
        spawns: the machines.
        also_ends: whether a state that cannot be left is doubtful: a machine that is run may be meant to end there.
    """
    kinds = {kind: fix for kind, fix in _FIXES.items() if also_ends or kind != "dead_end"}
    return [
        Problem(one.place, one.message, kinds[one.kind], is_error=False)
        for one in findings(spawns)
        if one.kind in kinds
    ]


def _problems(spawn: Spawn, around: MachineDef | None) -> Iterator[Problem]:
    machine = spawn.machine
    names = [one.name for one in machine.states]
    first: dict[str, StateDef] = {}
    for state in machine.states:
        if first.setdefault(state.name, state) is not state:
            yield Problem(state.place, f"Machine '{machine.name}' has two states '{state.name}'.", "rename one.")
    if not names:
        yield Problem(machine.place, f"Machine '{machine.name}' has no state.", 'states=[state("waiting"), ...].')
        return
    if spawn.initial not in names:
        yield Problem(
            spawn.place,
            f"Machine '{machine.name}' begins in '{spawn.initial}', which is not one of its states.",
            suggest(str(spawn.initial), names),
        )
    yield from _of_transitions(machine, names, around)
    for state in machine.states:
        for inner in state.spawns:
            yield from _problems(inner, machine)


def _of_transitions(machine: MachineDef, names: list[str], around: MachineDef | None) -> Iterator[Problem]:
    for one in machine.transitions:
        what = f"Transition '{one.name}' of machine '{machine.name}'"
        if one.source not in (ANY, *names):
            yield Problem(
                one.place, f"{what} begins in '{one.source}', which is not a state.", suggest(one.source, names)
            )
        if one.kind != "exit":
            targets = names
        elif around is not None:
            targets = [state.name for state in around.states]
        else:  # it may be put into a state yet: see `exits_at_top`
            continue
        if one.target not in targets:
            yield Problem(
                one.place, f"{what} leads to '{one.target}', which is not a state.", suggest(str(one.target), targets)
            )


def exits_at_top(spawns: tuple[Spawn, ...]) -> list[Problem]:
    """Return the exits of machines that are in no state of another one."""
    return [
        Problem(
            one.place,
            f"Transition '{one.name}' of machine '{spawn.machine.name}' leaves the machine around it; there is none.",
            "put the machine into a state of another one, or write on(...).",
        )
        for spawn in spawns
        for one in spawn.machine.transitions
        if one.kind == "exit"
    ]
