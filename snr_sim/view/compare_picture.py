"""Picture of two runs: both curves of a signal over a common time axis, with their difference below."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from snr_sim.prelude.errors import UnknownNameError, suggest
from snr_sim.recording.compare_runs import Comparison, SignalComparison, channel_of
from snr_sim.recording.compare_signals import TRUTH
from snr_sim.recording.records import Header
from snr_sim.view.picture_plots import COLORS, Plot, draw_plots
from snr_sim.view.picture_sheet import INK, PALE, Sheet, picture
from snr_sim.view.view_blueprint import name_and_unit

WIDTH, HEIGHT = 900, 560
TOP, LEFT, RIGHT, BETWEEN, BOTTOM = 66.0, 14.0, 886.0, 26.0, 534.0
MAX_SIGNALS = 4
CURVES_HEIGHT, DIFFERENCE_HEIGHT = 2.2, 1.2
DIFFERENCE_COLOR = 2


def select_signals(comparison: Comparison, names: Sequence[str] = ()) -> list[SignalComparison]:
    """Return the signals to draw: the most significant one of each page, commands first, or those that are asked for.

    UnknownNameError is raised if one of these does not exist.
    """
    by_name = {one.name: one for one in comparison.signals}
    if names:
        return [_find_signal(name, by_name) for name in names]
    best: dict[str, SignalComparison] = {}
    for one in comparison.signals:
        key = one.first.key
        moves = one.of_first.highest > one.of_first.lowest or one.of_second.highest > one.of_second.lowest
        if moves and key != TRUTH and (key not in best or one.relative_rms > best[key].relative_rms):
            best[key] = one
    return sorted(best.values(), key=lambda one: (not one.is_command, -one.relative_rms))[:MAX_SIGNALS]


def _find_signal(name: str, by_name: Mapping[str, SignalComparison]) -> SignalComparison:
    """Return the signal with a name; with an index in brackets, only that channel of it."""
    whole, _, index = name.removesuffix("]").partition("[")
    one = by_name.get(whole)
    if one is None:
        raise UnknownNameError(f"There is no signal '{whole}' in both runs.", fix=suggest(whole, by_name))
    if not index:
        return one
    channels = one.difference.shape[1]
    if not index.isdecimal() or int(index) >= channels:
        raise UnknownNameError(f"'{whole}' has no [{index}].", fix=f"[0] to [{channels - 1}].")
    return channel_of(one, int(index))


def draw_comparison(comparison: Comparison, header: Header, path: str | Path, names: Sequence[str] = ()) -> None:
    """Draw two runs as a PNG of 1800 x 1120 pixels; `header` is that of the first run.

    Up to four of the signals in `names` are readable; by default they are the most significant ones.

    Raises:
        MissingExtraError: matplotlib is not installed.
        UnknownNameError: a signal that is asked for does not exist.
    """
    chosen = select_signals(comparison, names)
    columns = [chosen] if len(chosen) < 2 else [chosen[0::2], chosen[1::2]]
    width = (RIGHT - LEFT - BETWEEN * (len(columns) - 1)) / len(columns)
    with picture(path, WIDTH, HEIGHT) as sheet:
        _draw_title(sheet, comparison, header)
        for place, column in enumerate(columns):
            left = LEFT + place * (width + BETWEEN)
            plots = [plot for one in column for plot in _plots(one)]
            begin_s = min(float(times_s[0]) for plot in plots for _, times_s, _ in plot.lines)
            draw_plots(sheet, (left, TOP, left + width, BOTTOM), plots, (), begin_s=max(0.0, begin_s))


def _draw_title(sheet: Sheet, comparison: Comparison, header: Header) -> None:
    sheet.text((LEFT, 10), header.scenario or header.robot, 17.0, INK)
    x = LEFT
    for place, label in enumerate(comparison.labels):
        sheet.text((x, 38), label, 12.0, COLORS[place])
        x += sheet.text_width(label, 12.0) + 14
    sheet.text((x, 38), f"{comparison.labels[1]} less {comparison.labels[0]}", 12.0, COLORS[DIFFERENCE_COLOR])
    subtitle = f"seed {header.seed}, controller '{header.controller}', pages of {comparison.node}"
    sheet.text((RIGHT, 14), subtitle, 11.0, PALE, "rt")


def _plots(one: SignalComparison) -> list[Plot]:
    channel, index = _channel(one)
    path = [one.first.key, *filter(None, one.first.field.split(".")), *index]
    if len(path) > 1 and path[1].startswith(path[0]):  # depth.depth_m
        path = path[1:]
    words, unit = name_and_unit(path)
    label = f"{words} [{unit}]" if unit else words
    values = one.first.values[:, channel], one.second.values[:, channel]
    curves = [(label, one.first.times_s, values[0]), ("", one.second.times_s, values[1])]
    size = f"rms {one.rms:.3g}, largest {one.largest:.3g}"
    difference = [(size, one.times_s, one.difference[:, channel])]
    return [
        Plot("", curves, relative_height=CURVES_HEIGHT, is_down=one.first.field.endswith("depth_m")),
        Plot("", difference, relative_height=DIFFERENCE_HEIGHT, first_color=DIFFERENCE_COLOR),
    ]


def _channel(one: SignalComparison) -> tuple[int, tuple[str, ...]]:
    """Return the index of the most significant number of a list, and its label: the index."""
    if one.channel is not None:
        return 0, (str(one.channel),)
    if one.difference.shape[1] == 1:
        return 0, ()
    channel = int(np.argmax(np.mean(one.difference**2, axis=0)))
    return channel, (str(channel),)
