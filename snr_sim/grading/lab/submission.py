"""A submission: the student's files, and the processes that read and run them, each begun when it is needed."""

from __future__ import annotations

import select
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from snr_sim.grading.lab.verdicts import GraderError, SubmissionError
from snr_sim.grading.remote.fork_server import ForkServer
from snr_sim.grading.remote.parsers import MAX_PARSED_BYTES, check_imports
from snr_sim.grading.remote.student_process import StudentProcess
from snr_sim.grading.reports.results import Isolation
from snr_sim.grading.sandbox.sandbox import Limits

MAX_SOURCE_BYTES = 1 << 20


class Submission:
    """A student's files, for one case.

    Args:
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
        self.folder: Path = folder.resolve()
        self.isolation: Isolation = isolation
        self.record_to: Path | None = record_to
        self.run_folder: Path | None = None  # of the last run, if it was recorded
        self.run_count: int = 0
        self.last_file: str = ""  # the submitted file that was used last, by a call, inputs or a run
        self._limits = limits or Limits()
        self._may_import = may_import
        self._refused = refused or {}
        self._fork_server = fork_server
        self._printed: list[str] = []

    def source(self, file: str, max_bytes: int = MAX_SOURCE_BYTES) -> str:
        """Return the text of a submitted file; raise SubmissionError if it is missing, too long, or not text.

        A text that the check parses is short: `max_bytes` is `MAX_PARSED_BYTES` then; or see `parse`.
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

        The parser is of snr_sim or the lab (see `create_object`); it gets the bytes, and returns values as for `call`.

        Raises:
            SubmissionError: the file is missing, too long, or not valid for the parser.
        """
        data = self.source(file, max_bytes).encode()
        child = self._begin()
        try:
            return child.parse(parser, data)
        except SubmissionError as wrong:
            raise SubmissionError(f"{file}: {wrong.message}", f"{file} cannot be read: keep its form.") from wrong
        finally:
            self.close_child(child)

    def new_child(self, file: str, readable: Sequence[Path] = ()) -> StudentProcess:
        """Return a process of its own, which has not read the submission yet; `close_child` ends it.

        SubmissionError is raised if the file is missing, or imports a refused module.
        """
        self.source(file)
        child = self._begin(readable)
        try:
            check_imports(self.folder, file, self._may_import, self._refused, child)
        except BaseException:
            self.close_child(child)
            raise
        return child

    def close_child(self, child: StudentProcess) -> None:
        """End a process, and keep its output."""
        try:
            child.close()
        finally:
            if child.printed:
                self._printed.append(child.printed)

    def _begin(self, readable: Sequence[Path] = ()) -> StudentProcess:
        if not hasattr(select, "poll"):
            from snr_sim.grading.remote.piped_process import PipedProcess  # on Windows

            assert self.isolation == "none"
            return PipedProcess(self.folder, self._limits)
        return StudentProcess(self.folder, self.isolation, self._limits, readable, self._fork_server)

    def _path(self, file: str) -> Path:
        if Path(file).is_absolute() or ".." in Path(file).parts:
            raise GraderError(f"A check asks for {file!r}, which is outside of the submission.")
        path = (self.folder / file).resolve()
        if not path.is_relative_to(self.folder):
            raise SubmissionError(f"{file} is a link to elsewhere.", f"Hand in {file} itself, not a link.")
        return path
