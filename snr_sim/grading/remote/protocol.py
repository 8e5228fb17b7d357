"""Messages between grader and student's process: one line of JSON each way; the grader sends the first.

    --> {"n": 7, "cpu_s": 10.0, "verb": {"do": "call", "file": "mixer.py", "function": "mix", "args": [0.5]}}
    <-- {"n": 7, "value": [1500, 1550]}      or      {"n": 7, "error": {"step": "call", "text": "mixer.py, line 3: "}}

What the student's process sends is untrusted: a line has a maximum length and a maximum depth of nesting, and JSON can
carry only numbers, texts, lists, dicts, true, false and null. So no object of a class of the student's, whose
comparisons could lie, reaches the grader.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar

import msgspec

from snr_sim.grading.lab.verdicts import SubmissionError
from snr_sim.grading.remote.sent_code import SentCode
from snr_sim.links.messages import check_exponents, without_texts
from snr_sim.prelude.errors import ValueEncodingError
from snr_sim.prelude.values import JSON_ERRORS, decode_value

MAX_RESPONSE_BYTES = 1 << 20
MAX_DEPTH = 32
PIPES = -1  # in place of a descriptor: the process is asked on its stdin and answers on its stdout
# Between the grader and its fork server: "fork" and a folder, or "wait" and a copy's number; a number, or "used up".
FORK, WAIT, USED_UP = b"fork", b"wait", b"used up"
NUMBER: struct.Struct = struct.Struct("i")
MAX_WORD_BYTES = 1 << 13  # longer than any path
SUBMISSION = "."  # the name of the submission's folder; those of robots have theirs
BROKEN = "The submission broke the grading protocol"
SLOW_HINT = "That took too long: is there a loop without an end?"
# Type of the task, its name (None: every one), and the handler's name.
HandlerRow: TypeAlias = tuple[str, str | None, str]


class _Verb(msgspec.Struct, frozen=True, tag_field="do", tag=str.lower):
    """What the grader asks for: of each kind the child has a function (`Child.verbs`)."""


class Hello(_Verb, frozen=True):
    """Tell which user's this process is."""


class Call(_Verb, frozen=True):
    """Call a function of a file of the submission."""

    file: str
    function: str
    args: msgspec.Raw  # a list, as `values.encode_value` writes it


class MakeObject(_Verb, frozen=True, tag="host"):
    """Create an object of snr_sim or the lab, whose class gets the student's module first."""

    file: str
    host: SentCode
    args: msgspec.Raw


class AskObject(_Verb, frozen=True, tag="ask"):
    """Call a method of such an object, by its number."""

    number: int
    method: str
    args: msgspec.Raw


class Parse(_Verb, frozen=True):
    """Apply a parser of snr_sim or the lab."""

    parser: SentCode
    data: bytes


class LoadRequest(_Verb, frozen=True, tag="load"):
    """Read this file of the submission."""

    file: str
    robots: list[tuple[str, str]]  # names and folders of robots whose modules it may import


class Open(_Verb, frozen=True):
    """Call `factories` of a file that was read."""

    file: str
    robot: str  # its argument, pickled, in base64


class Make(_Verb, frozen=True):
    """Make the component of a factory in the node of a role."""

    node: str
    factory: int
    chance: int


class _ComponentVerb(_Verb, frozen=True):
    """A request to a component of a node at a time; `pages` are new in the datastore since the last message."""

    node: str
    component: str
    now_s: float
    pages: list[msgspec.Raw]
    came_s: dict[str, float]


class Handle(_ComponentVerb, frozen=True):
    """Handle a task, from this component on.

    Args:
        processed: of `process_data` that carries a page: that page and the one before it, if newer ones are in the
            datastore; nothing if it is the newest. Then `task` is without values. None: `task` has what it carries.
    """

    task: msgspec.Raw
    processed: list[msgspec.Raw] | None


class StepRequest(_ComponentVerb, frozen=True, tag="step"):
    """Do a step of a component's life: begin, join, terminate; of a loop also setup, loop."""

    step: str


Verb: TypeAlias = Hello | Call | MakeObject | AskObject | Parse | LoadRequest | Open | Make | Handle | StepRequest


class CallRequest(msgspec.Struct, frozen=True):
    """Request of the grader: the number of the line, the CPU time that the answer may take, and what is asked for."""

    n: int
    cpu_s: float
    verb: Verb


class RemoteFailure(msgspec.Struct, frozen=True, omit_defaults=True):
    """A failure of the student's program, as reported by its own process."""

    step: str  # that failed: a verb, "load" while a file was read, "slow" when its CPU time was used up
    text: str  # with the student's line first
    fix: str = ""
    is_value: bool = False  # a result cannot be sent to the grader, as opposed to an exception
    is_refused: bool = False  # the program has or returns what snr_sim does not accept, described in `text`

    def as_error(self) -> SubmissionError:
        """Return the failure as the error that the grader raises."""
        text = f"{self.text}\n  Try: {self.fix}" if self.fix else self.text
        if self.is_value:
            return SubmissionError(text, "Return numbers, texts, lists, or dicts of these.")
        if self.step == "slow":
            return SubmissionError(text, SLOW_HINT)
        if self.is_refused and ", line " not in self.text.partition("\n")[0]:
            hint = "What your program gives there is not what is asked for: compare it with the lab's page."
            return SubmissionError(text, hint)
        if self.step == "load":
            first = "" if "\n  Try: " in text else "run it with Python, and "
            return SubmissionError(text, f"Your file could not be read to its end: {first}look at the line named.")
        return SubmissionError(text, "Your program raised an error: look at the line named.")


