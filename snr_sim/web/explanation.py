"""Why transitions of a machine were taken or not: the run is executed again, by `snr machine why` in another process.

In this process it would keep the node waiting for the interpreter lock.
"""

from __future__ import annotations

import asyncio
import os
import sys
from contextlib import suppress
from pathlib import Path

import msgspec

from snr_sim.prelude.errors import ParameterError
from snr_sim.web.messages import Why, WhyAnswer, WhyRow

TIMEOUT_S = 120.0
_NICE = 10  # so that it takes no time of the robot's
_MAX_ROWS = 500


class _Found(msgspec.Struct):
    """What the command prints."""

    rows: list[WhyRow]
    left_out: int


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
        if self._folder is None:
            raise ParameterError("This run is not recorded, so it cannot be explained.", fix="record it: snr run.")
        interval = ["--from", repr(asked.from_s), "--until", repr(asked.until_s)]
        words = ["machine", "why", str(self._folder), "--json", *interval]
        words += ["--machine", asked.machine] if asked.machine else []
        words += ["--trust"] if self._is_trusted else []
        async with self._one_at_a_time:
            status, out, err = await _run([sys.executable, "-m", "snr_sim", *words])
        error, found = "", _Found([], 0)
        if status == 0:
            found = msgspec.json.decode(out, type=_Found)
        else:
            error = err.decode(errors="replace").strip()[-2000:] or f"It ended with status {status}."
        rows = [row for row in found.rows if asked.transition in ("", row.transition)][:_MAX_ROWS]
        return WhyAnswer(asked.machine, asked.transition, asked.from_s, asked.until_s, rows, found.left_out, error)


async def _run(words: list[str]) -> tuple[int, bytes, bytes]:
    """Return exit status and output of a command."""
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(*words, stdin=asyncio.subprocess.DEVNULL, stdout=pipe, stderr=pipe)
    with suppress(OSError, AttributeError):  # Windows has no such priority
        os.setpriority(os.PRIO_PROCESS, process.pid, _NICE)
    try:
        async with asyncio.timeout(TIMEOUT_S):
            out, err = await process.communicate()
    except TimeoutError:
        return -1, b"", f"It took longer than {TIMEOUT_S:g} s: ask for a shorter interval.".encode()
    finally:
        with suppress(ProcessLookupError):
            process.kill()
    return process.returncode or 0, out, err
