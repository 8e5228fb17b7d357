"""docs/tour.md shows the functions that a run really passes."""

from tests.tour import PAGE, page, stored_page


def test_tour_is_what_a_run_shows() -> None:
    assert page() == PAGE.read_text(encoding="utf-8"), "python tests/tour.py --write"


def test_life_of_a_stored_page_is_in_six_files() -> None:
    assert len({file for file, _, _ in stored_page().steps.values()}) <= 6
