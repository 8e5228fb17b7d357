"""LRP, the live programming language: forms to a program. Names are resolved, blocks compiled, mistakes collected.

    program    := { var | def | machine | spawn | onerror | always | break | import | export | actions }
    var        := "(" "var" NAME ":=" expr ")"                            in a program or a machine
    def        := "(" "def" NAME { NAME } expr ")"                        a helper without side effects
    machine    := "(" "machine" NAME { var | def | state | event | transition } ")"
    state      := "(" "state" NAME { onentry | running | onexit | machine } ")"
    onentry    := "(" "onentry" ( block | spawn ) ")"                     running, onexit: a block
    event      := "(" "event" NAME [ expr ] ")"                           with expr a condition, else a signal
    transition := "(" "on" ( NAME | expr ) source "->" NAME [ NAME ] ")"
                | "(" "ontime" ( INT | NAME | expr ) source "->" NAME [ NAME ] ")"        milliseconds
                | "(" "eps" source "->" NAME [ NAME ] ")"
                | "(" "exit" ( NAME | expr ) NAME "->" NAME [ NAME ] ")"  to a state of the machine around
    source     := NAME | "*"
    spawn      := "(" "spawn" NAME NAME ")"
    onerror    := "(" "onerror" ( "go_on" | "stop" | "fail" ) ")"
    always     := "(" "always" [ NAME ] expr ")"                          must hold after every step
    break      := "(" "break" NAME [ expr ] ")"                           pauses when state NAME is entered
    import     := "(" "import" STRING ")"                                 what another program in this folder exports
    export     := "(" "export" NAME ")"                                   a var, def or machine of the program's top
    actions    := "(" "actions" STRING ")"                                marked functions of a Python file there
    expr, block := "[" Python "]"                                         see blocks.py

Source: Fabry and Campusano, "Live Programming the Lego Mindstorms" (IWST 2014); where it is silent, the choices are
ours.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

from snr_sim.behaviors.block_checks import RESERVED
from snr_sim.behaviors.blocks import Definition, Scope, compile_block, define
from snr_sim.behaviors.checks import MAX_LEVELS, problems_of
from snr_sim.behaviors.context import MAX_WORK, NS_PER_MS, plain_value
from snr_sim.behaviors.forms import EnoughProblemsError, Notes, first_word, is_word, text_of
from snr_sim.behaviors.imports import Actions, why_not
from snr_sim.behaviors.program import (
    ANY,
    Bindings,
    Block,
    Kind,
    MachineDef,
    OnError,
    Place,
    Problem,
    Program,
    ProgramError,
    Rule,
    Spawn,
    StateDef,
    Transition,
)
from snr_sim.behaviors.reader import MAX_PROBLEMS, Code, Form, Item, Text, Word, read
from snr_sim.prelude.errors import ParameterError, suggest

MAX_CODE = 100_000  # characters of the blocks of a program, each with the helpers that it calls
Parts = Mapping[str, frozenset[str]]

_TOP = ("var", "def", "machine", "spawn", "onerror", "always", "break", "import", "export", "actions")
_IN_MACHINE = ("var", "def", "state", "event", "on", "ontime", "eps", "exit")
_IN_STATE = ("onentry", "running", "onexit", "machine")
_ON_ERROR = ("go_on", "stop", "fail")
_COMMANDS = re.compile(r"(robot\.\w+\.(start\(\s*-?[\d.]+\s*\)|stop\(\))[\s;]*)+")  # of a constant


def parse(
    text: str, parts: Parts | None = None, files: Mapping[str, str] | None = None, actions: Actions | None = None
) -> Program:
    """Return the program of a text.

    Args:
        text: of the whole program.
        parts: of the robot: the names of the functions of each; if none are given, any part may be named.
        files: texts of the programs that it imports, by the names of their files.
        actions: functions of the Python files that it names, by file and name.

    Raises:
        ProgramError: it has mistakes, all of which are in `problems`.
    """
    known = None if parts is None else tuple(sorted((name, tuple(sorted(one))) for name, one in parts.items()))
    functions = tuple((file, tuple(one.items())) for file, one in (actions or {}).items())
    program, problems = _parse(text, known, tuple((files or {}).items()), functions)
    if program is None:
        raise ProgramError(list(problems))
    return program


@lru_cache(maxsize=64)
def _parse(
    text: str,
    parts: tuple[tuple[str, tuple[str, ...]], ...] | None,
    files: tuple[tuple[str, str], ...],
    actions: tuple[tuple[str, tuple[tuple[str, Callable[..., Any]], ...]], ...],
) -> tuple[Program | None, tuple[Problem, ...]]:
    forms, problems = read(text)
    known = None if parts is None else {name: frozenset(verbs) for name, verbs in parts}
    others = _Others(dict(files), {file: dict(functions) for file, functions in actions})
    language = _Language(known, problems, others)
    program, found = None, language.problems
    with suppress(EnoughProblemsError):
        program = language.program(text, forms)
        if not any(one.is_error for one in found):
            found += problems_of(program.spawns)
    errors = [one for one in found if one.is_error]
    if program is None or errors:
        return None, tuple(sorted(errors, key=lambda one: (one.place.line, one.place.column)))[:MAX_PROBLEMS]
    return replace(program, warnings=tuple(found[:MAX_PROBLEMS])), ()


@dataclass(frozen=True)
class _Names:
    """What can be named at one place of a text; inner names hide outer ones.

    Args:
        variables: the key of each, which is unique in the program.
        values: initial values by key.
        definitions: helpers.
        machines: those that can be spawned.
        events: those that transitions can name.
    """

    variables: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    definitions: Mapping[str, Definition] = field(default_factory=dict)
    machines: Mapping[str, _Machine] = field(default_factory=dict)
    events: Mapping[str, _Event] = field(default_factory=dict)


@dataclass(eq=False)
class _Machine:
    """The form of a machine, what can be named there, and its definition once it has been made."""

    form: Form
    names: _Names | None = None
    made: MachineDef | None = None


@dataclass(eq=False)
class _Event:
    """A signal, or, with a block, a condition."""

    place: Place
    condition: Block | None
    is_used: bool = False


@dataclass
class _Others:
    """What a program takes from other files.

    Args:
        files: texts by name.
        actions: functions by file and name.
        used: names of the files that have been read, with what their top names.
        inside: those that are being read, the outermost first.
        start: the context of all initialisers.
        named: keys of the variables that blocks name.
        code: characters of the blocks that have been compiled, each with the helpers that it calls.
    """

    files: Mapping[str, str]
    actions: Actions
    used: dict[str, _Names] = field(default_factory=dict)
    inside: list[str] = field(default_factory=list)
    start: _Start = field(default_factory=lambda: _Start())
    named: set[str] = field(default_factory=set)
    code: int = 0


class _Language:
    """Makes definitions of forms, and continues after a mistake."""

    def __init__(self, parts: Parts | None, problems: list[Problem], others: _Others, prefix: str = "") -> None:
        self._notes = Notes(problems)
        self.problems: list[Problem] = self._notes.problems
        self._parts = parts
        self._others = others
        self._prefix = prefix  # of the keys of the variables at the top
        self._actions: dict[str, Callable[..., Any]] = {}
        self._inside: list[_Machine] = []  # machines that are being made, outermost first
        self._made_machines: list[MachineDef] = []
        self._declared_at: dict[str, tuple[str, Place]] = {}  # name of each variable, and where, by key
        self._on_error: OnError = "go_on"

    def program(self, text: str, forms: list[Form]) -> Program:
        """Return the program of all forms; with problems it may lack parts."""
        known, names = self._top(forms)
        spawns = []
        for form in known:
            if first_word(form) == "spawn":
                spawns += self._notes.tried(self._spawn, form, names)
            elif first_word(form) == "onerror":
                self._notes.tried(self._set_on_error, form)
        for one in names.machines.values():  # those that are not spawned are checked, too
            self._notes.tried(self._machine, one)
        rules = [
            rule
            for form in known
            if first_word(form) in ("always", "break")
            for rule in self._notes.tried(self._rule, form, names)
        ]
        exported = {text_of(form.items[-1]) for form in known if first_word(form) == "export"}
        for key, (name, place) in self._declared_at.items():
            if key not in self._others.named and name not in exported:
                self._notes.add(place, f"Nothing uses the variable '{name}'.", "leave it out.", is_error=False)
        if not spawns and not self.problems:
            self._notes.add(
                Place(1, 1, 1, 1), "No machine is spawned.", "(spawn MACHINE STATE) at the end.", is_error=False
            )
        files = {name: self._others.files[name] for name in sorted(self._others.used)}
        whole = "\0".join([text, *(part for row in files.items() for part in row)])
        return Program(
            text,
            hashlib.sha256(whole.encode("utf-8", "surrogatepass")).hexdigest(),
            tuple(spawns),
            self._on_error,
            (),
            dict(names.values),
            tuple(rules),
            files,
            self._others.actions,
        )

    # -- other files --------------------------------------------------------------------------------------------------

    def _top(self, forms: list[Form]) -> tuple[list[Form], _Names]:
        """Return the forms of a program, and what can be named at its top."""
        known = [form for form in forms if self._notes.word(form, _TOP, "a program")]
        names = _Names()
        for form in known:
            if first_word(form) == "actions":
                self._notes.tried(self._take_actions, form)
            elif first_word(form) == "import":
                for found in self._notes.tried(self._imported, form):
                    names = _merged(names, found)
        taken = names.machines
        names = self._with_variables(known, names, "")
        own = {name: _Machine(form) for name, form in self._named(known, "machine")}
        names = replace(names, machines={**taken, **own})
        for one in own.values():
            one.names = names
        return known, names

    def exports(self, forms: list[Form]) -> _Names:
        """Return what a file that is imported exports; what it does at its top otherwise is of no effect."""
        known, names = self._top(forms)
        for one in names.machines.values():
            self._notes.tried(self._machine, one)
        exported = [form for form in known if first_word(form) == "export"]
        exported_names = {
            self._notes.name(form, 1): form for form in exported for _ in self._notes.tried(self._notes.name, form, 1)
        }
        tables: tuple[Mapping[str, Any], ...] = (names.variables, names.definitions, names.machines)
        for name, form in exported_names.items():
            if not any(name in table for table in tables):
                have = sorted({one for table in tables for one in table})
                self._notes.add(form.items[1].place, f"There is no '{name}' to export.", suggest(name, have))
        variables, definitions, machines = ({key: one[key] for key in one if key in exported_names} for one in tables)
        return _Names(variables, names.values, definitions, machines)

    def _file(self, form: Form, suffix: str) -> str:
        """Return the name of the file in a form."""
        if len(form.items) != 2 or not isinstance(item := form.items[1], Text):
            raise self._notes.shape(form)
        if wrong := why_not(item.text, suffix):
            raise self._notes.failed(
                item.place, f"'{item.text}' cannot be used here: {wrong}.", f"a {suffix} file in its folder."
            )
        return item.text

    def _imported(self, form: Form) -> _Names:
        name, others = self._file(form, ".lrp"), self._others
        if name in others.inside:
            raise self._notes.failed(form.place, f"'{name}' imports itself.", "leave one of the imports out.")
        if name not in others.files:
            raise self._notes.failed(
                form.place, f"There is no file '{name}' in the folder of the program.", suggest(name, others.files)
            )
        if name not in others.used:
            forms, problems = read(others.files[name])
            language = _Language(self._parts, problems, others, f"{name.removesuffix('.lrp')}:")
            others.inside.append(name)
            others.used[name] = _Names()
            with suppress(EnoughProblemsError):
                others.used[name] = language.exports(forms)
            others.inside.pop()
            for one in language.problems:
                if one.is_error:
                    self._notes.add(form.place, f"{name}:{one.place.line}:{one.place.column}: {one.message}", one.fix)
        return others.used[name]

    def _take_actions(self, form: Form) -> None:
        name = self._file(form, ".py")
        if name not in self._others.actions:
            known = self._others.actions
            fix = suggest(name, known) if known else "a file in its folder; a new one counts from the next start."
            raise self._notes.failed(form.place, f"There are no actions of '{name}'.", fix)
        self._actions |= self._others.actions[name]

    # -- names --------------------------------------------------------------------------------------------------------

    def _with_variables(self, forms: Iterable[Form], names: _Names, scope: str) -> _Names:
        """Return the names with those that `var` and `def` add, in the order of the text."""
        own: set[str] = set()
        for form in forms:
            if first_word(form) in ("var", "def"):
                for name in self._notes.tried(self._python_name, form, 1, own):
                    names = (self._notes.tried(self._declared, form, name, names, scope) or [names])[0]
        return names

    def _python_name(self, form: Form, i: int, own: set[str]) -> str:
        """Return the word at an index, which Python can use and which `own` does not have, and add it there."""
        name, place = self._notes.name(form, i), form.items[i].place
        if name in own:
            raise self._notes.failed(place, f"'{name}' is declared twice here.", "rename one.")
        if name in RESERVED:
            raise self._notes.failed(place, f"'{name}' has a meaning in Python or in blocks.", f"rename it: {name}_1.")
        if not name.isidentifier():
            raise self._notes.failed(place, f"'{name}' cannot be used in Python.", "use '_', not '-'.")
        own.add(name)
        return name

    def _declared(self, form: Form, name: str, names: _Names, scope: str) -> _Names:
        match form.items:
            case (Word("def"), _, *given, Code() as code):
                own = set[str]()
                parameters = tuple(self._python_name(form, i, own) for i in range(2, 2 + len(given)))
                inside = replace(names, variables={**names.variables, **dict.fromkeys(parameters, "")})
                block = self._block(code, "condition", inside)
                # One with a mistake is known all the same, so that its callers are not mistakes, too.
                text = "None" if block is None else code.text
                seen = Scope(names.variables, names.definitions, None).of(text)
                variables, called = tuple(seen.variables.items()), tuple(seen.definitions.items())
                made = define(parameters, text, variables, called, tuple(self._actions.items()))
                others = {key: value for key, value in names.variables.items() if key != name}
                return replace(names, definitions={**names.definitions, name: made}, variables=others)
            case (Word("var"), _, Word(":="), Code() as code):
                key = f"{scope}.{name}" if scope else f"{self._prefix}{name}"
                self._declared_at[key] = name, form.items[1].place
                value = self._initial(name, code, names)
                definitions = {one: given for one, given in names.definitions.items() if one != name}
                known = {**names.variables, name: key}
                return replace(names, variables=known, values={**names.values, key: value}, definitions=definitions)
        raise self._notes.shape(form)

    def _initial(self, name: str, code: Code, names: _Names) -> Any:
        """Return the value of an initialiser, which may name what is declared before it."""
        block = self._notes.needed(self._block(code, "condition", names, {}))
        bindings = Bindings([names.values[key] for key in block.keys], {key: i for i, key in enumerate(block.keys)})
        try:
            return plain_value(name, block.bind(bindings)(self._others.start))
        except Exception as error:
            raise self._notes.failed(code.place, f"{type(error).__name__}: {error}", "") from error

    def _named(self, forms: Iterable[Form], word: str) -> Iterator[tuple[str, Form]]:
        """Yield the forms that begin with a word, each with its name; one of a name that is in use is noted."""
        used = set[str]()
        for form in (one for one in forms if first_word(one) == word):
            for name in self._notes.tried(self._notes.name, form, 1):
                if name in used:
                    self._notes.add(form.items[1].place, f"There are two {word}s '{name}' here.", "rename one.")
                used.add(name)
                yield name, form

    # -- forms --------------------------------------------------------------------------------------------------------

    def _spawn(self, form: Form, names: _Names) -> Spawn:
        if len(form.items) != 3:
            raise self._notes.shape(form)
        initial = self._notes.name(form, 2)
        name = self._notes.known(form.items[1], names.machines, "machine")
        machine = names.machines[name]
        if machine in self._inside:
            raise self._notes.failed(
                form.items[1].place, f"Machine '{name}' would contain itself.", "spawn another one."
            )
        made = self._machine(machine)
        states = [one.name for one in made.states]
        if initial not in states:
            raise self._notes.failed(
                form.items[2].place, f"Machine '{name}' has no state '{initial}'.", suggest(initial, states)
            )
        return Spawn(made, initial, form.place)

    def _set_on_error(self, form: Form) -> None:
        word = self._notes.name(form, 1)
        if word not in _ON_ERROR or len(form.items) != 2:
            raise self._notes.failed(form.items[1].place, f"(onerror {word}) is not known.", suggest(word, _ON_ERROR))
        self._on_error = word  # type: ignore[assignment]

    def _rule(self, form: Form, names: _Names) -> Rule:
        match form.items:
            case (Word("always"), Code() as code):
                name = code.text
            case (Word("always"), Word(name), Code() as code):
                pass
            case (Word("break"), Word(name)) | (Word("break"), Word(name), Code()):
                states = {one.name for machine in self._made_machines for one in machine.states}
                self._notes.known(form.items[1], states, "state")
                given = form.items[2:]  # a block, or nothing
                condition = self._notes.needed(self._block(given[0], "condition", names)) if given else None  # type: ignore[arg-type]
                return Rule("break", name, condition, form.place)
            case _:
                raise self._notes.shape(form)
        return Rule("always", name, self._notes.needed(self._block(code, "condition", names)), form.place)

    def _machine(self, machine: _Machine) -> MachineDef:
        if machine.made is None:
            if len(self._inside) >= MAX_LEVELS:
                raise self._notes.failed(
                    machine.form.place, "Machines are nested too deeply.", f"at most {MAX_LEVELS} levels."
                )
            self._inside.append(machine)
            try:
                machine.made = self._made(machine)
                self._made_machines.append(machine.made)
            finally:
                self._inside.pop()
        return machine.made

    def _made(self, machine: _Machine) -> MachineDef:
        assert machine.names is not None
        name = self._notes.name(machine.form, 1)
        forms = [one for one in self._notes.forms(machine.form, 2) if self._notes.word(one, _IN_MACHINE, "a machine")]
        scope = f"{self._prefix}{machine.form.place.line}:{machine.form.place.column}:{name}"
        names = self._with_variables(forms, machine.names, scope)
        own = {key: value for key, value in names.values.items() if key not in machine.names.values}
        names = replace(names, values={**machine.names.values, **own})
        events = {
            word: event
            for word, one in self._named(forms, "event")
            for event in self._notes.tried(self._made_event, one, word, names)
        }
        names = replace(names, events={**names.events, **events})
        states = [
            state for one in forms if first_word(one) == "state" for state in self._notes.tried(self._state, one, names)
        ]
        targets = [one.name for one in states]
        around = self._states_around()
        transitions = [
            transition
            for one in forms
            if first_word(one) in ("on", "ontime", "eps", "exit")
            for transition in self._notes.tried(self._transition, one, names, targets, around)
        ]
        for word, event in events.items():
            if not event.is_used:
                self._notes.add(event.place, f"No transition uses the event '{word}'.", is_error=False)
        return MachineDef(name, tuple(states), tuple(transitions), own, machine.form.place)

    def _states_around(self) -> list[str] | None:
        """Return the names of the states of the machine in whose state a machine is spawned; None at the top."""
        if len(self._inside) < 2:
            return None
        around = self._inside[-2].form
        return [
            text_of(one.items[1])
            for one in around.items[2:]
            if isinstance(one, Form) and first_word(one) == "state" and len(one.items) > 1
        ]

    def _made_event(self, form: Form, name: str, names: _Names) -> _Event:
        match form.items:
            case (_, _):
                return _Event(form.place, None)
            case (_, _, Code() as code):
                block = self._block(code, "condition", names)
                return _Event(form.place, None if block is None else replace(block, text=name))
        raise self._notes.shape(form)

    def _state(self, form: Form, names: _Names) -> StateDef:
        name = self._notes.name(form, 1)
        forms = [one for one in self._notes.forms(form, 2) if self._notes.word(one, _IN_STATE, f"state '{name}'")]
        machines = {one: _Machine(inner) for one, inner in self._named(forms, "machine")}
        names = replace(names, machines={**names.machines, **machines})
        for inner in machines.values():
            inner.names = names
        clauses: dict[str, list[Any]] = {"onentry": [], "running": [], "onexit": []}
        for one in forms:
            match one.items:
                case (Word("machine"), *_):
                    pass
                case (Word(kind), Code() as code):
                    block = self._block(code, "block", names)
                    if kind == "running" and _COMMANDS.fullmatch(code.text.strip()):
                        message = "This repeats the same command in each step."
                        self._notes.add(code.place, message, "once is enough: (onentry [...]).", is_error=False)
                    clauses[kind] += [] if block is None else [block]
                case (Word("onentry"), Form() as content):
                    if self._notes.word(content, ("spawn",), "onentry"):
                        clauses["onentry"] += self._notes.tried(self._spawn, content, names)
                case _:
                    self._notes.shape(one)
        spawned = {id(one.machine) for one in clauses["onentry"] if isinstance(one, Spawn)}
        for machine in machines.values():
            made = self._notes.tried(self._machine, machine)
            if made and id(made[0]) not in spawned:
                self._notes.add(machine.form.place, f"Machine '{made[0].name}' is never spawned.", is_error=False)
        enter, during, leave = map(tuple, clauses.values())
        return StateDef(name, enter, during, leave, form.place)

    def _transition(self, form: Form, names: _Names, states: list[str], around: list[str] | None) -> Transition:
        kind: Kind = first_word(form)  # type: ignore[assignment]
        at = 1 if kind == "eps" else 2
        ends = form.items[at:]
        if len(ends) not in (3, 4) or not is_word(ends[1], "->"):
            raise self._notes.shape(form)
        source, target = text_of(ends[0]), text_of(ends[2])
        name = text_of(ends[3]) if len(ends) == 4 else f"{source}->{target}"
        if not source or not target or not name:
            raise self._notes.shape(form)
        if source != ANY:
            self._notes.known(ends[0], states, "state")
        if kind == "exit" and source == ANY:
            raise self._notes.failed(
                ends[0].place, "(exit ...) names one state that it leaves.", "write one for each state."
            )
        if kind == "exit" and around is None:
            raise self._notes.failed(
                form.place, "There is no machine around this one that (exit ...) could leave to.", "write (on ...)."
            )
        self._notes.known(ends[2], around if kind == "exit" and around is not None else states, "state")
        signal, condition, after_ns = None, None, None
        if kind == "ontime":
            after_ns = self._time(form.items[1], names)
        elif kind != "eps":
            signal, condition = self._event(form.items[1], names)
        return Transition(kind, source, target, name, form.place, signal, condition, after_ns)

    def _event(self, item: Item, names: _Names) -> tuple[str | None, Block | None]:
        """Return the signal or the condition of a transition."""
        if isinstance(item, Code):
            return None, self._notes.needed(self._block(item, "condition", names))
        name = self._notes.known(item, names.events, "event")
        event = names.events[name]
        event.is_used = True
        return (name, None) if event.condition is None else (None, event.condition)

    def _time(self, item: Item, names: _Names) -> int | Block:
        """Return the time of `ontime` [ns], or a block that does."""
        text = text_of(item)
        if text.isdecimal():
            if len(text) > 12:
                raise self._notes.failed(
                    item.place, f"{text} ms is too long.", "a time-out in milliseconds, such as 300."
                )
            return int(text) * NS_PER_MS
        if isinstance(item, Word):
            item = Code(self._notes.known(item, names.variables, "variable"), item.place)
        if not isinstance(item, Code):
            raise self._notes.failed(
                item.place, "A time-out is a number, a variable or [an expression].", "(ontime 300 ...)."
            )
        block = self._notes.needed(self._block(item, "condition", names))
        bind = block.bind

        def in_ns(bindings: Bindings) -> Any:
            in_ms = bind(bindings)
            return lambda m: round(in_ms(m) * NS_PER_MS)

        return replace(block, bind=in_ns)

    def _block(self, code: Code, kind: Any, names: _Names, parts: Parts | None = None) -> Block | None:
        if self._others.code > MAX_CODE:
            what = f"The blocks before this one, with the helpers that they call, have more than {MAX_CODE} characters."
            raise self._notes.failed(code.place, what, "simplify them.")
        scope = Scope(names.variables, names.definitions, self._parts if parts is None else parts, self._actions)
        block, problems = compile_block(code.text, code.place, kind, scope)
        for one in problems:
            self._notes.add(one.place, one.message, one.fix, is_error=one.is_error)
        if block is not None:
            self._others.named.update(block.keys)
            self._others.code += len(block.code)
        return block


class _Start:
    """The context of initialisers: there is no time yet, and no signal."""

    now_ns, in_state_ms, signal, work = 0, 0.0, (), MAX_WORK

    def random(self) -> float:
        raise ParameterError("An initialiser cannot draw random numbers.", fix="draw them in (onentry [...]).")

    def log(self, text: object) -> None:
        raise ParameterError("An initialiser cannot log.", fix="log in (onentry [...]).")


def _merged(names: _Names, found: _Names) -> _Names:
    tables = ("variables", "values", "definitions", "machines")
    return _Names(*({**getattr(names, one), **getattr(found, one)} for one in tables))
