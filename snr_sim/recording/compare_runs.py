"""Comparison of two runs of one robot: which signals differ, by how much, and from what time on.

Meant for the same node in simulation, on an emulated board and on the real one: how much later, noisier and coarser
are its signals there? The statistics of each run come from `compare_signals.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from snr_sim.prelude.errors import TraceError, UnknownNameError, suggest
from snr_sim.recording.columns import Floats
from snr_sim.recording.compare_signals import APPLIED, TRUTH, Signal, SignalStats, signal_stats, signals_of
from snr_sim.recording.reader import Trace
from snr_sim.recording.records import Header

MAX_DELAY_S, DELAY_STEP_S = 1.0, 0.005  # maximum and resolution of the time shift of one run against the other
MAX_RESIDUAL_FRACTION = 0.7  # a shift must reduce the difference to this fraction, or the lag is not identifiable
SAME = 1e-9  # relative differences below this are rounding errors


@dataclass(frozen=True)
class SignalComparison:
    """One signal in two runs."""

    first: Signal
    second: Signal  # shifted in time as requested
    of_first: SignalStats
    of_second: SignalStats
    times_s: Floats  # shape (n,), of the common time
    difference: Floats  # shape (n, channels): second minus first, interpolated to the first one's times
    rms: float  # root mean square of the difference, over the channels
    largest: float  # the difference of largest magnitude, with its sign
    largest_at_s: float
    largest_channel: int
    first_differs_s: float | None  # when any channel first differs; None if never
    delay_s: float | None  # of the second signal, if a shift explains the difference; else None
    is_command: bool  # whether it is in a page that drives outputs
    channel: int | None = None  # index in a list if this is only one channel of it; None for all channels

    @property
    def name(self) -> str:
        """Key and field."""
        return self.first.name

    @property
    def relative_rms(self) -> float:
        """The difference as a fraction of the signal's span: a measure of its significance."""
        span = max(self.of_first.highest, self.of_second.highest) - min(self.of_first.lowest, self.of_second.lowest)
        return self.rms / span if span > 0.0 else 0.0


@dataclass(frozen=True)
class Comparison:
    """Two runs."""

    labels: tuple[str, str]  # names of the runs, from what differs between them
    node: str  # whose pages were compared
    signals: list[SignalComparison]  # that both runs have, in the order of the first run
    only_first: list[str]  # names of signals that only one run has
    only_second: list[str]
    is_identical: bool  # whether the two traces are the same, byte for byte

    @property
    def commands_differ(self) -> SignalComparison | None:
        """The command that differs first; None if all are the same."""
        differing = [one for one in self.signals if one.is_command and one.first_differs_s is not None]
        return min(differing, key=lambda one: one.first_differs_s or 0.0, default=None)


def compare_runs(
    first: Trace,
    second: Trace,
    node: str = "",
    shift_s: float = 0.0,
    within_s: tuple[float, float] = (-math.inf, math.inf),
) -> Comparison:
    """Compare two runs of one robot.

    Args:
        first, second: their traces.
        node: whose pages: a role, or its name with _node; by default the first node of both runs that drives
            actuators.
        shift_s: assumed delay of the second run's start.
        within_s: compare only pages stored between these times of the first run's clock.

    Raises:
        TraceError: the runs are of different robots, or have nothing in common.
        UnknownNameError: a run does not have this node.
    """
    if first.header.robot != second.header.robot:
        raise TraceError(
            f"These are runs of different robots: {_label(first)} is of '{first.header.robot}', {_label(second)} of "
            f"'{second.header.robot}'.",
            fix="compare two runs of one robot, as with --io sim and --io emulated.",
        )
    node = _common_node(first, second, node)
    signals = [
        {name: _cut(signal, later_s, *within_s) for name, signal in signals_of(trace.records, node).items()}
        for trace, later_s in ((first, 0.0), (second, shift_s))
    ]
    common = [name for name in signals[0] if name in signals[1]]
    if all(signals[0][name].key == TRUTH for name in common):
        raise TraceError(
            f"The node '{node}' stored no page with numbers in both runs. {_pages(first, signals[0])} "
            f"{_pages(second, signals[1])}",
            fix="compare whole runs of the same scenario, or another --node.",
        )
    commands = set(first.header.commands.get(node, ()))
    pairs = [(signals[0][name], signals[1][name]) for name in common]
    compared = [
        _compare_signals(one, other, one.key in commands, _commands_for(one, signals))
        for one, other in pairs
        if _overlap(one, other) is not None
    ]
    if not compared:
        raise TraceError(
            f"The runs have no time in common: {_spans(pairs)}.",
            fix="another --shift, --from or --until; --shift 0 puts both beginnings together.",
        )
    return Comparison(
        labels_of(first.header, second.header),
        node,
        compared,
        [name for name in signals[0] if name not in signals[1]],
        [name for name in signals[1] if name not in signals[0]],
        first.digest == second.digest,
    )


