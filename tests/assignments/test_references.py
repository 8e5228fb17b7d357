"""The reference of every lab gets all points of the cases that students see.

A flight takes a second: of a lab with several, one kind runs in the fast lane and the others in the slow one.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

LABS = sorted(path.parent.name for path in (Path(__file__).parents[2] / "assignments").glob("*/checks.py"))

SLOW_CHECKS = {
    "05_mission_state_machine": ("stops_in_the_water",),
    "07_two_nodes": ("lost_and_overtaken", "late", "narrow", "gone", "watches"),
    "12_live_programming": ("explores", "explores_late", "replays"),
    "08_sim_to_pi": ("holds_on_the_board",),  # it needs the emulators, too
    "13_two_processes": (
        "finds",
        "follows_states",
        "all_together",
        "events_once",
        "clears_by_stereo",
        "clears_by_lidar",
        "slow_and_explained",
    ),
}


@pytest.mark.fast  # although `mark` keeps one process for all cases of the session, which are forks of it
@pytest.mark.parametrize("lab", LABS)
def test_reference_gets_all_points_of_visible_cases(
    lab: str, mark: Callable[..., Any], leave_out: Callable[..., None]
) -> None:
    leave_out(*SLOW_CHECKS.get(lab, ()))
    result = mark(lab)
    assert result.lost == {}, result.feedback


@pytest.mark.unmeasured
@pytest.mark.parametrize(
    "lab",
    [
        # Its slow checks take 13 s of CPU time, and most are among the hidden cases that are tried.
        pytest.param(one, marks=pytest.mark.nightly) if one == "12_live_programming" else one
        for one in SLOW_CHECKS
    ],
)
def test_reference_gets_all_points_of_every_visible_case(
    lab: str, mark: Callable[..., Any], request: pytest.FixtureRequest
) -> None:
    if "holds_on_the_board" in SLOW_CHECKS[lab]:
        request.getfixturevalue("emulators")
    result = mark(lab)
    assert result.lost == {}, result.feedback
