"""What a page finds out by executing a run again: why transitions were taken or not, and what another program would do.

`snr machine why` and `snr machine try` do it in another process, as in this one the node would wait for the interpreter
lock. It has the priority of this one, because a user waits for it.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import msgspec

from snr_sim.prelude.errors import ParameterError
from snr_sim.web.messages import Course, Tried, Why, WhyAnswer, WhyRow
from snr_sim.web.moments import moment_of

TIMEOUT_S = 120.0
_MAX_ROWS = 500
_PROGRAM = "_.lrp"  # in the folder of the files that it imports
FoundT = TypeVar("FoundT")


class _Found(msgspec.Struct):
    """What `snr machine why` prints."""

    rows: list[WhyRow]
    left_out: int


class _Course(msgspec.Struct):
    """What machines did."""

    changes: list[dict[str, Any]]
    end: str

    def shown(self) -> Course:
        """Return it for pages."""
        return Course([moment_of(one, 0) for one in self.changes], self.end)


class _Rehearsed(msgspec.Struct):
    """What `snr machine try --at` prints."""

    at_s: float
    until_s: float
    unchanged: _Course
    edited: _Course


class Explanations:
    """Executes a recorded run again, once at a time.

    Args:
        folder: of the run; None: it is not recorded.
        is_trusted: whether files of another user may be executed.
    """

    def __init__(self, folder: Path | None, is_trusted: bool) -> None:
        self._folder = folder
        self._is_trusted = is_trusted
        self._one_at_a_time = asyncio.Lock()

    async def of(self, asked: Why) -> WhyAnswer:
        """Return why transitions were taken or not, as far as the run has been recorded.

        Raises:
            ParameterError: it is not recorded.
        """
        interval = ["--from", repr(asked.from_s), "--until", repr(asked.until_s)]
        words = [*interval, *(["--machine", asked.machine] if asked.machine else [])]
        found, error = await self._ask(_Found([], 0), "why", str(self._run), *words)
        rows = [row for row in found.rows if asked.transition in ("", row.transition)][:_MAX_ROWS]
        return WhyAnswer(asked.machine, asked.transition, asked.from_s, asked.until_s, rows, found.left_out, error)

    async def rehearsal(self, machine: str, text: str, files: Mapping[str, str], at_s: float) -> Tried:
        """Return what a machine would do from a moment on, with its program and with another one.

        Raises:
            ParameterError: the run is not recorded.
        """
        nothing = _Rehearsed(at_s, at_s, _Course([], ""), _Course([], ""))
        run = str(self._run)
        with TemporaryDirectory(prefix="snr-try-") as folder:
            for name, content in {**files, _PROGRAM: text}.items():
                path = Path(folder, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(content, encoding="utf-8")
            words = ["--name", machine, "--at", repr(at_s)]
            found, error = await self._ask(nothing, "try", str(Path(folder, _PROGRAM)), run, *words)
        return Tried(found.at_s, found.until_s, found.unchanged.shown(), found.edited.shown(), error)

    @property
    def _run(self) -> Path:
        if self._folder is None:
            raise ParameterError("This run is not recorded, so it cannot be repeated.", fix="record it: snr run.")
        return self._folder

    async def _ask(self, nothing: FoundT, *words: str) -> tuple[FoundT, str]:
        """Return what a verb of `snr machine` prints as JSON, or `nothing` and its error."""
        command = [sys.executable, "-m", "snr_sim", "machine", *words, "--json"]
        async with self._one_at_a_time:
            status, out, err = await _output_of([*command, *(["--trust"] if self._is_trusted else [])])
        if status == 0:
            return msgspec.json.decode(out, type=type(nothing)), ""
        return nothing, err.decode(errors="replace").strip()[-2000:] or f"It ended with status {status}."


async def _output_of(words: list[str]) -> tuple[int, bytes, bytes]:
    """Return exit status and output of a command."""
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(*words, stdin=asyncio.subprocess.DEVNULL, stdout=pipe, stderr=pipe)
    try:
        async with asyncio.timeout(TIMEOUT_S):
            out, err = await process.communicate()
    except TimeoutError:
        return -1, b"", f"It took longer than {TIMEOUT_S:g} s: ask for a shorter interval.".encode()
    finally:
        with suppress(ProcessLookupError):
            process.kill()
    return process.returncode or 0, out, err
