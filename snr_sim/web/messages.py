"""Messages between the live page of a machine and its server: one JSON object in each text frame of the WebSocket.

`kind` says which one it is. Server and page reject what has an unknown kind, an unknown field, or a value out of the
bounds that the types state; the schema `live.schema.json` is made of these classes. Times are seconds of the run.

    page                                      server
     |                      <-- Hello          |   first
     |                      <-- Timeline ...   |   what has happened so far; until `is_complete`
     |                      <-- State          |   at most 30 times a second, when something has changed
     |                      <-- Program        |   before the first State of another program
     |  Edit -->            <-- Edited         |   each edit is answered, by its number
     |  SetValue, Do, Give -->                 |   the next State shows what they did
     |  Show -->            <-- State          |   `is_live` false: of the moment that was asked for
     |  Why -->             <-- WhyAnswer      |
     |                      <-- Refused        |   a message that could not be carried out; the connection stays
     |                      <-- Gone           |   last: the connection is closed

The page is at `/machine/NAME/`, its WebSocket at `/machine/NAME/socket`; scripts and styles are at `/static/FILE`. The
page must keep the texts that it got by `number`: a State names the program it belongs to, and each is sent once.

From the server:

    {"kind": "hello", "name": "dora", "title": "dora_room, seed 0", "is_live": true, "rights": "change",
     "is_editable": true, "number": 1, "sha256": "9f...", "text": "(machine dora ...", "files": {"turns.lrp": "..."},
     "graph": [...], "parts": [{"name": "ultra", "functions": ["age_ms", "read", "read_since_entry"], "unit": "cm",
     "low": null, "high": null}], "signals": ["halt"], "t_s": 12.5, "until_s": 12.5}

    {"kind": "state", "is_live": true, "t_s": 12.5, "number": 1, "active": {"dora": "forward"},
     "entered_s": {"dora": 11.25}, "last": {"t_s": 11.25, "machine": "dora", "kind": "ontime",
     "name": "turning->forward", "source": "turning", "target": "forward", "held_s": 2.4, "line": 31, "number": 1},
     "variables": {"speed": 50, "dora.side": -1}, "reads": {"ultra": {"value": 81.5, "age_s": 0.02, "limit_s": 0.5}},
     "drives": {"motor_a": {"value": 50.0, "delay_s": null}}, "problems": [], "is_paused": false, "changes": [],
     "missed": 0}

    {"kind": "program", "number": 2, "sha256": "71...", "text": "...", "files": {}, "graph": [...],
     "signals": [], "by": "page", "t_s": 14.0}

    {"kind": "edited", "number": 7, "ok": false, "is_stale": false, "program": 1, "sha256": "9f...", "text": null,
     "problems": [{"line": 3, "column": 5, "end_line": 3, "end_column": 9,
     "message": "There is no state 'forwad' here.", "fix": "did you mean 'forward'?", "is_error": true}],
     "notes": [], "kept": [], "restarted": [], "stopped": []}

    {"kind": "why", "machine": "dora", "transition": "bump", "from_s": 10.0, "until_s": 12.0, "error": "",
     "left_out": 0, "rows": [{"machine": "dora", "state": "forward", "transition": "bump", "target": "backing",
     "line": 26, "evaluated": 180, "taken": 0, "longest_s": 1.8, "after_s": null,
     "values": {"robot.left_touch.read()": "0"}, "errors": {}}]}

    {"kind": "timeline", "is_complete": true, "until_s": 12.5, "moments": [{"t_s": 0.0, "machine": "dora",
     "kind": "spawn", "name": "spawn", "source": "", "target": "waiting", "held_s": 0.0, "line": 6, "number": 1}]}

    {"kind": "refused", "message": "set", "reason": "There is no variable 'dora.sid'. Try: did you mean 'dora.side'?"}

    {"kind": "gone", "reason": "The run has ended: explored."}

In a graph (`Graph`):

    {"path": "dora", "name": "dora", "initial": "waiting", "line": 6, "states": [{"name": "waiting", "line": 11,
     "machines": []}], "transitions": [{"name": "wall", "kind": "on", "source": "forward", "target": "turning",
     "line": 28, "label": "[distance() < near_cm]"}]}

From the page:

    {"kind": "edit", "number": 7, "text": "(machine dora ...", "base_sha256": "9f..."}
    {"kind": "set", "path": "dora.side", "value": 1}
    {"kind": "do", "what": "pause"}
    {"kind": "give", "signal": "halt"}
    {"kind": "show", "t_s": 3.25}
    {"kind": "why", "machine": "dora", "transition": "bump", "from_s": 10.0, "until_s": 12.0}
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeAlias

import msgspec

from snr_sim.web.message_parts import (
    By,
    Command,
    Count,
    Graph,
    Integer,
    Moment,
    Name,
    Problem,
    Reading,
    RobotPart,
    RunTime,
    Sha256,
    ShortText,
    Text,
    WhyRow,
)  # fmt: skip


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
        files: texts of the programs that it imports, by the names of their files; for reading.
        graph: its machines.
        parts: what its blocks can name.
        signals: names that it waits for.
        t_s: now; of a recorded run its end.
        until_s: end of the timeline.
    """

    name: str
    title: str
    is_live: bool
    rights: Literal["change", "look"]
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
        text: of it, if the edit was stale or an undo; otherwise null.
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
        text: of the whole program.
        base_sha256: of the text that was edited. If another edit came first, this one is refused.
    """

    number: Count
    text: Text
    base_sha256: Sha256


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


FromServer: TypeAlias = Hello | State | Program | Edited | WhyAnswer | Timeline | Refused | Gone
FromPage: TypeAlias = Edit | SetValue | Do | Give | Show | Why

encode: Callable[[FromServer], bytes] = msgspec.json.Encoder().encode
decode_from_page: Callable[[str | bytes], FromPage] = msgspec.json.Decoder(FromPage).decode
