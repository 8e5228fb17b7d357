"""What messages of the live page contain, and the bounds of their fields; see `messages.py`."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

import msgspec

MAX_MESSAGE_BYTES = 1 << 18  # of a message of the page
MAX_TEXT_CHARS = 200_000  # of a program
MAX_NAME_CHARS = 500

Count: TypeAlias = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
Name: TypeAlias = Annotated[str, msgspec.Meta(max_length=MAX_NAME_CHARS)]
ShortText: TypeAlias = Annotated[str, msgspec.Meta(max_length=10_000)]
Text: TypeAlias = Annotated[str, msgspec.Meta(max_length=MAX_TEXT_CHARS)]
Sha256: TypeAlias = Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]
By: TypeAlias = Literal["start", "page", "elsewhere"]
RunTime: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0, le=1e9)]
Integer: TypeAlias = Annotated[int, msgspec.Meta(ge=-(2**53), le=2**53)]  # what JavaScript counts exactly


class _Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a message contains."""


class Problem(_Part, frozen=True):
    """A mistake in a program, or a block that failed while it ran: as `snr machine check --json` prints it.

    Args:
        line, column, end_line, end_column: from 1; 0 if unknown. The end is the character after it.
        message: what is wrong.
        fix: what to try; may be empty.
        is_error: otherwise it is a warning.
    """

    line: int
    column: int
    end_line: int
    end_column: int
    message: str
    fix: str
    is_error: bool


class Arrow(_Part, frozen=True):
    """A transition as it is declared.

    Args:
        kind: on, ontime, eps or exit. The target of an exit is a state of the machine around.
        source: a state, or '*' for every state but the target.
        line: in the text; 0 if unknown.
        label: its condition, signal or time, for a drawing.
    """

    name: str
    kind: Literal["on", "ontime", "eps", "exit"]
    source: str
    target: str
    line: int
    label: str


class GraphState(_Part, frozen=True):
    """A state, and the machines inside it."""

    name: str
    line: int
    machines: list[Graph]


class Graph(_Part, frozen=True):
    """A machine as a drawing needs it.

    Args:
        path: as in `active`, such as "dora/looking/scan".
        initial: the state in which it begins.
        transitions: in the order in which they are tried.
    """

    path: str
    name: str
    initial: str
    line: int
    states: list[GraphState]
    transitions: list[Arrow]


class Moment(_Part, frozen=True):
    """A change of state, as the event "<name>.transition" has it.

    Args:
        kind: of the transition: on, ontime, eps, exit; or spawn, stop, edit.
        name: of the transition.
        source, target: states; empty if the machine did not run before, or does not run afterwards.
        held_s: time in the source.
        line: in the text of program `number`; 0 if unknown. Of a machine in a Python file it is a line of that file,
            and not of the listing that is shown as its text.
    """

    t_s: float
    machine: str
    kind: str
    name: str
    source: str
    target: str
    held_s: float
    line: int
    number: int


class Reading(_Part, frozen=True):
    """A part of the robot that is read: value, age, and the age from which it is not given to the program.

    Null: there is none, or no limit.
    """

    value: Any
    age_s: float | None
    limit_s: float | None


class Command(_Part, frozen=True):
    """A part of the robot that is commanded: the newest command, and the time until it was applied, if known."""

    value: Any
    delay_s: float | None


class RobotPart(_Part, frozen=True):
    """A part of the robot that blocks can name.

    Args:
        functions: that it has, as in `robot.ultra.read()`.
        low, high: limits of its commands.
    """

    name: str
    functions: list[str]
    unit: str
    low: float | None
    high: float | None


class WhyRow(_Part, frozen=True):
    """How often a transition was looked at in an interval, and what its condition found.

    Args:
        longest_s: longest time in the state when it was looked at.
        after_s: time that it waits for.
        values: range of each part of its condition, as text.
        errors: how often the condition failed, by error.
    """

    machine: str
    state: str
    transition: str
    target: str
    line: int
    evaluated: int
    taken: int
    longest_s: float
    after_s: float | None
    values: dict[str, str]
    errors: dict[str, int]
