"""What is wrong with the forms of a program: mistakes are noted, and the reading continues with the next form."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from snr_sim.behaviors.program import Block, Place, Problem
from snr_sim.behaviors.reader import MAX_PROBLEMS, Form, Item, Text, Word
from snr_sim.prelude.errors import suggest

SHAPES = {
    "var": "(var NAME := [value])", "def": "(def NAME argument [expression])", "machine": "(machine NAME ...)",
    "spawn": "(spawn MACHINE STATE)", "onerror": "(onerror go_on), stop or fail", "state": "(state NAME ...)",
    "event": "(event NAME) or (event NAME [condition])", "on": "(on EVENT STATE -> STATE)",
    "ontime": "(ontime MILLISECONDS STATE -> STATE)", "eps": "(eps STATE -> STATE)",
    "exit": "(exit EVENT STATE -> STATE)", "onentry": "(onentry [statements]) or (onentry (spawn MACHINE STATE))",
    "running": "(running [statements])", "onexit": "(onexit [statements])", "always": "(always NAME [condition])",
    "break": "(break STATE) or (break STATE [condition])", "import": '(import "file.lrp")', "export": "(export NAME)",
    "actions": '(actions "file.py")',
}  # fmt: skip


class FormError(Exception):
    """A form cannot be used; the problem is noted."""


class EnoughProblemsError(Exception):
    """The program has as many mistakes as are reported: to suggest a name for each of more would take long."""


class Notes:
    """Collects the problems of forms."""

    def __init__(self, problems: list[Problem]) -> None:
        self.problems: list[Problem] = list(problems)
        self._mistakes = len(problems)

    def tried(self, make: Any, *arguments: Any) -> list[Any]:
        """Return what a function makes, in a list; an empty one if it fails."""
        try:
            return [make(*arguments)]
        except FormError:
            return []

    def needed(self, block: Block | None) -> Block:
        """Return a block; raise a FormError if there is none, whose problems are noted."""
        if block is None:
            raise FormError
        return block

    def word(self, form: Form, known: tuple[str, ...], where: str) -> str:
        """Return the first word of a form; note it, and return nothing, if it is not known there."""
        word = first_word(form)
        if word in known:
            return word
        place = form.items[0].place if form.items else form.place
        what = f"'{word}' is not a form of {where}" if word else f"A form of {where} begins with a word"
        self.add(place, f"{what}.", suggest(word, known, "known here are"))
        return ""

    def forms(self, form: Form, begin: int) -> Iterator[Form]:
        """Yield the forms in a form, from an index; note anything else."""
        for one in form.items[begin:]:
            if isinstance(one, Form):
                yield one
            else:
                self.add(one.place, f"'{text_of(one)}' cannot be here.", f"{SHAPES[first_word(form)]}.")

    def name(self, form: Form, i: int) -> str:
        """Return the word at an index.

        Raises:
            FormError: there is none.
        """
        item = form.items[i] if len(form.items) > i else None
        if not isinstance(item, Word) or not item.text[0].isalpha():
            raise self.shape(form)
        return item.text

    def known(self, item: Item, names: Collection[str], what: str) -> str:
        """Return the word of an item; it is a mistake, with the nearest one, if it is not among the names."""
        name = text_of(item)
        if name not in names:
            raise self.failed(item.place, f"There is no {what} '{name}' here.", suggest(name, sorted(names)))
        return name

    def shape(self, form: Form) -> FormError:
        """Return the mistake of a form that is not complete, or has too much."""
        word = first_word(form)
        return self.failed(form.place, f"({word} ...) is not complete, or has too much.", f"{SHAPES[word]}.")

    def failed(self, place: Place, message: str, fix: str) -> FormError:
        """Note a mistake; return what to raise."""
        self.add(place, message, fix)
        return FormError()

    def add(self, place: Place, message: str, fix: str = "", *, is_error: bool = True) -> None:
        """Note a problem; raise EnoughProblemsError with the last mistake that is reported."""
        self.problems.append(Problem(place, message, fix, is_error))
        self._mistakes += is_error
        if self._mistakes >= MAX_PROBLEMS:
            raise EnoughProblemsError


def first_word(form: Form) -> str:
    """Return the first word of a form; empty without one."""
    return text_of(form.items[0]) if form.items else ""


def text_of(item: Item | None) -> str:
    """Return a word or a text; empty of anything else."""
    return item.text if isinstance(item, (Word, Text)) else ""


def is_word(item: Item, text: str) -> bool:
    """Return whether an item is a certain word."""
    return isinstance(item, Word) and item.text == text
