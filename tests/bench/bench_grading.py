"""Grading: the cost of sandbox, pipe, reports and bookkeeping compared with bare simulations; and the grader's memory.

Submissions are copies of a lab's reference. The bare side runs the same checks on the same cases in two processes that
import the student's functions: no sandbox, no pipe, no process per case, no files. It runs a sample of at most 40
submissions, and the time per submission is compared. The start of Python and its imports count for the grader and not
for the bare side. The goal is about wall time on two cores, which needs an idle computer. Where there are cgroups, the
grader is frozen at intervals while a slice of the bare side is measured, so that drifts of the computer's speed affect
both; the CPU time of everything that the grader starts is reported, too: on a busy computer only that is meaningful.

Run by `snr bench grading`, or with options: ten minutes, with progress on stderr:
python tests/bench/run.py grading --count 200 [--lab NAME_OR_PATH --reference FOLDER]
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import mean
from types import ModuleType
from typing import Any

import msgspec
from harness import Row

from snr_sim.grading import grade
from snr_sim.grading.lab.lab import find_lab
from snr_sim.grading.lab.student import Student
from snr_sim.scenario import library

PROJECT = Path(__file__).resolve().parents[2]
LAB, REFERENCE = "lunar_lander_q", PROJECT / "tests" / "assignments" / "lunar_lander_q" / "reference"
JOBS, COUNT, QUICK_COUNT = 2, 40, 4
SAMPLE, SLICES = 40, 5  # submissions of the bare side, and the number of parts in which they are measured
REPORT_PERIOD_S, LOOK_S = 15.0, 0.2
SECRET = b"of the benchmark, which everybody may know"
TARGET_RATIO = 0.9
MAX_GROWTH = 1.1


class BareHost:
    """Replacement for `Student.create_object` that calls directly."""

    def __init__(self, made: Any) -> None:
        self._made = made

    def ask(self, method: str, *args: Any, returns: Any = Any, **_: Any) -> Any:
        """Call a method; a dict becomes the class that the lab asked for."""
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
        """Call it."""
        return getattr(self._module(file), function)(*args)

    def create_object(self, file: str, kind: type[Any], *args: Any, **_: Any) -> Any:
        """Make it."""
        return BareHost(kind(self._module(file), *args))


def grade_bare(lab: str, folders: list[str]) -> None:
    """Grade submissions one after the other in this process; print when it began and ended [s], and its CPU time [s].

    One is graded before, to have everything imported.
    """
    grade.Student = Bare  # type: ignore[misc]
    found = find_lab(lab)
    began_s = cpu_s = 0.0
    for i, folder in enumerate([folders[0], *folders]):
        if i == 1:
            began_s, cpu_s = time.monotonic(), time.process_time()
        graded = grade.grade_submission(found, Path(folder), SECRET, "none")
        assert graded.points == 100.0, graded
    print(began_s, time.monotonic(), time.process_time() - cpu_s)


def copies(reference: Path, count: int, into: Path) -> list[Path]:
    """Return so many submissions, no two of which are the same to the byte."""
    made = []
    for i in range(count):
        folder = into / f"student_{i:03}"
        shutil.copytree(reference, folder, ignore=shutil.ignore_patterns("__pycache__"))
        for file in folder.glob("*.py"):
            file.write_text(file.read_text() + f"\n# student {i}\n")
        made.append(folder)
    return made


@dataclass(frozen=True)
class Took:
    """Time and memory of a grading.

    Args:
        wall_s: on all cores.
        cpu_s: of all processes; None where it is not measured.
        early_mb, late_mb: memory of the grader with its workers.
    """

    wall_s: float
    cpu_s: float | None
    early_mb: float = 0.0
    late_mb: float = 0.0


def bare(lab: str, given: list[Path]) -> Took:
    """Return what the bare simulations take on all cores."""
    print_progress(f"bare: {len(given)} submissions")
    command = [sys.executable, str(Path(__file__)), "--bare", lab]
    parts = [given[i::JOBS] for i in range(JOBS) if given[i::JOBS]]
    running = [subprocess.Popen([*command, *map(str, part)], stdout=subprocess.PIPE, text=True) for part in parts]
    outputs = [list(map(float, process.communicate()[0].split())) for process in running]
    began_s, ended_s, cpu_s = zip(*outputs, strict=True)
    return Took(max(ended_s) - min(began_s), sum(cpu_s))


def graded(lab: str, given: list[Path], place: Path, slices: list[list[Path]]) -> tuple[Took, list[Took]]:
    """Return what `snr grade` takes, and what the bare side takes on each slice, measured in between if it can be."""
    print_progress(f"graded: {len(given)} submissions")
    (place / "secret").write_bytes(SECRET)
    words = ["grade", lab, *map(str, given), "--out", str(place / "out"), "--secret", str(place / "secret")]
    samples: list[tuple[int, float]] = []
    bares: list[Took] = []
    with counted() as group:
        start_s = reported_s = time.perf_counter()
        frozen_s = 0.0
        command = [*group.enter, sys.executable, "-m", "snr_sim", *words, "--jobs", str(JOBS)]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        while process.poll() is None:
            time.sleep(LOOK_S)
            done, now_s = len(list((place / "out" / "results").glob("*.json"))), time.perf_counter()
            samples.append((done, memory_mb(process.pid)))
            if now_s - reported_s >= REPORT_PERIOD_S:
                reported_s = now_s
                print_progress(f"graded {done} of {len(given)} in {now_s - start_s - frozen_s:.0f} s")
            if len(bares) < len(slices) and done >= (len(bares) + 0.5) * len(given) / len(slices) and group.freeze():
                try:
                    bares.append(bare(lab, slices[len(bares)]))
                finally:
                    group.thaw()
                frozen_s += time.perf_counter() - now_s
        took_s = time.perf_counter() - start_s - frozen_s
        cpu_s = group.cpu_s()
    assert process.returncode == 0
    bares += [bare(lab, one) for one in slices[len(bares) :]]
    early = [mb for done, mb in samples if 0.1 * len(given) <= done <= 0.3 * len(given)]
    late = [mb for done, mb in samples if done >= 0.8 * len(given)]
    return Took(took_s, cpu_s, mean(early or [0.0]), mean(late or [0.0])), bares


class Group:
    """A control group, in which the kernel counts the CPU time of all its processes, including sandboxes.

    Args:
        folder: of it; None where there is none to be had.
    """

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        join = 'echo $$ > "$0"/cgroup.procs; exec "$@"'
        self.enter = ["sh", "-c", join, str(folder)] if folder is not None else []  # before a command

    def cpu_s(self) -> float | None:
        """Return the CPU time so far [s]."""
        if self.folder is None:
            return None
        return int(self._values_of("cpu.stat")["usage_usec"]) / 1e6

    def freeze(self) -> bool:
        """Stop all that is in it; return whether that can be done."""
        if self.folder is None or not (self.folder / "cgroup.freeze").exists():
            return False
        (self.folder / "cgroup.freeze").write_text("1")
        while self._values_of("cgroup.events")["frozen"] != "1":
            time.sleep(0.001)
        return True

    def thaw(self) -> None:
        """Let it continue."""
        if self.folder is not None:
            (self.folder / "cgroup.freeze").write_text("0")

    def _values_of(self, file: str) -> dict[str, str]:
        assert self.folder is not None
        return dict(line.split() for line in (self.folder / file).read_text().splitlines())


@contextmanager
def counted() -> Iterator[Group]:
    """Yield a new group."""
    mounts = [line.split() for line in Path("/proc/self/mounts").read_text().splitlines()]
    folder = next((Path(one[1]) / f"snr_bench_{os.getpid()}" for one in mounts if one[2] == "cgroup2"), None)
    try:
        if folder is not None:
            folder.mkdir()
    except OSError:
        folder = None  # no permission to create it
    yield Group(folder)
    give_up_s = time.monotonic() + 10.0
    while folder is not None and folder.is_dir() and time.monotonic() < give_up_s:
        with suppress(OSError):  # fails until its last process has been reaped
            folder.rmdir()


def print_progress(words: str) -> None:
    """Print the progress on stderr."""
    print(words, file=sys.stderr, flush=True)


def memory_mb(pid: int) -> float:
    """Return what a process and its workers have in memory, without the students' processes below them [MB]."""
    pages = 0
    for one in [pid, *children(pid)]:
        try:
            pages += int(Path(f"/proc/{one}/statm").read_text().split()[1])
        except (OSError, IndexError):
            continue
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    found = []
    for file in Path(f"/proc/{pid}/task").glob("*/children"):
        found += [int(one) for one in file.read_text().split()]
    return found