def shift_by_commands_s(first: Trace, second: Trace) -> float:
    """Return how much later the second run's commands first changed, for runs that were started by hand.

    Raises:
        TraceError: in one of the runs no command ever changes.
    """
    begun = []
    for trace in (first, second):
        changes = []
        for node in trace.header.nodes:
            keys = trace.header.commands.get(node, ())
            for signal in signals_of(trace.records, node).values() if keys else ():
                moved = (signal.values != signal.values[:1]).any(axis=1)
                if signal.key in keys and moved.any():
                    changes.append(float(signal.times_s[np.argmax(moved)]))
        if not changes:
            raise TraceError(
                f"Cannot align the runs: in {_label(trace)} no command page ever changes.",
                fix="give the offset in seconds: --shift 2.5.",
            )
        begun.append(min(changes))
    return begun[1] - begun[0]


def labels_of(first: Header, second: Header) -> tuple[str, str]:
    """Return names for two runs: the first property in which they differ."""
    for field in ("io", "engine", "controller", "seed", "scenario", "clock"):
        one, other = str(getattr(first, field)), str(getattr(second, field))
        if one != other:
            return (one, other) if field != "seed" else (f"seed {one}", f"seed {other}")
    return "first", "second"


def _label(trace: Trace) -> str:
    return trace.path.parent.name or str(trace.path)


def _common_node(first: Trace, second: Trace, requested: str) -> str:
    common = [name for name in first.header.nodes if name in second.header.nodes]
    if requested:
        found = next((name for name in common if name in (requested, f"{requested}_node")), None)
        if found is None:
            raise UnknownNameError(f"The runs have no node '{requested}' in common.", fix=suggest(requested, common))
        return found
    if not common:
        nodes = ", ".join(first.header.nodes), ", ".join(second.header.nodes)
        raise TraceError(
            f"The runs have no node in common: {_label(first)} has {nodes[0]}; {_label(second)} has {nodes[1]}.",
            fix="of roles that ran by themselves, compare the same role.",
        )
    return next((name for name in common if first.header.commands.get(name)), common[0])


def _pages(trace: Trace, signals: dict[str, Signal]) -> str:
    keys = ", ".join(dict.fromkeys(signal.key for signal in signals.values()))
    return f"In {_label(trace)} there is {keys or 'none at all'}."


def _cut(signal: Signal, later_s: float, begin_s: float, end_s: float) -> Signal:
    """Return the part of a signal between two times, after its times were set back by `later_s`."""
    times_s = signal.times_s - later_s
    inside = (times_s >= begin_s) & (times_s <= end_s)
    ages_s = None if signal.ages_s is None else signal.ages_s[inside]
    return replace(signal, times_s=times_s[inside], values=signal.values[inside], ages_s=ages_s)


def _overlap(first: Signal, second: Signal) -> tuple[float, float] | None:
    """Return the common time span; None if there is none, or if the numbers of channels differ."""
    if not (len(first.times_s) and len(second.times_s)) or first.values.shape[1] != second.values.shape[1]:
        return None
    begin_s = float(max(first.times_s[0], second.times_s[0]))
    end_s = float(min(first.times_s[-1], second.times_s[-1]))
    inside = (first.times_s >= begin_s) & (first.times_s <= end_s)
    return (begin_s, end_s) if inside.any() else None


