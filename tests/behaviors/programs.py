"""Random programs for property tests: nested machines, every kind of transition, names from a small set."""

from __future__ import annotations

import hashlib
from typing import Any

from hypothesis import strategies as st

from snr_sim.behaviors.export import as_text
from snr_sim.behaviors.program import ANY, Block, MachineDef, Place, Program, Spawn, StateDef, Transition

CONDITIONS = ("near", "wet", "dark")
SIGNALS = ("go", "stop")
TIMES_NS = (0, 10, 20, 50)


def condition(text: str) -> Block:
    """Return a condition that holds if its text is in the page 'holding'."""
    return Block(text, Place(), lambda bindings: lambda m: text in m.data("holding"))


@st.composite
def transitions(draw: Any, names: list[str], around: list[str] | None) -> Transition:
    kinds = ["on", "on", "signal", "ontime", "eps"] + (["exit"] if around else [])
    kind = draw(st.sampled_from(kinds))
    source = draw(st.sampled_from([ANY, *names]))
    target = draw(st.sampled_from(names if kind != "exit" or around is None else around))
    holds = condition(draw(st.sampled_from(CONDITIONS)))
    if kind == "signal":
        return Transition("on", source, target, "", Place(), draw(st.sampled_from(SIGNALS)))
    if kind == "ontime":
        is_guarded = draw(st.booleans())
        return Transition(
            "ontime", source, target, "", Place(), None, holds if is_guarded else None, draw(st.sampled_from(TIMES_NS))
        )
    if kind == "eps":
        return Transition("eps", source, target, "", Place(), None, draw(st.sampled_from([holds, holds, None])))
    if kind == "exit" and draw(st.booleans()):
        return Transition("exit", source, target, "", Place(), draw(st.sampled_from(SIGNALS)))
    return Transition(kind, source, target, "", Place(), None, holds)


@st.composite
def machines(draw: Any, depth: int, around: list[str] | None) -> Spawn:
    names = ["a", "b", "c", "d"][: draw(st.integers(1, 4))]
    states = []
    for name in names:
        count = draw(st.integers(0, 2)) if depth else 0
        inside = tuple(draw(machines(depth - 1, names)) for _ in range(count))
        states.append(StateDef(name, inside))
    arrows = draw(st.lists(transitions(names, around), max_size=6))
    definition = MachineDef(draw(st.sampled_from(["m", "n"])), tuple(states), tuple(arrows))
    return Spawn(definition, draw(st.sampled_from(names)))


@st.composite
def programs(draw: Any) -> Program:
    spawns = tuple(draw(st.lists(machines(2, None), min_size=1, max_size=2)))
    text = as_text(spawns)
    return Program(text, hashlib.sha256(text.encode()).hexdigest(), spawns)


# One step: time that passes [ns], the conditions that hold, a signal or none.
steps = st.tuples(
    st.sampled_from([1, 10, 20, 50]), st.sets(st.sampled_from(CONDITIONS)), st.sampled_from([None, None, *SIGNALS])
)
