"""The student's submission as a check uses it: texts to read, functions to call, components to feed and to run.

The student's code runs in a process of its own (`child.py`), which starts when it is first needed.
Its failures are raised as `SubmissionError`, which the grader turns into a failed case: a check need not catch it.
"""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from snr_sim.grading.batch.parsing import MAX_PARSED_BYTES
from snr_sim.grading.lab.verdicts import GraderError, SubmissionError
from snr_sim.grading.remote import protocol
from snr_sim.grading.remote.child_process import ChildProcess
from snr_sim.grading.remote.exit_errors import submission_error
from snr_sim.grading.remote.fork_server import ForkServer
from snr_sim.grading.remote.imports import check_imports
from snr_sim.grading.remote.piped_process import begin_process
from snr_sim.grading.remote.sent_code import code_to_send
from snr_sim.grading.reports.results import Isolation
from snr_sim.grading.sandbox.sandbox import Limits
from snr_sim.prelude.structs import ensure_type_info
from snr_sim.prelude.values import encode_value, may_have_tags

if TYPE_CHECKING:
    from snr_sim.grading.lab.scenario_run import ScenarioRun
    from snr_sim.grading.lab.stimulus import Output, Stimulus

MAX_SOURCE_BYTES = 1 << 20
CALL_CPU_S = 10.0


