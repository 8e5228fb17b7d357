"""A second interpreter of programs, written for its rules and not for speed: what `Interpreter` is compared with.

It knows no tables made ahead: in each step it walks through the definitions.
"""

from __future__ import annotations

from typing import Any

from snr_sim.behaviors.program import ANY, MachineDef, Program, Spawn, Transition


class Place:
    """A machine at its place, with the machines that run inside its state."""

    def __init__(self, path: str, spawn: Spawn, around: Place | None) -> None:
        self.path, self.definition, self.around = path, spawn.machine, around
        self.state = ""
        self.since_ns = 0
        self.inside: list[Place] = []


class ReferenceModel:
    """As `Interpreter`, for programs whose conditions are given in each step by their text."""

    def __init__(self, program: Program) -> None:
        self.top: list[Place] = []
        self.now_ns = 0
        self.holding: set[str] = set()
        self.log: list[tuple[Any, ...]] = []
        self.program = program

    def spawn(self, now_ns: int) -> list[tuple[Any, ...]]:
        self.now_ns, self.log = now_ns, []
        for spawn in self.program.spawns:
            self.top.append(self.begin(unique(spawn.machine.name, self.top, ""), spawn, None))
        return self.log

    def step(self, now_ns: int, holding: set[str], signal: str | None = None) -> list[tuple[Any, ...]]:
        self.now_ns, self.holding, self.log = now_ns, holding, []
        for place in self.top:
            self.advance(place, signal)
        return self.log

    def begin(self, path: str, spawn: Spawn, around: Place | None) -> Place:
        place = Place(path, spawn, around)
        place.state, place.since_ns = spawn.initial, self.now_ns
        self.log.append(("spawn", path, "", spawn.initial, 0))
        self.fill(place)
        return place

    def fill(self, place: Place) -> None:
        state = next(one for one in place.definition.states if one.name == place.state)
        place.inside = []
        for spawn in state.spawns:
            path = unique(spawn.machine.name, place.inside, f"{place.path}/{place.state}/")
            place.inside.append(self.begin(path, spawn, place))

    def is_enabled(self, place: Place, one: Transition, signal: str | None) -> bool:
        if one.source not in (ANY, place.state) or (one.source == ANY and one.target == place.state):
            return False
        if one.signal is not None and one.signal != signal:
            return False
        if isinstance(one.after_ns, int) and self.now_ns - place.since_ns < one.after_ns:
            return False
        return one.condition is None or one.condition.text in self.holding

    def first(self, place: Place, signal: str | None) -> Transition | None:
        return next((one for one in place.definition.transitions if self.is_enabled(place, one, signal)), None)

    def advance(self, place: Place, signal: str | None) -> list[Place]:
        """Return the machines around this one that have moved."""
        chosen = self.first(place, signal)
        moved = [] if chosen is None else self.follow(place, chosen)
        if chosen is None:
            for inner in list(place.inside):
                moved = self.advance(inner, signal)
                if moved:
                    break
        return [one for one in moved if one is not place]

    def follow(self, place: Place, chosen: Transition) -> list[Place]:
        moved: list[Place] = []
        for _ in range(16):
            if chosen.kind == "exit":
                assert place.around is not None
                place = place.around
            moved.append(place)
            self.move(place, chosen)
            may_chain = any(one.kind == "eps" for one in leaving(place.definition, place.state))
            following = self.first(place, None) if may_chain else None
            if following is None:
                break
            chosen = following
        return moved

    def move(self, place: Place, chosen: Transition) -> None:
        source, held_ns = place.state, self.now_ns - place.since_ns
        place.state, place.since_ns = chosen.target, self.now_ns
        self.log.append((chosen.kind, place.path, source, chosen.target, held_ns))
        self.fill(place)

    def active(self) -> dict[str, str]:
        found: dict[str, str] = {}

        def add(place: Place) -> None:
            found[place.path] = place.state
            for inner in place.inside:
                add(inner)

        for place in self.top:
            add(place)
        return found


def leaving(machine: MachineDef, state: str) -> list[Transition]:
    return [one for one in machine.transitions if one.source == state or (one.source == ANY and one.target != state)]


def unique(name: str, beside: list[Place], above: str) -> str:
    count = sum(one.definition.name == name for one in beside)
    return above + (name if count == 0 else f"{name}#{count + 1}")
