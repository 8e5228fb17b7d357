"""Reader of LRP, the live programming language: text to forms, each with its place. It continues after a mistake.

    (state lit (onentry [robot.light.start(80)]))  -->  Form(Word "state", Word "lit", Form(Word "onentry", Code))

Source of the language: Fabry and Campusano, "Live Programming the Lego Mindstorms" (IWST 2014), appendix.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass
from typing import TypeAlias

from snr_sim.behaviors.program import Place, Problem

MAX_CHARACTERS = 50_000  # a program of so many is parsed in 0.3 s
MAX_DEPTH = 100  # of forms in forms
MAX_PROBLEMS = 20

_SPACE = re.compile(r"(?:[ \t\r\n\f\ufeff]+|;[^\n]*)+")  # some editors begin a file with U+FEFF
_WORD = re.compile(r"->|:=|\*|[0-9]+|[A-Za-z][A-Za-z0-9_]*(?:-+[A-Za-z0-9_]+)*")
_CODE = re.compile(r"\w+$")  # the word before a place
_FORM = re.compile(r"^[ \t]*\(", re.MULTILINE)  # where a line begins with one
_JUNK = re.compile(r"[^\s()\[\];\"]+")
# Of Python: a bracket, a comment, a string, or the quote of a string that is not closed.
_IN_CODE = re.compile(
    r"""[()\[\]{}]|\#[^\n]*|('''|\"{3})(?:\\.|(?!\1)[^\\])*+\1|(?!'''|\"{3})(['"])(?:\\.|(?!\2)[^\\\n])*+\2|['"]""",
    re.DOTALL,
)
_CLOSING = {"(": ")", "[": "]", "{": "}"}


@dataclass(frozen=True)
class Word:
    """A name, a number, `->`, `:=` or `*`."""

    text: str
    place: Place


@dataclass(frozen=True)
class Text:
    """Text in double quotes."""

    text: str
    place: Place


@dataclass(frozen=True)
class Code:
    """Python between square brackets, as written; `place` is that of the code, without the brackets."""

    text: str
    place: Place


@dataclass(frozen=True)
class Form:
    """What is between round brackets."""

    items: tuple[Item, ...]
    place: Place


Item: TypeAlias = "Word | Text | Code | Form"


def read(text: str) -> tuple[list[Form], list[Problem]]:
    """Return the forms of a text, and its problems. With problems the forms may lack parts."""
    if len(text) > MAX_CHARACTERS:
        whole = Place(1, 1, 1, 1)
        return [], [Problem(whole, f"The text has {len(text)} characters.", f"{MAX_CHARACTERS} are allowed.")]
    reader = _Reader(text, is_by_indentation=False)
    reader.read_all()
    if reader.is_unbalanced:  # then which bracket it is, is seen by the indentation
        reader = _Reader(text, is_by_indentation=True)
        reader.read_all()
    if len(reader.problems) >= MAX_PROBLEMS:
        return [], reader.problems  # the rest was not read, so what is missing may be in it
    return reader.forms, reader.problems


class _Open:
    """A form whose closing bracket has not been read."""

    def __init__(self, start: int, column: int) -> None:
        self.start = start
        self.column = column
        self.items: list[Item] = []


