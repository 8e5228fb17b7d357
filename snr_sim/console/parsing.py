"""Parser of lines into words and values. Values are JSON of bounded depth; nothing is evaluated as code."""

from __future__ import annotations

from typing import Any

import msgspec

from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.values import MAX_INT, MIN_INT

MAX_LINE_CHARS = 16 * 1024
MAX_NAME_CHARS = 200
MAX_DEPTH = 32  # of values: deeper nesting is unreadable, and can break recorders and links

_decode = msgspec.json.Decoder().decode


class ConsoleCommandError(SnrError):
    """Error for a line that is not a command, or a command that cannot be executed."""


def split_line(line: str) -> list[str]:
    """Return the words of a line: they end at a space outside of brackets and quotes.

    Raises:
        ConsoleCommandError: the line is too long, or has an unclosed bracket or quote.

    >>> split_line('task start [1, 2] "a b" {"k": "]"}')
    ['task', 'start', '[1, 2]', '"a b"', '{"k": "]"}']
    """
    if len(line) > MAX_LINE_CHARS:
        raise ConsoleCommandError(
            f"This line has {len(line)} characters; the console takes up to {MAX_LINE_CHARS}.",
            fix="send large values over a link.",
        )
    words: list[str] = []
    start, depth, in_quotes, is_escaped = -1, 0, False, False
    for i, character in enumerate(line):
        if in_quotes:
            in_quotes = is_escaped or character != '"'
            is_escaped = character == "\\" and not is_escaped
            continue
        if not depth and character.isspace():
            if start >= 0:
                words.append(line[start:i])
            start = -1
            continue
        if start < 0:
            start = i
        in_quotes = character == '"'
        depth = max(depth + (character in "[{") - (character in "]}"), 0)
        if depth > MAX_DEPTH:
            raise ConsoleCommandError(
                f"A value here is nested more than {MAX_DEPTH} deep.", fix="send a flatter value."
            )
    if in_quotes or depth:
        raise ConsoleCommandError(f"A {'quote' if in_quotes else 'bracket'} is not closed: {quote(line)}")
    if start >= 0:
        words.append(line[start:])
    return words


def parse_value(word: str) -> Any:
    """Return the value of a word; raise ConsoleCommandError if it is not JSON, or a number of more than 64 bits."""
    try:
        value = _decode(word.encode())
    except (msgspec.DecodeError, UnicodeEncodeError, RecursionError, ValueError) as error:
        raise ConsoleCommandError(
            f"{quote(word)} is not JSON: {error}.",
            fix=f'text needs quotes: "{word}".' if word.isidentifier() else '1.5, true, "text", [1, 2], {"key": 1}.',
        ) from None
    _check_numbers(value)
    return value


def _check_numbers(value: Any) -> None:
    if isinstance(value, int) and not MIN_INT <= value <= MAX_INT:
        raise ConsoleCommandError("An integer is too large: use -2^63 to 2^64-1.", fix="write it with a decimal point.")
    if isinstance(value, (list, dict)):
        for item in value.values() if isinstance(value, dict) else value:
            _check_numbers(item)


def parse_name(word: str, what: str) -> str:
    """Return the name that a word contains: the word itself, or the content of its quotes.

    Raises:
        ConsoleCommandError: it is empty, too long, or contains characters that cannot be printed.
    """
    name = parse_value(word) if word.startswith('"') else word
    if not isinstance(name, str) or not 0 < len(name) <= MAX_NAME_CHARS or not name.isprintable():
        raise ConsoleCommandError(
            f"{quote(word)} is not a valid {what}.", fix=f"use 1 to {MAX_NAME_CHARS} printable characters."
        )
    return name


def quote(text: str, limit: int = 80) -> str:
    """Return text in quotes, truncated if it is long, with unprintable characters escaped."""
    cut = text[:limit]
    return (f"'{cut}'" if cut.isprintable() else ascii(cut)) + ("..." if len(text) > limit else "")
