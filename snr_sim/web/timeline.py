"""The machine of a recorded run over time: programs, changes of state, and its state at any moment.

Nothing is executed: the trace has the text of each program, each change of state, and a page after each of them. It may
be read while it grows.
"""

from __future__ import annotations

import hashlib
import re
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from snr_sim.behaviors.bridge import Bridge
from snr_sim.prelude.errors import SnrError, TraceError, UnknownNameError, suggest
from snr_sim.prelude.task import DataKey, Page
from snr_sim.prelude.values import JSON_ERRORS, decode_value
from snr_sim.recording.reader import beginning_of
from snr_sim.recording.records import Header, InputRecord, Line, LogLineRecord, decode_line
from snr_sim.recording.trace import FILE_NAME
from snr_sim.web.graphs import graphs_of, signals_in
from snr_sim.web.messages import By, Program, State
from snr_sim.web.moments import Moments, moment_of
from snr_sim.web.readings import commands_of, pages_of, readings_of, shown
from snr_sim.web.trace_index import TraceIndex, in_input, in_returned, tasks_in

PAGE_SOURCE = "live"  # name of the loop that brings what pages ask for, and source of its tasks
_LEVEL = b'"level":"PROGRAM",'
_INPUT_PAGE = re.compile(rb'^{"kind":"input",[^{]*"type":"store_page","name":("(?:[^"\\\\]|\\\\.)*"),')
MAX_PROGRAMS = 200  # those before are in the recording
_MAX_INPUTS = 20
_SEARCHED_FOR_NAMES = 1 << 22  # bytes at the begin of a trace: machines record their programs before the first task


class _Edited(NamedTuple):
    """What `program_of` makes a program of, but for its number: without the graphs, it is small."""

    text: str
    sha256: str
    files: dict[str, str]
    by: By
    t_s: float


class RecordedTimeline:
    """A machine of a recorded run.

    Of a robot that is edited all day, only the newest programs are kept; an older one is read again when it is shown.

    Args:
        folder: of the run.
        name: of the machine; empty if there is one only.
        bridge: parts of the robot, whose pages are shown, too; without one, those that come from outside the node.

    Raises:
        TraceError: the trace cannot be read.
        UnknownNameError: there is no such machine in it.
    """

    def __init__(self, folder: Path, name: str, bridge: Bridge | None = None) -> None:
        path = folder / FILE_NAME if folder.is_dir() else folder
        names = machines_in(path)
        if not names:
            raise UnknownNameError(
                f"The run {folder} has no state machine.", fix="name a run whose controller has one: snr list runs."
            )
        if not name and len(names) > 1:
            raise UnknownNameError(f"The run {folder} has several machines.", fix=f"--name, {suggest('', names)}")
        if name and name not in names:
            raise UnknownNameError(f"The run {folder} has no machine '{name}'.", fix=suggest(name, names))
        self.name: str = name or names[0]
        self.moments: Moments = Moments(max_kept=None)
        self._edited: dict[int, _Edited] = {}  # by number; in the order in which they came
        self._shown: dict[int, _Edited] = {}  # the one that was read again last
        self._kept = 0  # number of a program that is kept for good, if it is not 0
        self._greatest = 1  # number of any program so far
        self._bridge = bridge
        self._others = inputs_in(path) if bridge is None else []
        self._number = 1
        self._text: list[str] = []
        self._files: dict[str, list[str]] = {}
        self._edits: deque[tuple[list[Any], str, bool]] = deque()  # not answered yet: values, source, whether of a file
        mine = self.name
        self._searched = [
            _LEVEL,
            in_returned("event", f"{mine}.transition"),
            in_input("event", f"{mine}.edit"),
            in_returned("event", f"{mine}.edit"),
            in_input("event", f"{mine}.edit_file"),
            in_returned("event", f"{mine}.edit_file"),
            in_returned("store_page", f"{mine}.edited"),
        ]
        self._index = TraceIndex(path, list(dict.fromkeys([mine, *pages_of(bridge), *self._others])), self._searched)

    @property
    def until_s(self) -> float:
        """Time of the newest line that has been read."""
        return self._index.until_s

    def close(self) -> None:
        """Close the trace."""
        self._index.close()

    def read_some(self) -> bool:
        """Read one more piece of the trace; return whether there was one.

        Raises:
            TraceError: it is damaged.
        """
        before = self._index.searched_bytes
        for i, line in self._index.advance():
            try:
                self._take(i, line)
            except (*JSON_ERRORS, SnrError, LookupError, TypeError, ValueError) as error:
                raise TraceError(
                    f"In the trace {self._index.path} a record of '{self.name}' is not one of a machine: {error}",
                    fix="was it changed after the run? Run it again.",
                ) from error
        return self._index.searched_bytes > before

    def read_all(self) -> None:
        """Read what has been written so far. Raises as `read_some`."""
        while self.read_some():
            pass

    def _take(self, i: int, line: Line) -> None:
        if i == 0:
            self._take_text(line)
        elif i == 1:
            for task in tasks_in(line, "event", f"{self.name}.transition"):
                self.moments.add(moment_of(_values(task)[0], self._number))
        elif i == 6:
            for task in tasks_in(line, "store_page", f"{self.name}.edited"):
                self._take_answer(decode_value(bytes(task.values), {"page": Page})[0])
        else:
            name = f"{self.name}.{'edit' if i < 4 else 'edit_file'}"
            source = line.source if isinstance(line, InputRecord) else ""
            self._edits.extend((_values(task), source, i >= 4) for task in tasks_in(line, "event", name))

    def _take_text(self, line: Line) -> None:
        """Take a line of the first program, or of a file that it imports."""
        if not isinstance(line, LogLineRecord):
            return
        if line.component == self.name:
            self._text.append(line.text)
        elif line.component.startswith(f"{self.name} "):
            self._files.setdefault(line.component.removeprefix(f"{self.name} "), []).append(line.text)

    def _take_answer(self, page: Page) -> None:
        """Take the answer to the oldest edit that has none."""
        values, source, is_of_file = self._edits.popleft()
        if not page.data["ok"]:
            return
        before = self._edited.get(self._number) or self._first()
        text, files = before.text, dict(before.files)
        if is_of_file:
            files[values[1]] = values[0]
        else:
            text, files = values[0], (dict(values[2]) if len(values) > 2 and values[2] is not None else files)
        self._number = page.data["program"]
        by: By = "page" if source == PAGE_SOURCE else "elsewhere"
        self._edited.pop(self._number, None)  # of a component that was replaced: programs are numbered from 1 again
        self._edited[self._number] = _Edited(text, page.data["sha256"], files, by, page.created_at_s)
        self._greatest = max(self._greatest, self._number)
        if len(self._edited) > MAX_PROGRAMS:
            del self._edited[next(one for one in self._edited if one != self._kept)]

    def _first(self) -> _Edited:
        text = "\n".join([*self._text, ""])
        files = {name: "\n".join([*lines, ""]) for name, lines in self._files.items()}
        return _Edited(text, hashlib.sha256(text.encode()).hexdigest(), files, "start", 0.0)

    def program(self, number: int) -> Program:
        """Return a program by its number; the first one if there is none of that number.

        Raises:
            TraceError: the trace is damaged, or has been removed.
        """
        if number not in self._edited and number not in self._shown and 1 < number <= self._greatest:
            again = RecordedTimeline(self._index.path, self.name, self._bridge)
            again._kept = number
            try:
                again.read_all()
            finally:
                again.close()
            self._shown = {number: again._edited.get(number, again._first())}
        found = self._edited.get(number) or self._shown.get(number)
        return program_of(1, *self._first()) if found is None else program_of(number, *found)

    @property
    def newest_program(self) -> Program:
        """The program at the end of what has been read."""
        return self.program(self._number)

    def state_at(self, t_s: float) -> State:
        """Return the state at a moment.

        Raises:
            TraceError: the trace is damaged.
        """
        page = self._page_at(self.name, t_s)
        fields: Mapping[str, Any] = page.data if page is not None and isinstance(page.data, Mapping) else {}

        def get_page(key: DataKey) -> Page | None:
            return self._page_at(key, t_s)

        number = fields.get("program", 1)
        return State(
            is_live=False,
            t_s=t_s,
            number=number,
            active=dict(fields.get("active", {})),
            entered_s=dict(fields.get("entered_s", {})),
            last=self.moments.at(t_s),
            variables={path: shown(value) for path, value in fields.get("variables", {}).items()},
            reads=readings_of(self._bridge, self._others, get_page, lambda one: max(0.0, t_s - one.created_at_s)),
            drives=commands_of(self._bridge, get_page),
            problems=[],
            is_paused=bool(fields.get("is_paused", False)),
            changes=[],
            missed=0,
        )

    def _page_at(self, key: DataKey, t_s: float) -> Page | None:
        return self._index.page_at(key, t_s)


