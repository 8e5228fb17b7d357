"""What benchmarks share: a row of the table, and fair ways to measure on a machine whose speed drifts.

A laptop's clock changes by a factor of two within minutes, so a time alone says little. Subject and baseline take turns
within one process, A B A B, and what counts is the median of the ratios of neighbours; beside it stands the shortest
time of each. Times are CPU time of all threads of the process, unless a row says otherwise.
"""

from __future__ import annotations

import gc
import json
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any, TypeAlias

# Makes something ready, untimed, and returns what is timed: each turn starts from the same state.
Trial: TypeAlias = Callable[[], Callable[[], Any]]


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Args:
        name: what was measured.
        value: how much of it.
        unit: of value, limit and baseline.
        limit: the target for the value; None if only the ratio has one.
        more_is_better: the limit is a least, not a most.
        baseline: what the bare version took in the same run.
        compared_to: what the bare version is.
        ratio: median of value over baseline.
        ratio_limit: the target for the ratio, always a most.
        note: what else a reader must know.
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
    """What turns of several trials took.

    Args:
        shortest_s: per trial.
        ratios: per trial, the median over the rounds of its time to the first trial's time in the same round.
    """

    shortest_s: list[float]
    ratios: list[float]


def cpu_time_of(trial: Trial) -> float:
    """Returns the CPU time of one turn [s], after the garbage of what came before is gone."""
    run = trial()
    gc.collect()
    start_s = time.process_time()
    run()
    return time.process_time() - start_s


def compare(baseline: Trial, *subjects: Trial, rounds: int) -> Comparison:
    """Has baseline and subjects take turns; the first round warms everything up and does not count.

    A subject's time is divided by the mean of the baseline's turns before and after it, so that a machine that gets
    steadily slower is not mistaken for a slow subject.
    """
    trials = (baseline, *subjects)
    for trial in trials:
        cpu_time_of(trial)
    times = [[cpu_time_of(trial) for trial in trials] for _ in range(rounds)]
    after = [turn[0] for turn in times[1:]] + [cpu_time_of(baseline)]
    ratios = [
        median(turn[i] / (0.5 * (turn[0] + later)) for turn, later in zip(times, after, strict=True))
        for i in range(len(trials))
    ]
    return Comparison([min(turn[i] for turn in times) for i in range(len(trials))], ratios)


def report(measure: Callable[[bool], Iterator[Row]]) -> None:
    """Runs a file's `measure`, printing each row as soon as it is known: in words, or as JSON with --json."""
    is_quick, is_json = "--quick" in sys.argv, "--json" in sys.argv
    for row in measure(is_quick):
        if is_json:
            print(json.dumps({**asdict(row), "is_met": row.is_met}), flush=True)
        else:
            print(_in_words(row), flush=True)


def _in_words(row: Row) -> str:
    words = [f"{row.name}: {row.value:.3g} {row.unit}"]
    if row.ratio is not None:
        words.append(f"{row.ratio:.2f} x {row.compared_to or 'baseline'}")
    if row.is_met is not None:
        words.append("met" if row.is_met else "MISSED")
    return ", ".join(words)
