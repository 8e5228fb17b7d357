"""Plots of a link's page."""

from __future__ import annotations

import numpy as np
import pytest

from snr_sim.recording.columns import Series, When
from snr_sim.view.view_links import LinkReports, is_of_link


def series(field: str, times_s: list[float], values: list[float], key: str = "link_tether") -> Series:
    return Series((key, field), When(np.arange(len(times_s)), np.array(times_s)), np.array(values))


def test_counts_become_rates_also_from_one_batch_to_the_next() -> None:
    reports = LinkReports()
    ((first),) = reports.of("urov", series("sent", [1.0, 2.0, 4.0], [10.0, 30.0, 90.0]))
    ((second),) = reports.of("urov", series("sent", [5.0, 5.0], [140.0, 140.0]))
    assert first.series is not None
    assert second.series is not None
    assert first.series.values.tolist() == [0.0, 20.0, 30.0]
    assert second.series.values.tolist() == [50.0, 0.0]
    assert first.plot == "link tether: pages a second"


def test_the_two_ends_of_a_link_are_counted_apart() -> None:
    reports = LinkReports()
    list(reports.of("urov", series("received", [1.0], [100.0])))
    ((told),) = reports.of("topside", series("received", [1.0, 2.0], [7.0, 8.0]))
    assert told.series is not None
    assert told.series.values.tolist() == [0.0, 1.0]


def test_a_round_trip_is_told_in_milliseconds_and_up_as_it_is() -> None:
    reports = LinkReports()
    ((trip),) = reports.of("urov", series("rtt_s", [1.0], [0.0075]))
    ((up),) = reports.of("urov", series("up", [1.0], [1.0]))
    assert trip.series is not None
    assert trip.series.values.tolist() == pytest.approx([7.5])
    assert trip.plot.endswith("[ms]")
    assert up.series is None
    assert len({trip.plot, up.plot}) == 2


def test_what_a_link_says_of_one_peer_and_other_pages_have_no_report() -> None:
    peer = Series(("link_tether", "peers", "topside", "rtt_s"), When(np.zeros(1), np.zeros(1)), np.zeros(1))  # type: ignore[arg-type]
    assert list(LinkReports().of("urov", peer)) == []
    assert is_of_link(peer.path)
    assert not is_of_link(("linked", "up"))
