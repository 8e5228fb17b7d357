"""What an edit of a running machine brings, by an event or by a file that was saved: a program, or its mistakes."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from snr_sim.behaviors.bridge import Bridge
from snr_sim.behaviors.imports import files_named, texts_of
from snr_sim.behaviors.language import parse
from snr_sim.behaviors.program import Place, Problem, Program, ProgramError
from snr_sim.prelude import tasks
from snr_sim.prelude.task import Task


class StaleEditError(ProgramError):
    """An edit of a text that another one has replaced."""


class LiveEdits:
    """The edits of one machine.

    Args:
        name: of its component.
        program: with which it began.
        bridge: the parts of the robot that a text may name.
        path: its file, if it has one.
    """

    def __init__(self, name: str, program: Program, bridge: Bridge | None, path: Path | None) -> None:
        self._name, self._actions, self.path = name, program.actions, path
        self._parts = {} if bridge is None else bridge.parts
        self._files = dict(program.files)  # all that were given, also those not imported now
        self._named = set[str]()  # that the texts import which were saved last, whether they exist or not

    def program_of(self, task: Task, now: Program) -> Program:
        """Return the program that an event "<name>.edit" brings.

        Raises:
            ProgramError: the text has mistakes, or the event has no text.
            StaleEditError: it is an edit of another program than the present one.
        """
        text, base, files = (*task.val_list, *("", "", None)[len(task.val_list) :])[:3]
        files = self._files if files is None else files
        if not isinstance(text, str) or not isinstance(base, str) or not _are_texts(files):
            raise ProgramError([Problem(Place(), "The edit is not text.", f"{task.name} [text, sha256].")])
        if base not in ("", now.sha256):
            raise StaleEditError([Problem(Place(), "Another edit came first.", "edit the present text.")])
        program = self._parse(text, files)
        self._files |= files
        return program

    def program_with_file(self, task: Task, now: Program) -> Program:
        """Return the program with another text of a file that it imports, which an event "<name>.edit_file" brings.

        Raises:
            ProgramError: the text has mistakes, or there is no such file.
        """
        text, file = (*task.val_list, "", "")[:2]
        if not isinstance(text, str) or not isinstance(file, str) or file not in now.files:
            message = f"The program imports no file {file!r:.80}."
            raise ProgramError([Problem(Place(), message, f"{task.name} [text, file].")])
        program = self._parse(now.text, {**now.files, file: text})
        self._files[file] = text
        return program

    def watched_files(self, now: Program) -> list[Path]:
        """Return the program's file, and those that it imports."""
        return (
            [] if self.path is None else [self.path.parent / one for one in (self.path.name, *now.files, *self._named)]
        )

    def saved(self) -> Task:
        """Return the edit by the files as they are. The watch parses it, and the node finds what was parsed."""
        assert self.path is not None
        folder, text = self.path.parent, self.path.read_text("utf-8", "replace")

        def read_text(name: str) -> str | None:
            one = folder / name
            return one.read_text("utf-8", "replace") if one.is_file() else None

        files = texts_of(text, read_text)
        self._named = {name for one in (text, *files.values()) for name in files_named(one)[0]}
        with suppress(ProgramError):
            self._parse(text, files)
        return tasks.event(f"{self._name}.edit", [text, "", files])

    def _parse(self, text: str, files: Mapping[str, str]) -> Program:
        return parse(text, self._parts, files, self._actions)


def _are_texts(files: object) -> bool:
    return isinstance(files, Mapping) and all(isinstance(text, str) for row in files.items() for text in row)