class Student:
    """One submission, for one case; close it in the end, or use `with`.

    Args:
        folder: of the submission.
        isolation: "sandbox", "confined", or "none".
        may_import: modules that are refused otherwise.
        limits: of each of its processes.
        record_to: folder for runs that the student may see; not recorded if not given.
        fork_server: fork server that creates its processes, if given.
        refused: further modules that the lab refuses, with the reasons.
    """

    def __init__(
        self,
        folder: Path,
        isolation: Isolation = "none",
        may_import: frozenset[str] = frozenset(),
        limits: Limits | None = None,
        record_to: Path | None = None,
        fork_server: ForkServer | None = None,
        refused: Mapping[str, str] | None = None,
    ) -> None:
        self.folder = folder.resolve()
        self.isolation = isolation
        self.limits = limits or Limits()
        self.record_to = record_to
        self.run_folder: Path | None = None  # of the last run, if it was recorded
        self.run_count = 0
        self.last_file = ""  # the submitted file that was used last, by a call, inputs or a run
        self._may_import = may_import
        self._refused = refused or {}
        self._fork_server = fork_server
        self._child: ChildProcess | None = None
        self._printed: list[str] = []

    def __enter__(self) -> Student:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def source(self, file: str, max_bytes: int = MAX_SOURCE_BYTES) -> str:
        """Return the text of a submitted file.

        Args:
            file: of the submission.
            max_bytes: limit of its size. A text that the check parses is short (`MAX_PARSED_BYTES`); or see `parse`.

        Raises:
            SubmissionError: it is missing, too long, or not text.
        """
        path = self._path(file)
        try:
            with path.open("rb") as opened:
                data = opened.read(max_bytes + 1)
        except OSError:
            raise SubmissionError(
                f"There is no file {file}.", f"Hand in a file called {file}.", expected=file
            ) from None
        self.last_file = file
        if len(data) > max_bytes:
            hint = "Hand in the program alone." if file.endswith(".py") else "Write less: some pages are enough."
            raise SubmissionError(f"{file} has more than {max_bytes} bytes.", hint)
        try:
            return data.decode()
        except UnicodeDecodeError as error:
            line = data.count(b"\n", 0, error.start) + 1
            raise SubmissionError(f"{file}, line {line}: this is not text.", "Save it as UTF-8 text.") from None

    def parse(self, file: str, parser: Callable[[bytes], Any], max_bytes: int = MAX_PARSED_BYTES) -> Any:
        """Return the result of a parser for a submitted file, in a process that runs nothing of the submission.

        Args:
            file: of the submission.
            parser: of snr_sim or the lab (see `create_object`); it gets the bytes, and returns values as for `call`.
            max_bytes: limit of the file's size.

        Raises:
            SubmissionError: the file is missing, too long, or not valid for the parser.
        """
        data = self.source(file, max_bytes).encode()
        child = begin_process(self.folder, self.isolation, self.limits, (), self._fork_server)
        try:
            return _parsed(child, parser, data)
        except SubmissionError as wrong:
            raise SubmissionError(f"{file}: {wrong.message}", f"{file} cannot be read: keep its form.") from wrong
        finally:
            self.close_child(child)

    def call(
        self,
        file: str,
        function: str,
        *args: Any,
        returns: Any = Any,
        finite: bool = True,
        budget_s: float = CALL_CPU_S,
    ) -> Any:
        """Call a function of a submitted file, in the student's process, and return what it returns.

        Several calls in one case use the same process, so the file's module state persists.

        Args:
            file: of the submission.
            function: its name.
            args: numbers, texts, lists, tuples, dicts, arrays.
            returns: required type of the result, such as `float`, `list[float]` or `dict[str, int]`.
            finite: whether nan and inf are refused.
            budget_s: CPU time it may take.

        Returns:
            numbers, texts, lists or dicts of these: a tuple comes back as a list, an array as lists.

        Raises:
            SubmissionError: the program raised, was too slow, or returned another type.
        """
        values = msgspec.Raw(encode_value(list(args)))
        self.child(file)
        raw = self._ask(protocol.Call(file, function, values), budget_s)
        return _checked(f"{file}: {function}(...)", raw, returns, finite)

    def create_object(self, file: str, kind: type[Any], *args: Any, budget_s: float = CALL_CPU_S) -> RemoteObject:
        """Create an object of snr_sim or the lab in the student's process, around the student's module.

        For frequent, short exchanges: the object loops there, over many observations in one message.

        Args:
            file: of the submission; the class gets it as a module, first.
            kind: a class of snr_sim, or of a module in the lab's folder. That module is sent to the process, where the
                student can read it; it imports nothing else of the lab.
            args: further values for the class.
            budget_s: CPU time it may take.

        Raises:
            SubmissionError: as for `call`.
            GraderError: the class belongs to neither.
        """
        code = code_to_send(kind)
        self.child(file)
        args_raw = msgspec.Raw(encode_value(list(args)))
        raw = self._ask(protocol.MakeObject(file, code, args_raw), budget_s)
        try:
            return RemoteObject(self, protocol.decode_as(_decode_number, raw), file)
        except protocol.ProtocolError as error:
            raise invalid_response(error) from error

    def run_inputs(self, file: str, pages: Sequence[Stimulus], **details: Any) -> list[Output]:
        """Bring pages and tasks to the components of a submitted file; see `stimulus.run_inputs`."""
        from snr_sim.grading.lab.stimulus import run_inputs  # a slow import

        return run_inputs(self, file, pages, **details)

    def run_scenario(
        self,
        scenario: str,
        seed: int,
        controller: str,
        options: dict[str, str] | None = None,
        io: str = "sim",
        engine: str | None = None,
        record: bool = True,
        may_fail: bool = False,
    ) -> ScenarioRun:
        """Run a scenario with the components of a submitted file as its controller; see `scenario_run.run_scenario`."""
        from snr_sim.grading.lab.scenario_run import run_scenario

        return run_scenario(self, scenario, seed, controller, options or {}, io, engine, record, may_fail)

    @property
    def printed(self) -> str:
        """What the program has printed so far, in all its processes."""
        return "\n".join(text for text in [*self._printed, self._child.printed if self._child else ""] if text)

    @property
    def cpu_time_s(self) -> float | None:
        """CPU time of the process of this case's calls, as the kernel counts it; None where it is not reported."""
        return None if self._child is None else self._child.cpu_time_s

    def child(self, file: str) -> ChildProcess:
        """Return the process of this case's calls, made when it is first needed."""
        if self._child is None:
            self._child = self.new_child(file)
        return self._child

    def new_child(self, file: str, readable: Sequence[Path] = ()) -> ChildProcess:
        """Return a process of its own, which has not read the submission yet; `close_child` ends it.

        Raises:
            SubmissionError: the file is missing, or imports a refused module.
        """
        self.source(file)
        child = begin_process(self.folder, self.isolation, self.limits, readable, self._fork_server)
        try:
            check_imports(self.folder, file, self._may_import, self._refused, partial(_parsed, child))
        except BaseException:
            self.close_child(child)
            raise
        return child

    def close_child(self, child: ChildProcess) -> None:
        """End a process, and keep its output."""
        try:
            child.close()
        finally:
            if child.printed:
                self._printed.append(child.printed)

    def close(self) -> None:
        """End the process of this case's calls.

        Raises:
            SubmissionError: it had printed too much.
        """
        if self._child is not None:
            child, self._child = self._child, None
            self.close_child(child)

    def _path(self, file: str) -> Path:
        if Path(file).is_absolute() or ".." in Path(file).parts:
            raise GraderError(f"A check asks for {file!r}, which is outside of the submission.")
        path = (self.folder / file).resolve()
        if not path.is_relative_to(self.folder):
            raise SubmissionError(f"{file} is a link to elsewhere.", f"Hand in {file} itself, not a link.")
        return path

    def _ask(self, verb: protocol.Verb, budget_s: float) -> msgspec.Raw:
        assert self._child is not None
        try:
            answer = self._child.ask(verb, budget_s)
        except protocol.ProtocolError as error:
            raise invalid_response(error) from error
        if answer.error is not None:
            raise submission_error(answer.error)
        return answer.value


