"""The reference of every lab gets all points of the cases that students see.

A flight takes a second: of a lab with several, one kind runs in the fast lane and the others in the slow one.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

LABS = sorted(path.parent.name for path in (Path(__file__).parents[2] / "assignments").glob("*/checks.py"))

SLOW_CHECKS: dict[str, tuple[str, ...]] = {
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
    "14_odometry": ("square",),
}


@pytest.mark.fast  # although `mark` keeps one process for all cases of the session, which are forks of it
@pytest.mark.parametrize("lab", LABS)
def test_reference_gets_all_points_of_visible_cases(
    lab: str, mark: Callable[..., Any], leave_out: Callable[..., None]
) -> None:
    leave_out(*SLOW_CHECKS.get(lab, ()))
    result = mark(lab)
    assert result.lost == {}, result.feedback


# Those that no test of the lab tries with the same visible cases, and others: at night, all of labs 8, 12 and 13.
@pytest.mark.unmeasured
@pytest.mark.parametrize(
    ("lab", "checks"),
    [
        ("05_mission_state_machine", SLOW_CHECKS["05_mission_state_machine"]),
        ("07_two_nodes", SLOW_CHECKS["07_two_nodes"]),
        ("13_two_processes", ("finds", "clears_by_stereo", "slow_and_explained")),
        ("14_odometry", SLOW_CHECKS["14_odometry"]),
    ],
)
def test_reference_gets_all_points_of_slow_visible_cases(
    lab: str, checks: tuple[str, ...], mark: Callable[..., Any], try_only: Callable[..., None]
) -> None:
    try_only(*checks)
    result = mark(lab)
    assert result.lost == {}, result.feedback
