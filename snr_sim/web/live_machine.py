"""A machine of a running node, for pages: its state now, and what pages ask of it.

It is read from the server's thread while the node's thread runs it. That needs no lock: pages are copies that do not
change, the endpoint appends its changes to a deque from which only this takes, and everything that is asked enters the
node's inbox as a task, so it is recorded and replayed.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec

from snr_sim.behaviors import program as lrp
from snr_sim.behaviors.context import plain_value
from snr_sim.behaviors.endpoint import EditAnswer, MachineEndpoint
from snr_sim.behaviors.interpreter import NS_PER_S
from snr_sim.behaviors.language import parse
from snr_sim.behaviors.program import ProgramError
from snr_sim.core.datastore import page_age_s
from snr_sim.core.node import Node
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest
from snr_sim.web.explanation import Explanations
from snr_sim.web.messages import By, Edit, Edited, Hello, HungUpError, Problem, Program, Rights, State, Try
from snr_sim.web.moments import MAX_MOMENTS, Moments, moment_of
from snr_sim.web.readings import commands_of, parts_of, readings_of, shown
from snr_sim.web.timeline import MAX_PROGRAMS, PAGE_SOURCE, RecordedTimeline, program_of

MAX_UNANSWERED = 64  # edits
MAX_PROBLEMS = 100
_EVENTS = {"pause": "pause", "go": "go", "step": "step_once"}


@dataclass
class _Edit:
    """An edit that the node has not answered; `text` is that of the whole program."""

    text: str
    number: int | None  # None: an undo
    answer: Callable[[Edited], None]


class LiveMachine:
    """A machine of a node. What changes it raises SnrError if it is not possible.

    Args:
        node: that runs it.
        name: of its component.
        title: of the page.
        folder: of the run, if it is recorded.
    """

    def __init__(self, node: Node, name: str, title: str, folder: Path | None = None) -> None:
        self.name: str = name
        self.title: str = title
        self.moments: Moments = Moments()
        self._node = node
        self._folder = folder
        self.explanations: Explanations = Explanations(folder, is_trusted=True)
        self._timeline: RecordedTimeline | None = None
        self._unanswered: deque[_Edit] = deque()
        self._undo: deque[Program] = deque(maxlen=MAX_PROGRAMS)
        self.generation: int = 0  # counts how often its component was replaced: programs are then numbered from 1 again
        self._seen = self._endpoint
        self._begin()
        self.update(0.0)

    @property
    def _endpoint(self) -> MachineEndpoint:
        found = self._node.components.get(self.name)
        if not isinstance(found, MachineEndpoint):
            raise UnknownNameError(f"The machine '{self.name}' has been removed.", fix="end this page.")
        if found.recent is None:
            found.recent = deque(maxlen=MAX_MOMENTS)
        return found

    def _begin(self) -> None:
        """Take the program of an endpoint that is new: at first, and after a reload of the component."""
        endpoint, self._undo = self._seen, deque(maxlen=MAX_PROGRAMS)
        program, self._number = endpoint.interpreter.program, endpoint.program_number
        self._programs = {self._number: self._shown_program(self._number, program, "start", 0.0)}
        self._is_text = self._can_parse(program.text, program.files)

    def _shown_program(self, number: int, program: Any, by: By, t_s: float) -> Program:
        made = program_of(number, program.text, program.sha256, program.files, by, t_s)
        return msgspec.structs.replace(made, signals=program.signals())

    # -- what has happened --------------------------------------------------------------------------------------------

    def update(self, now_s: float) -> None:
        """Take what the endpoint has done since the last call."""
        endpoint = self._endpoint
        if endpoint is not self._seen:
            self._seen, self.generation = endpoint, self.generation + 1
            self._begin()
        recent = endpoint.recent
        while recent:
            number, one = recent.popleft()
            if isinstance(one, EditAnswer):
                self._take_answer(number, one)
            else:
                self.moments.add(moment_of(msgspec.structs.asdict(one), number))

    def _take_answer(self, number: int, answered: EditAnswer) -> None:
        edit = next((one for one in self._unanswered if one.text == answered.text), None)
        before = self._programs[self._number]
        if answered.answer["ok"]:
            by: By = "elsewhere" if edit is None else "page"
            self._programs[number] = self._shown_program(number, answered.program, by, answered.t_s)
            self._number = number
            if edit is not None and edit.number is None and self._undo:
                self._undo.pop()
            else:
                self._undo.append(before)
            while len(self._programs) > MAX_PROGRAMS:
                del self._programs[min(self._programs)]
        if edit is not None:
            self._unanswered.remove(edit)
            edit.answer(self._edited(edit, answered.answer, answered.program.files))

    def _edited(self, edit: _Edit, answer: Mapping[str, Any], files: Mapping[str, str]) -> Edited:
        is_stale = "text" in answer
        text = answer["text"] if is_stale else edit.text if edit.number is None else None
        problems = [Problem(**{"is_error": not answer["ok"], **one}) for one in answer["problems"]]
        lists = {key: list(answer[key]) for key in ("notes", "kept", "restarted", "stopped")}
        return Edited(
            number=edit.number,
            ok=answer["ok"],
            is_stale=is_stale,
            program=answer["program"],
            sha256=answer["sha256"],
            text=text,
            files=None if text is None else dict(files),
            problems=problems,
            **lists,
        )

    # -- what pages show ----------------------------------------------------------------------------------------------

    def hello(self, rights: Rights) -> Hello:
        """Return the first message of a connection."""
        self.update(0.0)
        program, now_s = self._programs[self._number], self._node.get_time_s()
        factory = self._endpoint.factory
        is_editable = rights == "change" and self._is_text
        return Hello(
            self.name, self.title, True, rights, is_editable, program.number, program.sha256, program.text,
            program.files, program.graph, parts_of(factory.bridge), program.signals, now_s, now_s,
        )  # fmt: skip

    def program(self, number: int) -> Program | None:
        """Return a program by its number."""
        found = self._programs.get(number)
        return self._timeline.program(number) if found is None and self._timeline is not None else found

    def newest(self) -> State:
        """Return the state now."""
        node, endpoint = self._node, self._endpoint
        get_page = node.datastore.pages.get  # `get` would count keys that are not there as missed
        page = get_page(self.name)
        fields: Mapping[str, Any] = page.data if page is not None and isinstance(page.data, Mapping) else {}
        if fields.get("program", self._number) not in self._programs:
            self.update(0.0)  # it was edited between the two
        bridge = endpoint.factory.bridge
        problems = list(endpoint.interpreter.problems.copy().values())[:MAX_PROBLEMS]
        return State(
            is_live=True,
            t_s=node.get_time_s(),
            number=fields.get("program", self._number),
            active=fields.get("active", {}),
            entered_s=fields.get("entered_s", {}),
            last=self.moments.newest,
            variables={path: shown(value) for path, value in endpoint.interpreter.variables.items()},
            reads=readings_of(bridge, endpoint.factory.reacts_to, get_page, lambda one: page_age_s(node, one)),
            drives=commands_of(bridge, get_page),
            problems=[_problem(one) for one in problems],
            is_paused=bool(fields.get("is_paused", False)),
            changes=[],
            missed=0,
        )

    async def state_at(self, t_s: float) -> State:
        """Return the state at a moment of the run, from its recording."""
        if self._folder is None:
            raise ParameterError("This run is not recorded, so only the present is known.", fix="record it: snr run.")
        if self._timeline is None:
            factory = self._endpoint.factory
            self._timeline = RecordedTimeline(self._folder, self.name, factory.bridge)
        while self._timeline.read_some():
            await asyncio.sleep(0)  # other pages, and the node, which waits for the interpreter lock
        return self._timeline.state_at(t_s)

    def close(self) -> None:
        """Close the recording."""
        if self._timeline is not None:
            self._timeline.close()

    # -- what pages change --------------------------------------------------------------------------------------------

    def edit(self, asked: Edit, answer: Callable[[Edited], None]) -> None:
        """Continue with another text. One with mistakes is answered here, and does not enter the node."""
        if not self._is_text:
            raise ParameterError(
                "This machine is made in Python.", fix="edit its file: snr run ... --watch reloads it."
            )
        text, files = self.with_text(asked)
        found = self._mistakes(asked, text, files)
        if asked.is_tried or any(one.is_error for one in found):
            current = self._programs[self._number]
            problems = [_mistake(one) for one in found]
            number, sha256 = current.number, current.sha256
            answer(Edited(asked.number, False, False, number, sha256, None, None, problems, [], [], [], []))
            return
        self._send_edit(_Edit(text, asked.number, answer), asked.base_sha256, files if asked.file else None)

    def with_text(self, asked: Edit | Try) -> tuple[str, dict[str, str]]:
        """Return the program with another text, and the files that it imports.

        Raises:
            UnknownNameError: it imports no such file.
        """
        now = self._endpoint.interpreter.program
        if not asked.file:
            return asked.text, dict(now.files)
        if asked.file not in now.files:
            raise UnknownNameError(f"The program imports no file '{asked.file}'.", fix=suggest(asked.file, now.files))
        return now.text, {**now.files, asked.file: asked.text}

    def _mistakes(self, asked: Edit, text: str, files: Mapping[str, str]) -> list[lrp.Problem]:
        """Return what is wrong with an edit, at its places in the text that was edited."""
        is_whole = False
        try:
            if asked.file:
                self._parse(asked.text, files)
            is_whole = True
            warnings = self._parse(text, files).warnings  # the node finds it finished
        except ProgramError as error:
            if asked.file and is_whole:  # the places are in the program that imports it
                return [replace(one, place=lrp.Place()) for one in error.problems]
            return error.problems
        return list(warnings) if asked.is_tried and not asked.file else []

    def _send_edit(self, edit: _Edit, base_sha256: str, files: Mapping[str, str] | None) -> None:
        if len(self._unanswered) >= MAX_UNANSWERED:
            raise HungUpError(f"{MAX_UNANSWERED} edits wait for the robot's program.")
        self._unanswered.append(edit)
        self._schedule("edit", edit.text, base_sha256, *([] if files is None else [dict(files)]))

    def _parse(self, text: str, files: Mapping[str, str]) -> lrp.Program:
        """Compile a program, as the endpoint will. Raise ProgramError if it has mistakes."""
        factory = self._endpoint.factory
        return parse(text, {} if factory.bridge is None else factory.bridge.parts, files, factory.program.actions)

    def _can_parse(self, text: str, files: Mapping[str, str]) -> bool:
        try:
            self._parse(text, files)
        except ProgramError:
            return False  # a listing of a machine in Python
        return True

    def undo(self, answer: Callable[[Edited], None]) -> None:
        """Continue with the text before the newest edit."""
        self.update(0.0)
        if not self._undo:
            raise ParameterError("There is no edit to undo.", fix="edit the text.")
        before, now = self._undo[-1], self._programs[self._number]
        self._parse(before.text, before.files)
        files = before.files if before.files != now.files else None
        self._send_edit(_Edit(before.text, None, answer), now.sha256, files)

    def set_value(self, path: str, value: Any) -> None:
        """Set a variable."""
        variables = self._endpoint.interpreter.variables
        if path not in variables:
            raise UnknownNameError(f"There is no variable '{path}'.", fix=suggest(path, variables))
        self._schedule("set", path, plain_value(path, value))

    def give(self, signal: str) -> None:
        """Give a signal."""
        known = self._endpoint.interpreter.program.signals()
        if signal not in known:
            raise UnknownNameError(f"No transition waits for a signal '{signal}'.", fix=suggest(signal, known))
        self._node.enqueue_input(tasks.event(signal), PAGE_SOURCE)

    def press(self, what: str) -> None:
        """Pause, go, or step."""
        page = self._node.datastore.pages.get(self.name)
        if what == "step" and not (page is not None and page.data["is_paused"]):
            raise ParameterError("A single step is possible while the machine is paused.", fix="pause it first.")
        self._schedule(_EVENTS[what])

    def _schedule(self, event: str, *values: Any) -> None:
        self._node.enqueue_input(tasks.event(f"{self.name}.{event}", list(values)), PAGE_SOURCE)


def _problem(one: Any) -> Problem:
    """Return a block that failed, as the editor marks it."""
    message = f"At {one.t_ns / NS_PER_S:g} s, {one.count} times in all: [{one.block:.200}]: {one.message:.1000}"
    return Problem(one.line, 0, one.line, 0, message, "", True)


def _mistake(one: Any) -> Problem:
    at = one.place
    return Problem(at.line, at.column, at.end_line, at.end_column, one.message, one.fix, one.is_error)
