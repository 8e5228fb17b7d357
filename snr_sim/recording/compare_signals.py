"""Statistics of each signal of one run: rate, age, noise, quantisation.

A signal is one field of a page over a run; the numbers of a list are its channels. `compare_runs.py` compares the
signals of two runs. These statistics need no true state, so they work for a real robot as well.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from snr_sim.recording.columns import Batch, Floats, Series
from snr_sim.recording.records import Record

STAMP = "stamp_s"  # the field of readings and output reports with the time of measurement or output
TRUTH = "truth"  # key of the plant's true state in simulated runs: no node can read it
APPLIED = "_applied"  # suffix of the key under which outputs report how a command was applied
APPLIED_WITHIN_S = 0.5
PULSES_US, STOP_US = "pulses_us", 1500.0
NOISE_WINDOW = 50  # third differences in each: a second of a sensor read 50 times a second
MAX_STEPS = 1e5  # a span of more steps than this counts as continuous
DEAD_BAND_SAMPLES = 20
# Neighbouring third differences of white noise are correlated (-0.75, 0.3, -0.05), so that 2.31 of them count as one;
# the median of powers with so many degrees of freedom is below their mean (Wilson and Hilferty 1931).
_TOGETHER = 1.0 + 2.0 * (0.75**2 + 0.3**2 + 0.05**2)
SAME_TIME_S = 1e-6
_THIRD = math.sqrt(1.0 + 9.0 + 9.0 + 1.0)  # gain of a third difference for white noise


@dataclass(frozen=True)
class Signal:
    """One field of a page over a run."""

    node: str  # whose page
    key: str  # of the page
    field: str  # of its data, with dots between nested fields; empty if the page is a number
    times_s: Floats  # shape (n,), when each page was stored
    values: Floats  # shape (n, channels)
    ages_s: Floats | None = None  # shape (n,), age of the data at that time; None if the page has no stamp

    @property
    def name(self) -> str:
        """Key and field: 'depth.depth_m'."""
        return f"{self.key}.{self.field}" if self.field else self.key


@dataclass(frozen=True)
class SignalStats:
    """Statistics of a signal. A field is None where it cannot be determined."""

    count: int  # number of pages
    rate_hz: float | None  # average rate of the pages
    age_s: float | None  # age of the data when it was stored: the median
    age_p95_s: float | None  # and its 95th percentile
    noise: float | None  # standard deviation of the change from one page to the next
    step: float | None  # quantisation: all values differ by multiples of it
    command_delay_s: float | None  # for pulses reported by outputs: the delay between command and report
    # For pulses: the values closest to neutral on either side [us from 1500] that occur, excluding 0.
    dead_band: tuple[float, float] | None
    lowest: float  # over all channels
    highest: float


def signals_of(records: Iterable[Record], node: str) -> dict[str, Signal]:
    """Return the signals of a node's pages by name, in the order in which they were first seen.

    The signals of the plant follow, if there is one: its true numbers, and the magnitude of each force that it shows.
    """
    batch = Batch()
    batch.extend(records)
    fields: dict[tuple[str, str], list[Series]] = defaultdict(list)
    stamps: dict[str, Series] = {}
    for owner, series in batch.page_values():
        if owner != node:
            continue
        key, *path = series.path
        if path == [STAMP]:
            stamps[key] = series
        else:
            fields[key, ".".join(path[:-1] if path and path[-1].isdecimal() else path)].append(series)
    found = [_signal(node, key, field, channels) for (key, field), channels in fields.items()]
    signals = {signal.name: _add_ages(signal, stamps.get(signal.key)) for signal in found if len(signal.times_s)}
    return signals | {signal.name: signal for signal in _truth_signals(batch)}


def _truth_signals(batch: Batch) -> Iterator[Signal]:
    for series in batch.truth_values():
        yield Signal("", TRUTH, ".".join(series.path), series.when.t_s, series.values.reshape(-1, 1))
    for name in batch.truths[0].vectors if batch.truths else ():
        vectors = [truth.vectors.get(name, [0.0] * 6)[3:] for truth in batch.truths]
        times_s = np.array([truth.t for truth in batch.truths])
        yield Signal("", TRUTH, f"{name}_n", times_s, np.linalg.norm(vectors, axis=1).reshape(-1, 1))


def _signal(node: str, key: str, field: str, channels: list[Series]) -> Signal:
    """Return the channels of a list as one signal, at the times at which all of them exist and are finite."""
    common = channels[0].when.seq
    for series in channels[1:]:
        common = np.intersect1d(common, series.when.seq, assume_unique=True)
    values = np.stack([series.values[np.isin(series.when.seq, common)] for series in channels], axis=1)
    times_s = channels[0].when.t_s[np.isin(channels[0].when.seq, common)]
    finite = np.isfinite(values).all(axis=1)
    return Signal(node, key, field, times_s[finite], values[finite])


def _add_ages(signal: Signal, stamp: Series | None) -> Signal:
    if stamp is None or len(stamp.values) == 0:
        return signal
    places = np.searchsorted(stamp.when.t_s, signal.times_s, side="right") - 1
    return replace(signal, ages_s=signal.times_s - stamp.values[np.maximum(places, 0)])


def signal_stats(signal: Signal, command: Signal | None = None) -> SignalStats:
    """Return the statistics of a signal that has values; of pulses that outputs report, also after their command."""
    times_s, values = signal.times_s, signal.values
    span_s = float(times_s[-1] - times_s[0])
    ages_s = signal.ages_s if signal.ages_s is not None and np.isfinite(signal.ages_s).all() else None
    return SignalStats(
        count=len(times_s),
        rate_hz=(len(times_s) - 1) / span_s if span_s > 0.0 else None,
        age_s=None if ages_s is None else float(np.median(ages_s)),
        age_p95_s=None if ages_s is None else float(np.quantile(ages_s, 0.95)),
        noise=noise_of(values),
        step=step_of(values),
        command_delay_s=None if command is None else command_delay_s(command, signal),
        dead_band=dead_band_of(values - STOP_US) if signal.field == PULSES_US else None,
        lowest=float(values.min()),
        highest=float(values.max()),
    )


def command_delay_s(command: Signal, applied: Signal) -> float | None:
    """Return the median delay between the command of a pulse and the output's report of it.

    A pulse that is not among the commands of the last half second is skipped: it was in transition from one to
    another. Neutral pulses are skipped, since the time of their command is ambiguous.
    """
    if command.values.shape[1] != applied.values.shape[1]:
        return None
    step = step_of(applied.values) or 0.0
    found = []
    for t, pulses in zip(applied.times_s, applied.values, strict=True):
        inside = slice(*np.searchsorted(command.times_s, [t - APPLIED_WITHIN_S, t + SAME_TIME_S]))
        times_s, asked = command.times_s[inside], command.values[inside]
        near = (np.abs(asked - pulses) <= 0.51 * step + 1e-6) & (pulses != STOP_US)
        found += [t - times_s[np.flatnonzero(column)[-1]] for column in near.T if column.any()]
    return float(np.median(found)) if found else None


def noise_of(values: Floats) -> float | None:
    """Return the standard deviation of white noise on signals that are otherwise smooth.

    Third differences remove a smooth motion and amplify noise by 4.5. The median over windows is used, so that
    occasional jolts do not count as noise.

    Args:
        values: shape (n, channels).

    Returns:
        root mean square over the channels; None for fewer than 8 values.
    """
    if len(values) < 8:
        return None
    third = np.diff(values, n=3, axis=0) / _THIRD
    windows = max(1, len(third) // NOISE_WINDOW)
    power = np.array([np.mean(part**2, axis=0) for part in np.array_split(third, windows)])
    below = (1.0 - 2.0 * _TOGETHER * windows / (9.0 * len(third))) ** 3 if windows > 1 else 1.0
    return float(np.sqrt(np.mean(np.median(power, axis=0)) / below))


def step_of(values: Floats) -> float | None:
    """Return the largest step of which all differences of values are multiples; None if they are continuous.

    >>> step_of(np.array([[1500.0], [1501.5], [1503.5]]))
    0.5
    """
    levels = np.unique(values)
    span = float(levels[-1] - levels[0])
    if len(levels) < 3:
        return None
    finest = span / MAX_STEPS
    step = 0.0
    for gap in np.unique(np.diff(levels)).tolist():
        step = _common_divisor(gap, step, 0.01 * finest)
        if step < finest:
            return None
    return float(f"{step:.6g}")


def _common_divisor(a: float, b: float, nothing: float) -> float:
    """Return the greatest common divisor of rounded numbers (Euclid); a remainder below `nothing` counts as 0."""
    while b > nothing:
        rest = math.fmod(a, b)
        a, b = b, min(rest, b - rest)
    return a


def dead_band_of(offsets: Floats) -> tuple[float, float] | None:
    """Return the values closest to 0 on either side, if there is a gap between them and 0.

    A thruster does not turn while its pulse is within a band around neutral; controllers that know the band skip it.

    Args:
        offsets: pulses relative to neutral.
    """
    sides = np.sort(-offsets[offsets < 0.0]), np.sort(offsets[offsets > 0.0])
    if min(map(len, sides)) < DEAD_BAND_SAMPLES:
        return None
    below, above = (float(side[0]) for side in sides)
    # Behind a gap, values are much closer to each other than the first of them is to 0.
    if any(side[0] < 3.0 * (side[DEAD_BAND_SAMPLES - 1] - side[0]) / DEAD_BAND_SAMPLES for side in sides):
        return None
    return -below, above
