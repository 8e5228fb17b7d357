"""Programs as text and as drawings: a listing, mermaid, DOT and SCXML."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Literal, TypeAlias
from xml.sax.saxutils import escape, quoteattr

from snr_sim.behaviors.context import NS_PER_MS
from snr_sim.behaviors.program import Block, MachineDef, Program, Spawn, StateDef, Transition, with_names

Format: TypeAlias = Literal["mermaid", "dot", "scxml", "text"]
# How often a transition was taken: by the path of its machine, the state that it leaves, its name and its line. With an
# empty name, and line 0: whether the state was reached.
Counts: TypeAlias = Mapping[tuple[str, str, str, int], int]


def draw(program: Program, to: Format = "mermaid", counts: Counts | None = None) -> str:
    """Return a program in a format that other tools read.

    Args:
        to: 'mermaid' is drawn by many editors and web pages, 'dot' by Graphviz; 'scxml' is W3C's for state machines;
            'text' is a listing.
        counts: shown at the arrows of mermaid and dot, where states that were not reached are dashed: see coverage.py.
    """
    if to in ("mermaid", "dot"):
        return (_mermaid if to == "mermaid" else _dot)(program.spawns, counts)
    return (_scxml if to == "scxml" else as_text)(program.spawns)


# -- listing ----------------------------------------------------------------------------------------------------------


def as_text(spawns: tuple[Spawn, ...]) -> str:
    """Return a listing of machines: everything that a program says, code by its name."""
    lines = [line for spawn in spawns for line in _machine_lines(spawn.machine, "")]
    lines += [f"(spawn {spawn.machine.name} {spawn.initial})" for spawn in spawns]
    return "\n".join([*lines, ""])


def _machine_lines(machine: MachineDef, indent: str) -> Iterator[str]:
    yield f"{indent}(machine {machine.name}"
    inner = indent + "  "
    for name, value in machine.variables.items():
        yield f"{inner}(var {name} := [{value!r}])"
    for state in machine.states:
        yield from _state_lines(state, inner)
    for one in machine.transitions:
        effect = "" if one.effect is None else f" [{one.effect.text}]"
        yield f"{inner}({one.kind}{_events(one)} {one.source} -> {one.target} {one.name}{effect})"
    yield f"{indent})"


def _state_lines(state: StateDef, indent: str) -> Iterator[str]:
    yield f"{indent}(state {state.name}"
    for kind, blocks in (("onentry", state.enter), ("running", state.during), ("onexit", state.leave)):
        for one in blocks:
            if isinstance(one, Block):
                yield f"{indent}  ({kind} [{one.text}])"
            else:
                yield from _machine_lines(one.machine, indent + "  ")
                yield f"{indent}  ({kind} (spawn {one.machine.name} {one.initial}))"
    yield f"{indent})"


def _events(one: Transition) -> str:
    words = [] if one.signal is None else [one.signal]
    if one.after_ns is not None:
        words.append(f"[{one.after_ns.text}]" if isinstance(one.after_ns, Block) else f"{one.after_ns / NS_PER_MS:g}")
    if one.condition is not None:
        words.append(f"[{one.condition.text}]")
    return "".join(f" {word}" for word in words)


def _label(one: Transition, path: str = "", state: str = "", counts: Counts | None = None) -> str:
    """Return what is written at an arrow: `stop`, `after 2 s`, `[is_near] / count`; with its count."""
    words = [] if one.signal is None else [one.signal]
    if isinstance(one.after_ns, Block):
        words.append(f"after {one.after_ns.line}")
    elif one.after_ns is not None:
        words.append(f"after {one.after_ns / 1e9:g} s")
    if one.condition is not None:
        words.append(f"[{one.condition.line}]")
    if one.effect is not None:
        words.append(f"/ {one.effect.line}")
    count = "" if counts is None else f" ({counts[path, state, one.name, one.place.line]} times)"
    return (" ".join(words) or "at once") + count


# -- mermaid ----------------------------------------------------------------------------------------------------------


def _mermaid(spawns: tuple[Spawn, ...], counts: Counts | None) -> str:
    lines, ids = ["stateDiagram-v2"], _Ids()
    for name, spawn in with_names(spawns):
        inside = _mermaid_machine(spawn, name, ids, counts, "        ")
        lines += [f'    state "{name}" as {ids[name]} {{', *inside, "    }"]
    if counts is not None:
        lines.append("    classDef unreached fill:#eee,color:#777,stroke-dasharray:4")
    return "\n".join([*lines, ""])


class _Ids(dict[str, str]):
    """Names of letters, digits and '_', by paths, each another one."""

    def __init__(self) -> None:
        super().__init__()
        self._used: set[str] = set()

    def __missing__(self, path: str) -> str:
        found = re.sub(r"\W", "_", path)
        while found in self._used:
            found += "_"
        self._used.add(found)
        self[path] = found
        return found


def _mermaid_machine(spawn: Spawn, path: str, ids: _Ids, counts: Counts | None, indent: str) -> Iterator[str]:
    machine = spawn.machine
    yield f"{indent}[*] --> {ids[f'{path}/{spawn.initial}']}"
    for state in machine.states:
        own = ids[f"{path}/{state.name}"]
        yield f'{indent}state "{state.name}" as {own}'
        if state.spawns:
            yield f"{indent}state {own} {{"
            for i, (name, inner) in enumerate(with_names(state.spawns)):
                if i:
                    yield f"{indent}    --"
                yield from _mermaid_machine(inner, f"{path}/{state.name}/{name}", ids, counts, indent + "    ")
            yield f"{indent}}}"
        if counts is not None and not counts[path, state.name, "", 0]:
            yield f"{indent}class {own} unreached"
    for state in machine.states:
        for one in machine.transitions_of(state.name):
            own = ids[f"{path}/{state.name}"]
            label = _label(one, path, state.name, counts).replace(":", " ")
            if one.kind == "exit":  # an arrow across a border is not drawn
                yield f"{indent}note right of {own} : {label}, leaves to {one.target}"
            else:
                yield f"{indent}{own} --> {ids[f'{path}/{one.target}']} : {label}"


# -- DOT --------------------------------------------------------------------------------------------------------------


def _dot(spawns: tuple[Spawn, ...], counts: Counts | None) -> str:
    lines = ["digraph machines {", "  compound=true; node [shape=box, style=rounded]; edge [fontsize=10];"]
    for name, spawn in with_names(spawns):
        lines += _dot_machine(name, spawn, name, None, counts, "  ")
    return "\n".join([*lines, "}", ""])


def _dot_machine(
    name: str, spawn: Spawn, path: str, around: str | None, counts: Counts | None, indent: str
) -> Iterator[str]:
    machine, inner = spawn.machine, indent + "  "
    yield f'{indent}subgraph "cluster_{path}" {{ label="{name}";'
    yield f'{inner}"{path}/" [shape=point]; "{path}/" -> "{path}/{spawn.initial}";'
    for state in machine.states:
        is_unreached = counts is not None and not counts[path, state.name, "", 0]
        style = ', style="rounded,dashed", fontcolor=gray' if is_unreached else ""
        yield f'{inner}"{path}/{state.name}" [label="{state.name}"{style}];'
        for below, nested in with_names(state.spawns):
            yield from _dot_machine(below, nested, f"{path}/{state.name}/{below}", path, counts, inner)
            yield f'{inner}"{path}/{state.name}" -> "{path}/{state.name}/{below}/" [style=dotted, arrowhead=none];'
    for state in machine.states:
        for one in machine.transitions_of(state.name):
            home = around if one.kind == "exit" else path
            label = _label(one, path, state.name, counts).replace("\\", "\\\\").replace('"', '\\"')
            yield f'{inner}"{path}/{state.name}" -> "{home}/{one.target}" [label="{label}"];'
    yield f"{indent}}}"


# -- SCXML ------------------------------------------------------------------------------------------------------------


def _scxml(spawns: tuple[Spawn, ...]) -> str:
    """Return W3C's State Chart XML: machines side by side are regions of a `parallel`, a time-out is a delayed event.

    Conditions and effects of a machine in Python are names of functions, which a tool has to define; those of
    a text are its code. What differs: there an inner transition wins over an outer one.
    """
    lines = ['<?xml version="1.0" encoding="UTF-8"?>']
    lines.append('<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0" datamodel="ecmascript" initial="all">')
    lines.append('  <parallel id="all">')
    for name, spawn in with_names(spawns):
        lines += _scxml_machine(spawn, name.replace("#", "."), None, "    ")
    return "\n".join([*lines, "  </parallel>", "</scxml>", ""])


def _scxml_machine(spawn: Spawn, path: str, around: str | None, indent: str) -> Iterator[str]:
    yield f"{indent}<state id={quoteattr(path)} initial={quoteattr(f'{path}.{spawn.initial}')}>"
    for state in spawn.machine.states:
        yield from _scxml_state(spawn.machine, state, path, around, indent + "  ")
    yield f"{indent}</state>"


def _scxml_state(machine: MachineDef, state: StateDef, path: str, around: str | None, indent: str) -> Iterator[str]:
    own = f"{path}.{state.name}"
    tag = "parallel" if len(state.spawns) > 1 else "state"
    yield f"{indent}<{tag} id={quoteattr(own)}>"
    inner = indent + "  "
    found = list(enumerate(machine.transitions_of(state.name)))
    timers = [(f"after.{own}.{i}", one.after_ns) for i, one in found if one.after_ns is not None]
    calls = [_code(one) for one in state.enter if isinstance(one, Block)]
    if calls or timers:
        yield f"{inner}<onentry>"
        yield from (f"{inner}  <script>{escape(text)}</script>" for text in calls)
        for event, delay in timers:
            wait = (
                f"delayexpr={quoteattr(_code(delay))}"
                if isinstance(delay, Block)
                else f'delay="{delay / NS_PER_MS:g}ms"'
            )
            yield f"{inner}  <send id={quoteattr(event)} event={quoteattr(event)} {wait}/>"
        yield f"{inner}</onentry>"
    if state.leave or timers:
        yield f"{inner}<onexit>"
        yield from (f"{inner}  <cancel sendid={quoteattr(event)}/>" for event, _ in timers)
        yield from (f"{inner}  <script>{escape(_code(one))}</script>" for one in state.leave)
        yield f"{inner}</onexit>"
    for i, one in found:
        caused_by = one.signal if one.after_ns is None else f"after.{own}.{i}"
        parts = [] if caused_by is None else [f"event={quoteattr(caused_by)}"]
        parts += [] if one.condition is None else [f"cond={quoteattr(_code(one.condition))}"]
        home = around if one.kind == "exit" else path
        parts.append(f"target={quoteattr(f'{home}.{one.target}')}")
        effect = "/>" if one.effect is None else f"><script>{escape(_code(one.effect))}</script></transition>"
        yield f"{inner}<transition {' '.join(parts)}{effect}"
    for name, below in with_names(state.spawns):
        yield from _scxml_machine(below, f"{own}.{name.replace('#', '.')}", path, inner)
    yield f"{indent}</{tag}>"


def _code(block: Block) -> str:
    """Return a block's code: of a function in Python its call."""
    return f"{block.text}()" if block.writes is None else block.text
