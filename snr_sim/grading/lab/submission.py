"""What `run_inputs` and `run_scenario` need of a submission. `Student`, which offers both to checks, implements it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from snr_sim.grading.remote.child_process import ChildProcess


class Submission(Protocol):
    """A student's files, and processes that read them.

    Attributes:
        folder: of the files.
        record_to: where runs are recorded, if they are.
        run_folder: of the last run, if it was recorded.
        run_count: how many runs there were.
    """

    folder: Path
    record_to: Path | None
    run_folder: Path | None
    run_count: int

    @property
    def isolation(self) -> str:
        """How its processes are kept apart."""
        ...

    def new_child(self, file: str, readable: Sequence[Path] = ()) -> ChildProcess:
        """Return a process of its own, which has not read the submission yet; `close_child` ends it.

        Raises:
            SubmissionError: the file is missing, or imports what it may not.
        """
        ...

    def close_child(self, child: ChildProcess) -> None:
        """End a process, and keep what it printed."""
        ...
