"""Grading: how much of the speed of bare simulations is left by sandbox, pipe, reports and bookkeeping; and its memory.

Submissions are copies of a lab's reference. Bare are the same checks on the same cases in two processes that have the
student's functions in themselves: no sandbox, no pipe, no process per case, nothing written. Wall time, two cores.

Run by `snr bench grading`, or by itself. The whole measure wants a quiet machine:
python tests/bench/bench_grading.py --count 200 [--lab NAME_OR_PATH --reference FOLDER] [--quick] [--json]
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import mean
from types import ModuleType
from typing import Any

import msgspec
from harness import Row, report

from snr_sim import library
from snr_sim.grading import grade
from snr_sim.grading.lab import find_lab
from snr_sim.grading.student import Student

PROJECT = Path(__file__).resolve().parents[2]
LAB, REFERENCE = "lunar_lander_q", PROJECT / "tests" / "assignments" / "lunar_lander_q" / "reference"
JOBS, COUNT, QUICK_COUNT = 2, 40, 4
SECRET = b"of the benchmark, which everybody may know"
WANTED_SHARE = 0.9
MOST_GROWTH = 1.1


class BareHost:
    """What `Student.host` returns, without anything between."""

    def __init__(self, made: Any) -> None:
        self._made = made

    def ask(self, method: str, *args: Any, returns: Any = Any, **_: Any) -> Any:
        """Calls a method; a dict becomes the class that the lab asked for."""
        value = getattr(self._made, method)(*args)
        return msgspec.convert(value, returns) if isinstance(value, dict) and returns is not Any else value


class Bare(Student):
    """A student whose functions are called in this process."""

    def _module(self, file: str) -> ModuleType:
        module: ModuleType | None = self.__dict__.get(file)
        if module is None:
            module = self.__dict__[file] = library.load_program(str(self.folder / file))
        return module

    def call(self, file: str, function: str, *args: Any, **_: Any) -> Any:
        """Calls it."""
        return getattr(self._module(file), function)(*args)

    def host(self, file: str, host: str, *args: Any, **_: Any) -> Any:
        """Makes it."""
        place, _, name = host.partition(":")
        return BareHost(getattr(__import__(place, fromlist=[name]), name)(self._module(file), *args))


def grade_bare(lab: str, folders: list[str]) -> None:
    """Grades submissions one after the other in this process, and keeps nothing."""
    grade.Student = Bare  # type: ignore[misc]
    found = find_lab(lab)
    for folder in folders:
        graded = grade.grade_submission(found, Path(folder), SECRET, "none")
        assert graded.points == 100.0, graded


def copies(reference: Path, count: int, into: Path) -> list[Path]:
    """Returns so many submissions, no two of which are the same to the byte."""
    made = []
    for i in range(count):
        folder = into / f"student_{i:03}"
        shutil.copytree(reference, folder, ignore=shutil.ignore_patterns("__pycache__"))
        for file in folder.glob("*.py"):
            file.write_text(file.read_text() + f"\n# student {i}\n")
        made.append(folder)
    return made


def bare_s(lab: str, given: list[Path]) -> float:
    """Returns what the bare simulations take on all cores [s]."""
    start_s = time.perf_counter()
    command = [sys.executable, str(Path(__file__)), "--bare", lab]
    running = [subprocess.Popen([*command, *map(str, given[i::JOBS])]) for i in range(JOBS)]
    assert [process.wait() for process in running] == [0] * JOBS
    return time.perf_counter() - start_s


def graded_s(lab: str, given: list[Path], place: Path) -> tuple[float, float, float]:
    """Returns what `snr grade` takes [s], and the memory of the grader with its workers early and late [MB]."""
    (place / "secret").write_bytes(SECRET)
    words = ["grade", lab, *map(str, given), "--out", str(place / "out"), "--secret", str(place / "secret")]
    start_s = time.perf_counter()
    command = [sys.executable, "-m", "snr_sim", *words, "--jobs", str(JOBS)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    samples: list[tuple[int, float]] = []
    is_over = threading.Event()

    def watch() -> None:
        while not is_over.wait(0.5):
            samples.append((len(list((place / "out" / "results").glob("*.json"))), memory_mb(process.pid)))

    watcher = threading.Thread(target=watch)
    watcher.start()
    status = process.wait()
    took_s = time.perf_counter() - start_s
    is_over.set()
    watcher.join()
    assert status == 0
    early = [mb for done, mb in samples if 0.1 * len(given) <= done <= 0.3 * len(given)]
    late = [mb for done, mb in samples if done >= 0.8 * len(given)]
    return took_s, mean(early or [0.0]), mean(late or [0.0])


def memory_mb(pid: int) -> float:
    """Returns what a process and its workers have in memory, without the students' processes below them [MB]."""
    pages = 0
    for one in [pid, *children(pid)]:
        try:
            pages += int(Path(f"/proc/{one}/statm").read_text().split()[1])
        except (OSError, IndexError):
            continue
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def children(pid: int) -> list[int]:
    """Returns the processes that a process has started."""
    found = []
    for file in Path(f"/proc/{pid}/task").glob("*/children"):
        found += [int(one) for one in file.read_text().split()]
    return found


def option(name: str, otherwise: str) -> str:
    """Returns what follows an option on the command line."""
    return sys.argv[sys.argv.index(name) + 1] if name in sys.argv else otherwise


def measure(is_quick: bool) -> Iterator[Row]:
    """Yields the rows."""
    lab = option("--lab", LAB)
    count = int(option("--count", str(QUICK_COUNT if is_quick else COUNT)))
    with tempfile.TemporaryDirectory() as name:
        given = copies(Path(option("--reference", str(REFERENCE))), count, Path(name) / "submissions")
        half: Callable[[int], float] = lambda i: bare_s(lab, given[i::2])  # noqa: E731
        before_s = half(0)
        took_s, early_mb, late_mb = graded_s(lab, given, Path(name))
        bare = before_s + half(1)
    yield Row(
        f"{count} submissions",
        count / took_s * 3600,
        "an hour",
        more_is_better=True,
        baseline=count / bare * 3600,
        compared_to="bare simulations",
        ratio=took_s / bare,
        ratio_limit=1 / WANTED_SHARE,
        note=f"wall time on {JOBS} cores, bare halves before and after; ratio is time to time",
    )
    yield Row(
        "memory, late",
        late_mb,
        "MB",
        baseline=early_mb,
        compared_to="early",
        ratio=late_mb / early_mb if early_mb else None,
        ratio_limit=MOST_GROWTH,
        note="grader with its workers, from 80 % and from 10 to 30 % of submissions done",
    )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--bare"]:
        grade_bare(sys.argv[2], sys.argv[3:])
    else:
        report(measure)