def _commands_for(applied: Signal, signals: Sequence[Mapping[str, Signal]]) -> tuple[Signal | None, Signal | None]:
    """Return, for pulses reported by outputs, the commands for them in both runs."""
    if not applied.key.endswith(APPLIED):
        return None, None
    name = f"{applied.key.removesuffix(APPLIED)}.{applied.field}"
    return signals[0].get(name), signals[1].get(name)


def _spans(pairs: Sequence[tuple[Signal, Signal]]) -> str:
    spans = []
    for place, which in enumerate(("first", "second")):
        times_s = [pair[place].times_s for pair in pairs if len(pair[place].times_s)]
        begin_s, end_s = min((t[0] for t in times_s), default=0.0), max((t[-1] for t in times_s), default=0.0)
        spans.append(f"the {which} goes from {begin_s:.2f} to {end_s:.2f} s")
    return ", ".join(spans)


def _compare_signals(
    first: Signal, second: Signal, is_command: bool, commands: tuple[Signal | None, Signal | None]
) -> SignalComparison:
    begin_s, end_s = _overlap(first, second) or (0.0, 0.0)
    inside = (first.times_s >= begin_s) & (first.times_s <= end_s)
    times_s, values = first.times_s[inside], first.values[inside]
    others = np.stack([np.interp(times_s, second.times_s, column) for column in second.values.T], axis=1)
    difference = others - values
    if first.field.endswith("_rad"):  # in the shorter direction
        difference -= 2.0 * math.pi * np.round(difference / (2.0 * math.pi))
    step, channel = np.unravel_index(int(np.argmax(np.abs(difference))), difference.shape)
    differs = (np.abs(difference) > SAME * np.maximum(1.0, np.abs(values))).any(axis=1)
    return SignalComparison(
        first,
        second,
        signal_stats(first, commands[0]),
        signal_stats(second, commands[1]),
        times_s,
        difference,
        rms=float(np.sqrt(np.mean(difference**2))),
        largest=float(difference[step, channel]),
        largest_at_s=float(times_s[step]),
        largest_channel=int(channel),
        first_differs_s=float(times_s[np.argmax(differs)]) if differs.any() else None,
        delay_s=delay_s(first, second, int(np.argmax(np.ptp(values, axis=0)))),
        is_command=is_command,
    )


def channel_of(one: SignalComparison, channel: int) -> SignalComparison:
    """Return the comparison of a single channel."""
    only = slice(channel, channel + 1)
    first, second = (replace(signal, values=signal.values[:, only]) for signal in (one.first, one.second))
    alone = _compare_signals(first, second, one.is_command, (None, None))
    return replace(alone, channel=channel)


def delay_s(first: Signal, second: Signal, channel: int) -> float | None:
    """Return how much later a signal moves in the second run than in the first.

    One signal is shifted against the other until their difference is minimal.

    Returns:
        seconds, negative if it is earlier; None if the shift explains less than a third of the difference.
    """
    begin_s = max(first.times_s[0], second.times_s[0]) + MAX_DELAY_S
    end_s = min(first.times_s[-1], second.times_s[-1]) - MAX_DELAY_S
    if end_s - begin_s < 2.0 * MAX_DELAY_S:
        return None
    max_steps = round(MAX_DELAY_S / DELAY_STEP_S)
    count = int((end_s - begin_s) / DELAY_STEP_S)
    grid_s = begin_s + DELAY_STEP_S * np.arange(count)
    wide_s = begin_s + DELAY_STEP_S * np.arange(-max_steps, count + max_steps)
    one = np.interp(grid_s, first.times_s, first.values[:, channel])
    other = np.interp(wide_s, second.times_s, second.values[:, channel])
    powers = np.array([np.mean((other[k : k + count] - one) ** 2) for k in range(2 * max_steps + 1)])
    best = int(np.argmin(powers))
    if best in (0, 2 * max_steps) or powers[best] >= MAX_RESIDUAL_FRACTION**2 * powers[max_steps]:
        return None
    before, lowest, after = powers[best - 1 : best + 2]
    bend = before - 2.0 * lowest + after
    fraction = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float((best - max_steps + fraction) * DELAY_STEP_S)
