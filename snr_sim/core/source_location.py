"""Find the line of student code that caused a failure, and put it first in the message."""

from __future__ import annotations

import linecache
import os
import re
from inspect import getfile, getsourcelines, unwrap
from pathlib import Path
from types import CodeType, FrameType, TracebackType
from typing import NamedTuple

from snr_sim.core.hints import error_message, hint
from snr_sim.prelude.errors import DeviceError, SnrError

# Fix for code that did not return although it was interrupted.
INTERRUPT_FIX = "catch Exception, not BaseException; and put no bare except around what repeats."

_PACKAGE = Path(__file__).resolve().parents[1]
_SHIPPED = _PACKAGE / "shipped"  # robots and scenarios in the wheel: content, not library code
_CONTENT = (_SHIPPED, *(_PACKAGE.parent / kind for kind in ("robots", "scenarios", "assignments")))
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
_STDLIB = Path(os.__file__).resolve().parent


class SourceLocation(NamedTuple):
    """A line in a file."""

    file: str
    line: int
    function: str
    source: str

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}: {self.source}" if self.source else f"{self.file}, line {self.line}"


def location_in(code: CodeType, line: int, function: str = "") -> SourceLocation:
    """Return a line of code; of its own function if no other is given."""
    linecache.checkcache(code.co_filename)
    source = linecache.getline(code.co_filename, line).strip()
    return SourceLocation(short_path(code.co_filename), line, function or code.co_name, source)


def after_line(location: SourceLocation | None, text: str) -> str:
    """Return a text, after the line that it is about if that is known."""
    return text if location is None else f"{location}\n  {text}"


def find_student_location(trace: TracebackType | None, is_content_skipped: bool = False) -> SourceLocation | None:
    """Return the innermost line of student code, or None if there is none in the traceback."""
    trace = _student_trace(trace, is_content_skipped)
    return None if trace is None else location_in(trace.tb_frame.f_code, trace.tb_lineno)


def _student_trace(trace: TracebackType | None, is_content_skipped: bool = False) -> TracebackType | None:
    """Return the innermost part of a traceback that is in student code."""
    found = None
    while trace is not None:
        file = trace.tb_frame.f_code.co_filename
        if is_student_file(file) and not (is_content_skipped and is_content(file)):
            found = trace
        trace = trace.tb_next
    return found


def current_location(frame: FrameType | None) -> SourceLocation | None:
    """Return the innermost line of student code that a thread is at, or None; `frame` is the thread's newest."""
    while frame is not None and not is_student_file(frame.f_code.co_filename):
        frame = frame.f_back
    return None if frame is None else location_in(frame.f_code, frame.f_lineno or 0)


def location_of(function: object) -> SourceLocation | None:
    """Return where a function or method begins, or None if it is not student code."""
    code = getattr(unwrap(function), "__code__", None) if callable(function) else None
    if not isinstance(code, CodeType) or not is_student_file(code.co_filename):
        return None
    return location_in(code, code.co_firstlineno)


def class_location(kind: type[object]) -> SourceLocation | None:
    """Return where a class begins, or None if it is not student code."""
    try:
        file, (lines, number) = getfile(kind), getsourcelines(kind)
    except (OSError, TypeError):
        return None
    return SourceLocation(short_path(file), number, kind.__name__, lines[0].strip()) if is_student_file(file) else None


def is_student_file(filename: str) -> bool:
    """Return whether a file belongs to neither snr_sim, Python nor an installed package, and is not generated."""
    if filename.startswith("<"):
        return False
    path = Path(filename).resolve()
    if path.is_relative_to(_SHIPPED):
        return True
    return not (path.is_relative_to(_PACKAGE) or path.is_relative_to(_STDLIB) or "site-packages" in path.parts)


def is_content(filename: str) -> bool:
    """Return whether a file belongs to the robots, scenarios and labs that ship with snr_sim."""
    path = Path(filename).resolve()
    return any(path.is_relative_to(folder) for folder in _CONTENT)


def short_path(filename: str) -> str:
    """Return the path relative to the current folder if that is shorter."""
    try:
        relative = str(Path(filename).resolve().relative_to(Path.cwd()))
    except (ValueError, OSError):
        return filename
    return relative


def prepend_location(error: SnrError, about: type[object] | None = None) -> None:
    """Prefix an snr_sim error with the student's line that caused it, else of its class; not of a shipped robot."""
    location = find_student_location(error.__traceback__, is_content_skipped=True)
    if location is None and about is not None:
        location = class_location(about)
        location = None if location is None or is_content(location.file) else location
    if location is not None and not error.message.startswith(str(location)):
        error.message = after_line(location, error.message)


def without_addresses(text: str) -> str:
    """Return a text without memory addresses of objects: they differ in each run, and runs are compared.

    >>> without_addresses("<Mine object at 0x7f10>")
    '<Mine object>'
    """
    return _ADDRESS.sub("", text)


def describe_error(error: BaseException, while_doing: str, otherwise: SourceLocation | None = None) -> str:
    """Return an error message, prefixed with the student's line; a device error comes before the line that opened it.

    Args:
        error: the exception.
        while_doing: what the component was doing, in its own names.
        otherwise: the location to show if no line of student code raised it.
    """
    location = _syntax_error_location(error) or find_student_location(error.__traceback__) or otherwise
    if isinstance(error, SnrError):
        what, fix = error.message, error.fix
    else:
        what, fix = f"{type(error).__name__}: {error_message(error)}", hint(error, _student_trace(error.__traceback__))
    what = without_addresses(what)
    if isinstance(error, SystemExit):
        fix = "a component ends the run with tasks.terminate('why'), so that everything is halted and recorded."
    is_included = location is None or what.startswith(str(location))
    where = [] if is_included else [str(location)]
    parts = [what, while_doing, *where] if isinstance(error, DeviceError) else [*where, what, while_doing]
    lines = [*parts, *([f"Try: {fix}"] if fix else [])]
    return "\n  ".join(lines)


def _syntax_error_location(error: BaseException) -> SourceLocation | None:
    if not isinstance(error, SyntaxError) or not error.filename:
        return None
    return SourceLocation(short_path(error.filename), error.lineno or 0, "", (error.text or "").strip())