def option(name: str, otherwise: str) -> str:
    """Return what follows an option on the command line."""
    return sys.argv[sys.argv.index(name) + 1] if name in sys.argv else otherwise


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows."""
    lab = option("--lab", LAB)
    count = int(option("--count", str(QUICK_COUNT if is_quick else COUNT)))
    with tempfile.TemporaryDirectory() as name:
        given = copies(Path(option("--reference", str(REFERENCE))), count, Path(name) / "submissions")
        sample = given[:SAMPLE]
        slices = [sample[i::SLICES] for i in range(SLICES) if len(sample) >= JOBS * SLICES] or [sample]
        took, bares = graded(lab, given, Path(name), slices)
    bare_s = sum(one.wall_s for one in bares) / len(sample)
    yield Row(
        f"{count} submissions",
        count / took.wall_s * 3600,
        "an hour",
        more_is_better=True,
        baseline=3600 / bare_s,
        compared_to="bare simulations",
        ratio=took.wall_s / count / bare_s,
        ratio_limit=1 / TARGET_RATIO,
        note=f"wall time on {JOBS} cores; {len(sample)} bare ones in {len(slices)} parts between; ratio: time to time",
    )
    if took.cpu_s is not None:
        bare_cpu_s = sum(one.cpu_s or 0.0 for one in bares) / len(sample)
        yield Row(
            "CPU time of a submission",
            took.cpu_s / count,
            "s",
            baseline=bare_cpu_s,
            compared_to="bare simulations",
            ratio=took.cpu_s / count / bare_cpu_s,
            note="all processes of the grader and of its sandboxes, with their start; for a busy computer",
        )
    yield Row(
        "memory, late",
        took.late_mb,
        "MB",
        baseline=took.early_mb,
        compared_to="early",
        ratio=took.late_mb / took.early_mb if took.early_mb else None,
        ratio_limit=MAX_GROWTH,
        note="grader with its workers, from 80 % and from 10 to 30 % of submissions done",
    )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--bare"]:
        grade_bare(sys.argv[2], sys.argv[3:])
