"""Plots of a link's page: counts are converted to rates and seconds to milliseconds, each in its own plot.

A link reports how many pages it has sent since its start; in one plot with a flag, such a count hides everything else.
The original numbers are in the view, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from snr_sim.recording.columns import Series

LINK_PAGE = "link_"  # prefix of the keys of such pages
COUNTED = ("sent", "received", "dropped")


class Report(NamedTuple):
    """One quantity that a link reports."""

    name: str
    plot: str  # that shows it
    series: Series | None  # the numbers; None if they are those of the page


class LinkReports:
    """Converter of pages, in batches, to reports; it keeps the last value of each count."""

    def __init__(self) -> None:
        self._last: dict[tuple[str, ...], tuple[float, float]] = {}

    def of(self, node: str, series: Series) -> Iterator[Report]:
        """Yield the reports of one number in a link's page."""
        link, field = series.path[0].replace("_", " "), series.path[-1]
        if len(series.path) != 2:
            return  # of one peer of many
        if field == "up":
            yield Report("up", f"{link}: up (1) or down (0)", None)
        elif field == "rtt_s":
            round_trip = Series((series.path[0], "round_trip_ms"), series.when, 1000.0 * series.values)
            yield Report("round trip", f"{link}: round trip [ms]", round_trip)
        elif field in COUNTED:
            yield Report(field, f"{link}: pages a second", self._rate(node, series))

    def _rate(self, node: str, series: Series) -> Series:
        """Return the growth of a count per second since the previous page."""
        times_s, counts = series.when.t_s, series.values
        time_s, count = self._last.get((node, *series.path), (times_s[0], counts[0]))
        self._last[node, *series.path] = float(times_s[-1]), float(counts[-1])
        spans_s = np.diff(times_s, prepend=time_s)
        grown = np.diff(counts, prepend=count)
        rates = np.divide(grown, spans_s, out=np.zeros_like(grown), where=spans_s > 1e-6)
        return Series((series.path[0], f"{series.path[1]}_hz"), series.when, rates)


def is_of_link(path: tuple[str, ...]) -> bool:
    """Return whether a number with this path is in the page of a link."""
    return path[0].startswith(LINK_PAGE)