def _values(task: Any) -> list[Any]:
    values = decode_value(bytes(task.values), {"page": Page})
    assert isinstance(values, list)
    return values


def program_of(number: int, text: str, sha256: str, files: Mapping[str, str], by: By, t_s: float) -> Program:
    """Return a program as pages get it; see `Program`."""
    return Program(number, sha256, text, dict(files), graphs_of(text, files), signals_in(text, files), by, t_s)


def header_of(path: Path) -> Header:
    """Return the header of a trace.

    Raises:
        TraceError: it cannot be read.
    """
    return beginning_of(path, [line for line, _ in zip(_whole_lines(path), range(2), strict=False)])[1]


def machines_in(path: Path) -> list[str]:
    """Return the names of the machines of a trace.

    Raises:
        TraceError: it cannot be read.
    """
    header_of(path)
    names: list[str] = []
    size = 0
    for line in _whole_lines(path):
        size += len(line)
        if size > _SEARCHED_FOR_NAMES:
            break
        if _LEVEL not in line:
            continue
        try:
            read = decode_line(line)
        except JSON_ERRORS:
            break
        if isinstance(read, LogLineRecord) and not any(read.component.startswith(f"{name} ") for name in names):
            names.append(read.component)
    return list(dict.fromkeys(names))


def inputs_in(path: Path) -> list[DataKey]:
    """Return the keys of the first pages that a node stored because something outside brought them, as sensors do.

    Raises:
        TraceError: the trace cannot be read.
    """
    found, size = dict[DataKey, None](), 0
    for line in _whole_lines(path):
        size += len(line)
        match = _INPUT_PAGE.search(line)
        if match is not None:
            with suppress(*JSON_ERRORS):  # a damaged line, which is an error where it is read as a record
                found[msgspec.json.decode(match[1], type=str)] = None
        if size > _SEARCHED_FOR_NAMES or len(found) >= _MAX_INPUTS:
            break
    return list(found)


def _whole_lines(path: Path) -> Iterator[bytes]:
    try:
        with open(path, "rb") as file:
            for line in file:
                if not line.endswith(b"\n"):
                    return
                yield line[:-1]
    except OSError as error:
        raise TraceError(f"The trace {path} cannot be read: {error.strerror}.", fix="name a run folder.") from error
