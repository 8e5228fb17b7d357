"""A table of commands, and the machinery that reads it: the parser, the help and the completion come from one row."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, TypeAlias

import msgspec

from snr_sim.console.words import NAME_MAX_CHARS, CommandRefused, name_of, shown, split_line, value_of
from snr_sim.prelude.errors import nearest

COMPLETIONS_MAX = 200


class Answer(msgspec.Struct, frozen=True):
    """What a command gives back.

    Args:
        text: for a person.
        data: the same for a program: plain values, bounded.
        is_error: the command was refused; `text` says why.
        about: the key of the watched page that brings this answer, if nobody asked just now.
    """

    text: str
    data: Any = None
    is_error: bool = False
    about: str = ""


@dataclass(frozen=True)
class Argument:
    """One thing a command takes.

    Args:
        name: as help shows it; capitals, or the words to choose from.
        kind: 'name' is a word, 'value' is JSON, 'text' is the rest of the line as it stands.
        is_optional: it may be left out.
        is_many: takes all words that are left.
        choices: the only words it can be. One that is optional is left out where another word stands.
        known: returns the names to complete with, of a node.
    """

    name: str
    kind: str = "name"
    is_optional: bool = False
    is_many: bool = False
    choices: tuple[str, ...] = ()
    known: Callable[[Any], Iterable[str]] | None = None

    @property
    def usage(self) -> str:
        """How help shows it."""
        shown_name = f"{self.name}..." if self.is_many else self.name
        return f"[{shown_name}]" if self.is_optional else shown_name


Given: TypeAlias = Mapping[str, Any]


@dataclass(frozen=True)
class Command:
    """A row of the table: a name, what it takes, what it is for, and what it does for a console's session."""

    name: str
    arguments: tuple[Argument, ...]
    help: str
    run: Callable[[Any, Given], Answer]

    @property
    def usage(self) -> str:
        """How it is typed."""
        return " ".join([self.name, *(argument.usage for argument in self.arguments)])


Table: TypeAlias = Mapping[str, Command]


def parse(table: Table, line: str) -> tuple[Command, dict[str, Any]]:
    """Return the command of a line, and its arguments by name.

    Raises:
        CommandRefused: no such command, or not what it takes.
    """
    words = split_line(line)
    if not words:
        raise CommandRefused("An empty line is no command.", fix="help says what there is.")
    command = table.get(words[0])
    if command is None:
        raise CommandRefused(f"There is no command {shown(words[0])}.", fix=nearest(words[0][:NAME_MAX_CHARS], table))
    try:
        return command, _arguments(command, words[1:])
    except CommandRefused:
        _check_misspelt(command, words[1:])
        raise


def _arguments(command: Command, words: list[str]) -> dict[str, Any]:
    given: dict[str, Any] = {}
    for argument in command.arguments:
        if argument.is_many or argument.kind == "text":
            given[argument.name] = _rest(argument, words)
            words = []
        elif words and not (argument.is_optional and argument.choices and words[0] not in argument.choices):
            given[argument.name] = _one(argument, words[0])
            words = words[1:]
        elif not argument.is_optional:
            raise CommandRefused(f"'{command.name}' needs {argument.name}.", fix=command.usage)
    if words:
        choices = command.arguments[-1].choices if command.arguments[-1].name not in given else ()
        fix = nearest(words[0][:NAME_MAX_CHARS], choices) if choices else command.usage
        raise CommandRefused(f"'{command.name}' does not take {shown(words[0])}.", fix=fix)
    return given


def _check_misspelt(command: Command, words: list[str]) -> None:
    """Say so if a line makes no sense because its first word was to be one that may also be left out.

    Raises:
        CommandRefused: it is like one of them.
    """
    for argument in command.arguments[:1]:
        if words and argument.is_optional and get_close_matches(words[0][:NAME_MAX_CHARS], argument.choices, 1, 0.7):
            _one(argument, words[0])


def _rest(argument: Argument, words: Sequence[str]) -> Any:
    if argument.kind == "text":
        return name_of(" ".join(words), argument.name) if words else ""
    return [_one(argument, word) for word in words]


def _one(argument: Argument, word: str) -> Any:
    if argument.kind == "value":
        return value_of(word)
    name = name_of(word, argument.name)
    if argument.choices and name not in argument.choices:
        raise CommandRefused(f"{shown(name)} is no {argument.name}.", fix=nearest(name, argument.choices))
    return name


def help_text(table: Table) -> str:
    """Return a line for each command."""
    width = max(len(command.usage) for command in table.values())
    return "\n".join(f"{command.usage:<{width}}  {command.help}" for command in table.values())


def completions(table: Table, line: str, node: Any) -> list[str]:
    """Return the words that can stand where the line ends, instead of its last, begun word."""
    words = line.split()
    begun = words.pop() if words and not line[-1].isspace() else ""
    if not words:
        candidates: Iterable[str] = table
    else:
        command = table.get(words[0])
        candidates = _candidates(command.arguments, words[1:], node) if command is not None else ()
    found = sorted({word for word in candidates if word.startswith(begun)})
    return found[:COMPLETIONS_MAX]


def _candidates(arguments: Sequence[Argument], words: Sequence[str], node: Any) -> list[str]:
    """Return what can come after these words: for this argument, and for the next if this can be left out."""
    left = list(words)
    found: list[str] = []
    for argument in arguments:
        is_left_out = argument.is_optional and argument.choices and not (left and left[0] in argument.choices)
        if left and not is_left_out:
            left = left if argument.is_many else left[1:]
            continue
        if left:
            continue
        found += argument.choices
        found += argument.known(node) if argument.known is not None else ()
        if not is_left_out:
            break
    return found
