"""docs/tour.md shows the functions that a run really passes, and its walks are short."""

from collections.abc import Callable

import pytest

from tests.tour import PAGE, Walk, check_of_a_lab, page, page_of_data, radar_reading, stick, stored_page

PLANT_AND_REFEREE = ("snr_sim/plants/", "robots/lander/evaluation.py", "snr_sim/scenario/student_calls.py")


def files_of(walk: Walk) -> set[str]:
    return {file for file, _, _ in walk.steps.values()}


def test_tour_of_data_is_what_a_run_shows() -> None:
    assert PAGE.read_text(encoding="utf-8").startswith(page_of_data()), "python tests/tour.py --write"


@pytest.mark.slow
def test_tour_is_what_runs_show() -> None:
    assert page() == PAGE.read_text(encoding="utf-8"), "python tests/tour.py --write"


@pytest.mark.parametrize(("walk", "at_most"), [(stored_page, 6), (radar_reading, 21), (stick, 25)])
def test_walk_is_in_few_files(walk: Callable[[], Walk], at_most: int) -> None:
    assert len(files_of(walk())) <= at_most


def test_radar_reading_without_plant_and_referee_is_in_few_files() -> None:
    assert len([file for file in files_of(radar_reading()) if not file.startswith(PLANT_AND_REFEREE)]) <= 16


@pytest.mark.slow
def test_check_of_a_lab_is_in_few_files() -> None:
    assert len(files_of(check_of_a_lab())) <= 60
