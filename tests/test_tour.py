"""docs/tour.md shows the functions that a run really passes."""

from collections.abc import Callable

import pytest

from tests.tour import PAGE, Walk, page, radar_reading, stick, stored_page


def test_tour_is_what_a_run_shows() -> None:
    assert page() == PAGE.read_text(encoding="utf-8"), "python tests/tour.py --write"


@pytest.mark.parametrize(("walk", "at_most"), [(stored_page, 6), (radar_reading, 21), (stick, 25)])
def test_walk_is_in_few_files(walk: Callable[[], Walk], at_most: int) -> None:
    assert len({file for file, _, _ in walk().steps.values()}) <= at_most