class _Reader:
    def __init__(self, text: str, *, is_by_indentation: bool) -> None:
        self.text = text
        self.is_by_indentation = is_by_indentation
        self.forms: list[Form] = []
        self.problems: list[Problem] = []
        self.is_unbalanced = False
        self._starts = [0, *(found.end() for found in re.finditer("\n", text))]  # of lines
        self._first_in_line = {found.end() - 1 for found in _FORM.finditer(text)}  # brackets of forms
        self._open: list[_Open] = []

    def read_all(self) -> None:
        """Read until the text ends, too much is wrong, or it must be read again by its indentation."""
        text, at = self.text, 0
        while at < len(text) and len(self.problems) < MAX_PROBLEMS:
            if self.is_unbalanced and not self.is_by_indentation:
                return
            found = _SPACE.match(text, at)
            at = found.end() if found else self._read_one(at)
        for one in reversed(self._open):
            self._report_unclosed(one, None)
        while self._open:
            self._close(len(text))

    def _read_one(self, at: int) -> int:
        """Read what begins at a place; return the place after it."""
        text, first = self.text, self.text[at]
        if first == "(":
            if self.is_by_indentation:
                self._close_by_indentation(at)
            if len(self._open) >= MAX_DEPTH:
                self._report(at, at + 1, "Forms are nested too deeply.", f"at most {MAX_DEPTH} levels.")
                self._open.clear()
                return len(text)
            self._open.append(_Open(at, self._at(at)[1]))
            return at + 1
        if first == ")":
            if self._open:
                self._close(at + 1)
            else:
                self.is_unbalanced = True
                self._report(at, at + 1, "')' closes nothing.", "remove it, or add the '(' that is missing before.")
            return at + 1
        if first == "[":
            return self._read_code(at)
        if first == '"':
            end = self.text.find('"', at + 1)
            line_end = self.text.find("\n", at)
            if end < 0 or 0 <= line_end < end:
                end = line_end if line_end >= 0 else len(text)
                self._report(at, end, "The text is not closed.", 'add " at its end.')
                return end
            self._add(Text(text[at + 1 : end], self._place(at, end + 1)), at, end + 1)
            return end + 1
        found = _WORD.match(text, at)
        if found is not None:
            self._add(Word(found[0], self._place(at, found.end())), at, found.end())
            return found.end()
        junk = _JUNK.match(text, at)
        end = at + 1 if junk is None else junk.end()
        fix = "names begin with a letter; Python is in [brackets]."
        if first == "." and (code := _CODE.search(text, max(0, at - 40), at)):
            stop, depth = min(len(text), at + 80), 0
            while end < stop and text[end] != "\n" and depth - (text[end] == ")") >= 0:
                depth += (text[end] == "(") - (text[end] == ")")
                end += 1  # to the bracket that closes the form
            fix = f"write Python in brackets: [{text[code.start() : end].strip()}]."
        self._report(at, end, f"{text[at:end].strip()!r} cannot be here.", fix)
        return end

    def _read_code(self, at: int) -> int:
        end = _end_of_code(self.text, at)
        if isinstance(end, str) or (self.is_by_indentation and "\n(" in self.text[at:end]):
            following = _FORM.search(self.text, at + 1)
            stop = len(self.text) if following is None else following.end() - 1
            why = end if isinstance(end, str) else "'[' is not closed."
            self.is_unbalanced = True
            self._report(at, at + 1, why, f"add what is missing before line {self._at(stop)[0]}.")
            return stop
        self._add(Code(self.text[at + 1 : end - 1], self._place(at + 1, end - 1)), at, end)
        return end

    # -- brackets -----------------------------------------------------------------------------------------------------

    def _close(self, end: int) -> None:
        one = self._open.pop()
        form = Form(tuple(one.items), self._place(one.start, end))
        if self._open:
            self._open[-1].items.append(form)
        else:
            self.forms.append(form)

    def _close_by_indentation(self, at: int) -> None:
        """Close, as mistakes, the forms that a line ends which begins at their column or before."""
        if at not in self._first_in_line:
            return
        column = self._at(at)[1]
        while self._open and self._open[-1].column >= column:
            self._report_unclosed(self._open[-1], at)
            self._close(at)

    def _report_unclosed(self, one: _Open, next_at: int | None) -> None:
        self.is_unbalanced = True
        where = "the end of the text" if next_at is None else f"line {self._at(next_at)[0]}, where the next form begins"
        self._report(one.start, one.start + 1, "'(' is not closed.", f"add ')' before {where}.")

    def _add(self, item: Item, start: int, end: int) -> None:
        if self._open:
            self._open[-1].items.append(item)
        else:
            self._report(
                start, end, f"{self.text[start:end]:.40} is outside of all forms.", "(machine ...), (spawn ...)."
            )

    # -- places -------------------------------------------------------------------------------------------------------

    def _at(self, at: int) -> tuple[int, int]:
        """Return line and column of a character."""
        line = bisect_right(self._starts, at)
        return line, at - self._starts[line - 1] + 1

    def _place(self, start: int, end: int) -> Place:
        return Place(*self._at(start), *self._at(end))

    def _report(self, start: int, end: int, message: str, fix: str) -> None:
        if len(self.problems) < MAX_PROBLEMS:
            self.problems.append(Problem(self._place(start, end), message, fix))


def _end_of_code(text: str, at: int) -> int | str:
    """Return the place after the bracket that closes the one at a place; or what is wrong."""
    open_brackets: list[str] = []
    for found in _IN_CODE.finditer(text, at):
        token = found[0]
        if token in _CLOSING:
            open_brackets.append(token)
        elif token in _CLOSING.values():
            if _CLOSING[open_brackets[-1]] != token:
                return f"'{open_brackets[-1]}' is closed by '{token}'."
            open_brackets.pop()
            if not open_brackets:
                return found.end()
        elif token in ("'", '"'):
            return "A text in the code is not closed."
    return "'[' is not closed."
