"""Machines as drawings need them, from the text of a program.

Only the forms are read, without resolving a name, so a text with mistakes gives what can be recognised of it, and so
does the listing of a machine that was made in Python. A recording has nothing but the text.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Literal, cast

from snr_sim.behaviors.imports import files_named
from snr_sim.behaviors.reader import Code, Form, Item, Word, read
from snr_sim.web.messages import Arrow, Graph, GraphState

MAX_STATES = 2000  # in all: machines that spawn each other could make any number of them
MAX_LABEL = 80
_KINDS = ("on", "ontime", "eps", "exit")


def graphs_of(text: str, files: Mapping[str, str] | None = None) -> list[Graph]:
    """Return the machines that a text spawns, those inside states in them.

    Args:
        text: of the program.
        files: texts of the programs that it imports.
    """
    forms = read(text)[0]
    found = {
        **dict(_imported_machines(text, files or {})),
        **{name: (one, "") for name, one in _machines(forms).items()},
    }
    machines = {name: form for name, (form, _) in found.items()}
    drawing = _Drawing({id(form): file for form, file in found.values()})
    return drawing.spawned(_named(forms, "spawn"), machines, "", (), "")


def signals_in(text: str, files: Mapping[str, str] | None = None) -> list[str]:
    """Return the names of the signals that a text declares: events without a condition."""
    found = dict[str, None]()
    for one in (text, *(files or {}).values()):
        left = list(_named(read(one)[0], "machine"))
        while left:
            form = left.pop()
            left += [*_named(form.items, "state"), *_named(form.items, "machine")]
            found |= {_word(event.items[1]): None for event in _named(form.items, "event") if len(event.items) == 2}
    return sorted(found)


def _imported_machines(text: str, files: Mapping[str, str]) -> Iterator[tuple[str, tuple[Form, str]]]:
    """Yield name, form and file of each machine."""
    left, seen = [text], set[str]()
    while left:
        for name in files_named(left.pop())[0]:
            if name in files and name not in seen:
                seen.add(name)
                left.append(files[name])
                for machine, form in _machines(read(files[name])[0]).items():
                    yield machine, (form, name)


class _Drawing:
    """Makes graphs, and counts their states.

    Args:
        files: that declare machines which are in no other one, by the id of their forms.
    """

    def __init__(self, files: Mapping[int, str]) -> None:
        self._states = 0
        self._files = files

    def spawned(
        self, spawns: Iterable[Form], machines: Mapping[str, Form], above: str, inside: tuple[str, ...], file: str
    ) -> list[Graph]:
        """Return the graphs of `spawn` forms; `inside` names the machines around, in `file` the spawns are."""
        made, count = list[Graph](), dict[str, int]()
        for form in spawns:
            match form.items:
                case (_, Word(name), Word(initial), *_) if name in machines and name not in inside:
                    count[name] = count.get(name, 0) + 1
                    unique = name if count[name] == 1 else f"{name}#{count[name]}"
                    form = machines[name]
                    declared = self._files.get(id(form), file)
                    made.append(self._graph(form, above + unique, unique, initial, machines, inside, declared))
        return made

    def _graph(
        self,
        form: Form,
        path: str,
        name: str,
        initial: str,
        machines: Mapping[str, Form],
        inside: tuple[str, ...],
        file: str,
    ) -> Graph:
        states = []
        for one in _named(form.items, "state"):
            match one.items:
                case (_, Word(state), *_):
                    self._states += 1
                    if self._states > MAX_STATES:
                        break
                    entries = [row for entry in _named(one.items, "onentry") for row in _named(entry.items, "spawn")]
                    known = {**machines, **_machines(one.items)}
                    around = (*inside, name.partition("#")[0])
                    nested = self.spawned(entries, known, f"{path}/{state}/", around, file)
                    states.append(GraphState(state, one.place.line, nested))
        arrows = [arrow for one in form.items if isinstance(one, Form) for arrow in _arrows(one)]
        return Graph(path, name, initial, file, form.place.line, states, arrows)


def _arrows(form: Form) -> Iterator[Arrow]:
    """Yield the transition of a form, if it is one."""
    kind, items = _word(form.items[0]) if form.items else "", form.items
    at = next((i for i, item in enumerate(items) if _word(item) == "->"), 0)
    if kind not in _KINDS or not 1 < at < len(items) - 1:
        return
    source, target = _word(items[at - 1]), _word(items[at + 1])
    rest = items[at + 2 :]
    name = "".join(map(_word, rest)) or f"{source}->{target}"  # a listing has names of several words, such as a->b
    words = [_shown(one, kind if i == 0 else "") for i, one in enumerate(items[1 : at - 1])] or ["at once"]
    words += [f"/ {_shown(one, '')}" for one in rest if isinstance(one, Code)]
    label = " ".join(words)
    if len(label) > MAX_LABEL:
        label = label[: MAX_LABEL - 3] + "..."
    known = cast("Literal['on', 'ontime', 'eps', 'exit']", kind)
    yield Arrow(name, known, source, target, form.place.line, label)


def _shown(item: Item, kind: str) -> str:
    """Return what a transition waits for, as text."""
    if isinstance(item, Code):
        text = " ".join(item.text.split())
        return f"after {text} ms" if kind == "ontime" else f"[{text}]"
    text = _word(item)
    if kind != "ontime":
        return text
    return f"after {int(text) / 1000:g} s" if text.isdecimal() and len(text) < 13 else f"after {text} ms"


def _named(items: Iterable[Item], word: str) -> Iterator[Form]:
    """Yield the forms among items that begin with a word."""
    for one in items:
        if isinstance(one, Form) and one.items and _word(one.items[0]) == word:
            yield one


def _machines(items: Iterable[Item]) -> dict[str, Form]:
    return {_word(one.items[1]): one for one in _named(items, "machine") if len(one.items) > 1}


def _word(item: Item) -> str:
    return item.text if isinstance(item, Word) else ""
