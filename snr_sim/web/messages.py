"""Messages between the live page of a machine and its server: one JSON object in each text frame of the WebSocket.

Both ends reject what has an unknown kind, an unknown field, or a value out of the bounds that the types state. The
schema `live.schema.json` is made of these classes. docs/formats.md, section 9, has their order, and an example of each.
"""

from __future__ import annotations

from collections.abc import Callable
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
Rights: TypeAlias = Literal["change", "look"]
By: TypeAlias = Literal["start", "page", "elsewhere"]
RunTime: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0, le=1e9)]
Integer: TypeAlias = Annotated[int, msgspec.Meta(ge=-(2**53), le=2**53)]  # what JavaScript counts exactly


# -- what messages contain ---------------------------------------------------------------------------------------------


class HungUpError(Exception):
    """A connection is to be closed; the text is sent to the browser first."""


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
        file: that declares it, if it is imported; empty otherwise. All lines are of that text.
        transitions: in the order in which they are tried.
    """

    path: str
    name: str
    initial: str
    file: str
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


class Course(_Part, frozen=True):
    """What machines did in a simulation: changes of state, and the scenario's verdict; empty if it has not ended."""

    changes: list[Moment]
    end: str


class _Message(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind"):
    """A message."""


# -- from the server --------------------------------------------------------------------------------------------------


class Hello(_Message, frozen=True, tag="hello"):
    """The first message. It comes again if the machine's component is reloaded: then its programs are others.

    Args:
        name: of the machine's component.
        title: of the page.
        is_live: whether the run continues here; otherwise it is read from its folder.
        rights: 'look' may send Show and Why only.
        is_editable: whether Edit is possible: an LRP program, a run that continues, and the right to change.
        number: of the program that runs; the first one is 1.
        sha256, text: of that program.
        files: texts of the programs that it imports, by the names of their files.
        graph: its machines.
        parts: what its blocks can name.
        signals: names that it waits for.
        t_s: now; of a recorded run its end.
        until_s: end of the timeline.
    """

    name: str
    title: str
    is_live: bool
    rights: Rights
    is_editable: bool
    number: int
    sha256: str
    text: str
    files: dict[str, str]
    graph: list[Graph]
    parts: list[RobotPart]
    signals: list[str]
    t_s: float
    until_s: float


class State(_Message, frozen=True, tag="state"):
    """What a machine does at one moment.

    Args:
        is_live: whether it is the newest; false in the answer to Show.
        number: of the program then; its text was sent before.
        active: the state of each machine that runs, by path; outer ones first.
        entered_s: when each of them entered it.
        last: the newest change of state.
        variables: by path, such as "speed" or "dora.side".
        reads, drives: parts of the robot, by name.
        problems: blocks that failed.
        changes: changes of state since the last live State of this connection; empty in the answer to Show.
        missed: number of changes that were left out of `changes` because there were too many.
    """

    is_live: bool
    t_s: float
    number: int
    active: dict[str, str]
    entered_s: dict[str, float]
    last: Moment | None
    variables: dict[str, Any]
    reads: dict[str, Reading]
    drives: dict[str, Command]
    problems: list[Problem]
    is_paused: bool
    changes: list[Moment]
    missed: int


class Program(_Message, frozen=True, tag="program"):
    """Another program than that of Hello: from an edit, or from another time of the run.

    Args:
        by: 'start' for the first one, 'page' if a live page edited it, otherwise 'elsewhere': a file, a console.
        t_s: when it began.
    """

    number: int
    sha256: str
    text: str
    files: dict[str, str]
    graph: list[Graph]
    signals: list[str]
    by: By
    t_s: float


class Edited(_Message, frozen=True, tag="edited"):
    """The answer to an Edit, or to Do undo.

    Args:
        number: of the Edit; null for an undo.
        ok: whether the program was replaced. If not, the one before continues.
        is_stale: another edit came first: `text` and `sha256` are of that one.
        program: number of the program that runs now.
        sha256: of it.
        text, files: of it, if the edit was stale or an undo; otherwise null.
        problems: mistakes, or warnings.
        notes: what may surprise.
        kept, restarted, stopped: paths of machines.
    """

    number: int | None
    ok: bool
    is_stale: bool
    program: int
    sha256: str
    text: str | None
    files: dict[str, str] | None
    problems: list[Problem]
    notes: list[str]
    kept: list[str]
    restarted: list[str]
    stopped: list[str]


class WhyAnswer(_Message, frozen=True, tag="why"):
    """The answer to Why. `error` says why there is none; `left_out` is the number of evaluations left out."""

    machine: str
    transition: str
    from_s: float
    until_s: float
    rows: list[WhyRow]
    left_out: int
    error: str


class Tried(_Message, frozen=True, tag="tried"):
    """The answer to Try: with the program that runs, and with the other one. `error` says why there is none."""

    at_s: float
    until_s: float
    unchanged: Course
    edited: Course
    error: str


class Timeline(_Message, frozen=True, tag="timeline"):
    """Changes of state up to now, in order; several messages if there are many.

    Args:
        moments: those that follow the ones of the message before.
        until_s: end of the run so far.
        is_complete: whether it is the last of these messages. Later changes come with State.
    """

    moments: list[Moment]
    until_s: float
    is_complete: bool


class Refused(_Message, frozen=True, tag="refused"):
    """A message could not be carried out: its `kind`, and why. Nothing has changed."""

    message: str
    reason: str


class Gone(_Message, frozen=True, tag="gone"):
    """The last message: why the connection is closed."""

    reason: str


# -- from the page ----------------------------------------------------------------------------------------------------


class Edit(_Message, frozen=True, tag="edit"):
    """Continue with another text.

    Args:
        number: chosen by the page; the answer has it.
        text: of the whole program, or of the file.
        base_sha256: of the program that was edited. If another edit came first, this one is refused.
        file: that the program imports; empty: the program itself.
        is_tried: whether it is only checked: the answer has its mistakes, and nothing changes.
    """

    number: Count
    text: Text
    base_sha256: Sha256
    file: Name = ""
    is_tried: bool = False


class Try(_Message, frozen=True, tag="try"):
    """Ask what another text would do from a moment of the run on, in a simulation. Fields as of Edit."""

    text: Text
    file: Name
    at_s: RunTime


class SetValue(_Message, frozen=True, tag="set"):
    """Set a variable, by its path."""

    path: Name
    value: Integer | float | ShortText | bool | None


class Give(_Message, frozen=True, tag="give"):
    """Give a signal that the program waits for."""

    signal: Name


class Do(_Message, frozen=True, tag="do"):
    """Press a button.

    pause: take no more steps, and command neutral. go: continue. step: while paused, take one step. undo: continue with
    the text before the newest edit.
    """

    what: Literal["pause", "go", "step", "undo"]


class Show(_Message, frozen=True, tag="show"):
    """Ask for the State of a moment."""

    t_s: RunTime


class Why(_Message, frozen=True, tag="why"):
    """Ask why transitions were taken or not, in an interval.

    Args:
        machine: path; empty for all.
        transition: name; empty for all.
        from_s, until_s: the interval, inclusive.
    """

    machine: Name
    transition: Name
    from_s: RunTime
    until_s: RunTime


FromServer: TypeAlias = Hello | State | Program | Edited | WhyAnswer | Tried | Timeline | Refused | Gone
FromPage: TypeAlias = Edit | Try | SetValue | Do | Give | Show | Why

encode: Callable[[FromServer], bytes] = msgspec.json.Encoder().encode
decode_from_page: Callable[[str | bytes], FromPage] = msgspec.json.Decoder(FromPage).decode