class CallResponse(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Answer of the student's process to the line of this number: JSON of the form asked for, or the failure."""

    n: int
    value: msgspec.Raw = msgspec.Raw(b"null")
    error: RemoteFailure | None = None

    def result(self) -> msgspec.Raw:
        """Return the value; raise SubmissionError if the student's program failed."""
        if self.error is not None:
            raise self.error.as_error()
        return self.value


class ModuleInfo(msgspec.Struct, frozen=True):
    """A file was read: its OPTIONS and its ROLES, if it has any."""

    options: Any
    roles: Any


class FactoriesInfo(msgspec.Struct, frozen=True):
    """There are factories: for each whether it makes a loop; and which files were read, in which folder."""

    are_loops: list[bool]
    files: list[tuple[str, str]]


class ComponentInfo(msgspec.Struct, frozen=True, omit_defaults=True):
    """A component: its name, its handlers, and which steps of its life its author has written.

    `repeats` is the event that the clock of a state machine sends at each tick: those ticks need no request.
    """

    name: str
    handlers: list[HandlerRow]
    steps: list[str]
    rate_hz: float = 0.0
    first_s: float = 0.0
    next_s: float | None = None
    wakes_on: list[str] = []
    optional_events: list[str] = []
    repeats: str = ""


class StepEffects(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Effects of a step."""

    entered: list[tuple[msgspec.Raw, str]] = []  # tasks from the inbox, and who sent them
    handlers: dict[str, list[HandlerRow]] | None = None  # new ones
    notes: list[str] = []
    missed: list[str] = []  # keys of pages requested but never stored
    output: list[tuple[str, str, str]] = []  # what components have printed and logged: component, level, text


class HandleResult(StepEffects, frozen=True, omit_defaults=True):
    """What handlers returned, by component; and whose handler failed and how, if one did."""

    returned: dict[str, list[msgspec.Raw]]
    failed: str = ""
    failure: RemoteFailure | None = None


class StepResponse(StepEffects, frozen=True, omit_defaults=True):
    """What a step scheduled; of a loop also when its next tick is to come, and whether there is to be one."""

    scheduled: list[msgspec.Raw]
    next_s: float | None = None
    is_stopped: bool = False


class ProtocolError(SubmissionError):
    """A line that violates the protocol."""

    def __init__(self, message: str) -> None:
        super().__init__(
            message,
            "Return numbers, texts, lists, or dicts of these, and do not write to the grader's file descriptors.",
        )


encode: Callable[[Any], bytes] = msgspec.json.Encoder().encode
decode_request: Callable[[bytes], CallRequest] = msgspec.json.Decoder(CallRequest).decode
_decode_response = msgspec.json.Decoder(CallResponse).decode
T = TypeVar("T")
_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))


def decode_response(line: bytes | bytearray) -> CallResponse:
    """Return the answer in a line; raise ProtocolError if there is none."""
    try:
        return _decode_response(line)
    except JSON_ERRORS as error:
        raise ProtocolError(f"{BROKEN}: its answer is not valid: {error}.") from error


def decode_as(decoder: msgspec.json.Decoder[T], raw: msgspec.Raw) -> T:
    """Return a value of a known form; raise ProtocolError if it has another one."""
    check_cost(bytes(raw))
    try:
        return decoder.decode(raw)
    except JSON_ERRORS as error:
        raise ProtocolError(f"{BROKEN}: its answer is not valid: {error}.") from error


def plain_value(raw: msgspec.Raw) -> Any:
    """Return a value of plain JSON, also a number that is not finite; raise ProtocolError for others, or deep ones."""
    data = bytes(raw)
    check_cost(data)
    try:
        return decode_value(data)
    except ValueEncodingError as error:
        raise ProtocolError(f"{BROKEN}: its value is not valid: {error.message}") from error


def check_cost(data: bytes) -> None:
    """Raise ProtocolError for JSON that is too deep for a recursive reader, or has numbers that are slow to decode."""
    try:
        check_exponents(data)
    except ValueEncodingError as error:
        raise ProtocolError(f"{BROKEN}: {error.message}") from error
    if data.count(b"[") + data.count(b"{") <= MAX_DEPTH:
        return
    depth = deepest = 0
    for byte in without_texts(data).translate(None, _NO_BRACKETS):
        if byte in b"[{":
            depth += 1
            deepest = max(deepest, depth)
        elif byte in b"]}":
            depth -= 1
    if deepest > MAX_DEPTH:
        raise ProtocolError(f"Its answer is nested {deepest} levels deep, which is too deep.")
