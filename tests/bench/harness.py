"""Common parts of benchmarks: a row of the table, and fair measurements on a machine whose speed drifts.

A laptop's clock changes by a factor of two within minutes, so an absolute time means little. Subject and baseline take
turns within one process, A B A B, and the result is the median of the ratios of neighbours, printed with the shortest
time of each. Times are CPU time of all threads of the process, unless a row states otherwise.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any, TypeAlias

from snr_sim.devices.emulated.toolchain import ToolsMissingError
from snr_sim.grading.sandbox.sandbox import IsolationMissingError
from snr_sim.prelude.errors import ComponentFailedError, MissingExtraError

_OURS = ("snr_sim", "harness", "peers")
# Prepares a trial, untimed, and returns the function to time: each turn starts from the same state.
Benchmark: TypeAlias = Callable[[], Callable[[], Any]]


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Args:
        name: what was measured.
        value: the measured value.
        unit: of value, limit and baseline.
        limit: the target for the value; None if only the ratio has one.
        more_is_better: whether the limit is a minimum instead of a maximum.
        baseline: value of the bare version in the same run.
        compared_to: description of the bare version.
        ratio: median of value over baseline.
        ratio_limit: the target for the ratio, always a maximum.
        note: further information for readers.
    """

    name: str
    value: float
    unit: str
    limit: float | None = None
    more_is_better: bool = False
    baseline: float | None = None
    compared_to: str = ""
    ratio: float | None = None
    ratio_limit: float | None = None
    note: str = ""

    @property
    def is_met(self) -> bool | None:
        """Whether all targets of the row are met; None if it has none."""
        met = []
        if self.limit is not None:
            met.append(self.value >= self.limit if self.more_is_better else self.value <= self.limit)
        if self.ratio is not None and self.ratio_limit is not None:
            met.append(self.ratio <= self.ratio_limit)
        return all(met) if met else None


@dataclass(frozen=True)
class Comparison:
    """Times of the turns of several trials.

    Args:
        shortest_s: per trial.
        ratios: per trial, the median over the rounds of its time to the first trial's time in the same round.
    """

    shortest_s: list[float]
    ratios: list[float]


def cpu_time_of(benchmark: Benchmark) -> float:
    """Return the CPU time of one turn [s], after the garbage of what came before is gone."""
    run = benchmark()
    gc.collect()
    start_s = time.process_time()
    run()
    return time.process_time() - start_s


def with_bytecode(folder: Path) -> dict[str, str]:
    """Return the environment of a process that keeps bytecode in a folder.

    Python stores bytecode next to the source unless the environment forbids it; an installation by pip includes it.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**environment, "PYTHONPYCACHEPREFIX": str(folder)}


def cpu_time_of_process_s(command: Sequence[str], bytecode: Path) -> float:
    """Return the CPU time of a process from start to end."""
    before = os.times()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=with_bytecode(bytecode))
    after = os.times()
    return after.children_user - before.children_user + after.children_system - before.children_system


def compare(baseline: Benchmark, *subjects: Benchmark, rounds: int) -> Comparison:
    """Run baseline and subjects in turns; the first round is a warm-up and does not count.

    A subject's time is divided by the mean of the baseline's turns before and after it, so that a machine that becomes
    steadily slower does not make the subject look slow.
    """
    benchmarks = (baseline, *subjects)
    for benchmark in benchmarks:
        cpu_time_of(benchmark)
    times = [[cpu_time_of(benchmark) for benchmark in benchmarks] for _ in range(rounds)]
    after = [turn[0] for turn in times[1:]] + [cpu_time_of(baseline)]
    ratios = [
        median(turn[i] / (0.5 * (turn[0] + later)) for turn, later in zip(times, after, strict=True))
        for i in range(len(benchmarks))
    ]
    return Comparison([min(turn[i] for turn in times) for i in range(len(benchmarks))], ratios)


@dataclass(frozen=True)
class Skipped:
    """A part that cannot be measured here.

    Args:
        name: of the part.
        skipped: the reason.
    """

    name: str
    skipped: str


# What a benchmark yields. Each file `bench_<name>.py` has a function `measure(is_quick)` that yields them one by one.
Outcome: TypeAlias = Row | Skipped

_MISSING = (MissingExtraError, ToolsMissingError, IsolationMissingError, ModuleNotFoundError)


def what_can_run(name: str, measure: Callable[[], Iterable[Outcome]]) -> Iterator[Outcome]:
    """Yield what a part of a benchmark measures; where a package or a tool is missing, that it was skipped."""
    try:
        yield from measure()
    except (*_MISSING, ComponentFailedError) as error:
        missing = error.__cause__ if isinstance(error, ComponentFailedError) else error  # a node needed it
        is_ours = isinstance(missing, ModuleNotFoundError) and (missing.name or "").partition(".")[0] in _OURS
        if is_ours or not isinstance(missing, _MISSING):
            raise
        yield Skipped(name, str(missing))


def main() -> None:
    """Run the benchmark that the first word names, printing each result as one line of JSON as soon as it is known."""
    name, is_quick = sys.argv[1], "--quick" in sys.argv

    def measure() -> Iterator[Outcome]:
        yield from importlib.import_module(f"bench_{name}").measure(is_quick)

    for outcome in what_can_run(name, measure):
        fields = asdict(outcome)
        if isinstance(outcome, Row):
            fields["is_met"] = outcome.is_met
        print(json.dumps(fields), flush=True)