class RemoteObject:
    """An object in the student's process; `Student.create_object` makes it."""

    def __init__(self, student: Student, number: int, file: str) -> None:
        self._student = student
        self._number = number
        self._file = file

    def ask(
        self, method: str, *args: Any, returns: Any = Any, finite: bool = True, budget_s: float = CALL_CPU_S
    ) -> Any:
        """Call a method of the object; answer and errors as for `Student.call`.

        Args:
            method: its name.
            args: finite numbers, texts, lists, dicts: encoded without further checks, and tuples become lists.
            returns, finite, budget_s: as for `Student.call`.
        """
        verb = protocol.AskObject(self._number, method, msgspec.Raw(protocol.encode(args)))
        raw = self._student._ask(verb, budget_s)
        return _checked(f"{self._file}: {method}(...)", raw, returns, finite)


def _parsed(child: ChildProcess, parser: Callable[[bytes], Any], data: bytes) -> Any:
    try:
        answer = child.ask(protocol.Parse(code_to_send(parser), data), CALL_CPU_S)
        if answer.error is not None:
            raise submission_error(answer.error)
        return protocol.plain_value(answer.value)
    except protocol.ProtocolError as error:
        raise invalid_response(error) from error


_decode_number = msgspec.json.Decoder(int)


def invalid_response(error: protocol.ProtocolError) -> SubmissionError:
    """Return the error for an answer that is not valid."""
    return SubmissionError(
        error.message,
        "Return numbers, texts, lists, or dicts of these, and do not write to the grader's file descriptors.",
    )


def _checked(what: str, raw: msgspec.Raw, returns: Any, finite: bool) -> Any:
    """Return the value in an answer, of the form that was asked for."""
    if returns is str:  # the most frequent type, and a text contains nothing that needs further checks
        with suppress(msgspec.DecodeError, UnicodeDecodeError):
            return _decode_text(raw)
    try:
        value = protocol.plain_value(raw)
        if may_have_tags(bytes(raw)):  # only then can there be more than plain JSON
            _check_plain(what, value, finite)
    except protocol.ProtocolError as error:
        raise invalid_response(error) from error
    if returns is Any:
        return value
    try:
        return msgspec.convert(value, ensure_type_info(returns), strict=True)
    except msgspec.ValidationError as error:
        raise SubmissionError(
            f"{what} returned {reprlib.repr(value)}.",
            f"Return what the lab asks for: {_type_name(returns)}.",
            expected=_type_name(returns),
            actual=str(error).replace("`$", "`"),
        ) from None


def _check_plain(what: str, value: Any, finite: bool) -> None:
    kind = type(value)
    if kind is float and finite and not -float("inf") < value < float("inf"):
        raise SubmissionError(
            f"{what} returned {value!r} among its numbers.",
            "Return finite numbers: what is divided by zero, or never set?",
            expected="finite numbers",
            actual=repr(value),
        )
    if kind is list:
        for item in value:
            _check_plain(what, item, finite)
    elif kind is dict and all(type(key) is str for key in value):
        for item in value.values():
            _check_plain(what, item, finite)
    elif value is not None and kind not in (bool, int, float, str):
        raise protocol.ProtocolError("The submission broke the grading protocol: its answer is not a plain value.")


_TYPE_NAMES = {
    float: "a number",
    int: "a whole number",
    str: "a text",
    bool: "True or False",
    list[float]: "a list of numbers",
    list[int]: "a list of whole numbers",
    list[str]: "a list of texts",
}


def _type_name(returns: Any) -> str:
    if returns in _TYPE_NAMES:
        return _TYPE_NAMES[returns]
    return returns.__name__ if isinstance(returns, type) and not hasattr(returns, "__args__") else str(returns)


_decode_text = msgspec.json.Decoder(str).decode
