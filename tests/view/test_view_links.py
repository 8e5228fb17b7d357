"""Plots of a link's page."""

from __future__ import annotations

import numpy as np
import pytest

from snr_sim.recording.columns import Series, When
from snr_sim.view.view_links import LinkReports, is_of_link


def series(field: str, times_s: list[float], values: list[float], key: str = "link_tether") -> Series:
    return Series((key, field), When(np.arange(len(times_s)), np.array(times_s)), np.array(values))


def test_counts_become_rates_across_batches() -> None:
    reports = LinkReports()
    ((first),) = reports.of("urov", series("sent", [1.0, 2.0, 4.0], [10.0, 30.0, 90.0]))
    ((second),) = reports.of("urov", series("sent", [5.0, 5.0], [140.0, 140.0]))
    assert first.series is not None
    assert second.series is not None
    assert first.series.values.tolist() == [0.0, 20.0, 30.0]
    assert second.series.values.tolist() == [50.0, 0.0]
    assert first.plot == "link tether: pages a second"


def test_link_ends_are_counted_separately() -> None:
    reports = LinkReports()
    list(reports.of("urov", series("received", [1.0], [100.0])))
    ((report),) = reports.of("topside", series("received", [1.0, 2.0], [7.0, 8.0]))
    assert report.series is not None
    assert report.series.values.tolist() == [0.0, 1.0]


def test_round_trip_is_in_milliseconds_and_up_is_unchanged() -> None:
    reports = LinkReports()
    ((trip),) = reports.of("urov", series("rtt_s", [1.0], [0.0075]))
    ((up),) = reports.of("urov", series("up", [1.0], [1.0]))
    assert trip.series is not None
    assert trip.series.values.tolist() == pytest.approx([7.5])
    assert trip.plot.endswith("[ms]")
    assert up.series is None
    assert len({trip.plot, up.plot}) == 2


def test_peer_fields_and_other_pages_have_no_report() -> None:
    peer = Series(("link_tether", "peers", "topside", "rtt_s"), When(np.zeros(1), np.zeros(1)), np.zeros(1))  # type: ignore[arg-type]
    assert list(LinkReports().of("urov", peer)) == []
    assert is_of_link(peer.path)
    assert not is_of_link(("linked", "up"))
