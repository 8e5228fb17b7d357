"""Nonsensical answers cost the student points, with a hint, and never cause an error of the lab or the grader.

Three kinds of nonsense in each page are tried in the quick checks of its lab; in nightly, all kinds in all checks.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab.lab import Lab, find_lab
from snr_sim.grading.reports.results import decode_graded, encode_graded
from tests.assignments.mistakes import replace as replace_text
from tests.assignments.mistakes import write_solution

HELLO, DEPTH, SMOOTH = "01_hello_thruster", "02_depth_hold", "03_moving_average"

# Of a reference: file, a line in it, and its replacement.
NONSENSE = [
    (HELLO, "hello_thruster.py", "    return pulses\n", "    return [10**400] * 8\n"),
    (HELLO, "hello_thruster.py", "    return pulses\n", "    return [float('nan')] * 8\n"),
    (HELLO, "hello_thruster.py", "    return pulses\n", "    return {'a': 1}\n"),
    (DEPTH, "depth_hold.py", "            pulses = pulses_us(", "            pulses = [10**400] * 8 or ("),
    (DEPTH, "depth_hold.py", "            pulses = pulses_us(", "            pulses = None and ("),
    (DEPTH, "depth_hold.py", "    error_m = depth_m - goal_m", "    return 10**400\n    error_m = 0.0"),
    (SMOOTH, "smooth.py", '"altitude_m": altitude_m', '"altitude_m": [10**400]'),
    (SMOOTH, "smooth.py", "    return [average", "    return 'smooth' or [average"),
    (SMOOTH, "my_tests.py", '"length": 2', '"length": 10**400'),
    (SMOOTH, "my_tests.py", "[1.0, 1.5, 3.0, 4.0]", '[1.0, float("nan"), "x", 10**400]'),
    (SMOOTH, "my_tests.py", "    return [", "    return 5 or ["),
]


# Replacements of a page's data, made of its key, its data and the name of one of its fields.
KINDS = {
    "no field": "data = {name: value for name, value in data.items() if name != field}",
    "another name": "data = {name + 'x': value for name, value in data.items()}",
    "none": "data = None",
    "text": "data = 'x'",
    "list": "data = [1.0]",
    "field none": "data = {**data, field: None}",
    "field text": "data = {**data, field: 'x'}",
    "field list": "data = {**data, field: []}",
    "field number": "data = {**data, field: 1500.0}",
    "field huge": "data = {**data, field: [10**400] * 8 if isinstance(data[field], list) else 10**400}",
    "field nan": "data = {**data, field: float('nan')}",
    "another key": "key += 'x'",
    "ends the run": "return _tasks.terminate('won')",
}
STORES = """
from snr_sim import Endpoint as _Endpoint, tasks as _tasks
def _nonsense(store):
    def stored(self, key, data, *more, **named):
        field = FIELD
        if key == KEY:
            DOES
        return store(self, key, data, *more, **named)
    return stored
_Endpoint.store_data_task = _nonsense(_Endpoint.store_data_task)
"""
# Lab, file, page, a field of it, the quick check that asks for it, and others that read it.
PAGES = [
    (HELLO, "hello_thruster.py", "pwm", "pulses_us", "heave", ["surge", "rest", "limits", "disarmed", "dives"]),
    (DEPTH, "depth_hold.py", "pwm", "pulses_us", "keeps_goal", ["disarmed", "holds"]),
    (SMOOTH, "smooth.py", "smooth", "altitude_m", "in_the_node", ["lands"]),
    ("04_pub_sub_graph", "heading.py", "turn", "moment_nm", "heading_alone", ["in_any_order", "holds_heading"]),
    ("04_pub_sub_graph", "depth.py", "lift", "force_n", "depth_alone", ["in_any_order", "holds_heading"]),
    ("04_pub_sub_graph", "mixer.py", "pwm", "pulses_us", "mixer_alone", ["in_any_order", "holds_heading"]),
    ("04_pub_sub_graph", "gentle.py", "turn", "moment_nm", "dropped_in", []),
    (
        "05_mission_state_machine",
        "mission.py",
        "mission",
        "state",
        "recovers",
        ["check_controls", "arrows", "runs_mission"],
    ),
    ("05_mission_state_machine", "mission.py", "mission", "since_s", "", ["arrows"]),
    ("05_mission_state_machine", "mission.py", "controls", "is_armed", "check_controls", ["stops", "runs_mission"]),
    ("06_perception_drop_in", "perception.py", "target", "right_px", "answers", ["clear", "lost", "hovers"]),
    ("07_two_nodes", "two_nodes.py", "pwm", "pulses_us", "vehicle_alone", ["late", "cut"]),
    ("07_two_nodes", "two_nodes.py", "controls", "surge", "surface_alone", ["late", "gone"]),
    ("07_two_nodes", "two_nodes.py", "alarm", "state", "", ["watches"]),
    ("08_sim_to_pi", "depth_hold.py", "pwm", "pulses_us", "limits", ["stale", "stop", "holds", "holds_on_the_board"]),
]
NUMBERS = {"altitude_m", "moment_nm", "force_n", "since_s", "right_px", "surge"}  # among the fields


def tried() -> list[Any]:
    """Return lab, check, file, page, field and kind of nonsense: three kinds for each page in turn, others nightly."""
    found = []
    for number, (lab, file, key, field, quick, more) in enumerate(PAGES):
        kinds = [kind for kind in KINDS if kind != "field number" or field not in NUMBERS]
        few = [kinds[(3 * number + i) % len(kinds)] for i in range(3)]
        for check in filter(None, [quick, *more]):
            for kind in kinds:
                marks = [] if check == quick and kind in few else [pytest.mark.nightly]
                found.append(pytest.param(lab, check, file, key, field, kind, marks=marks))
    return found


def of_one_case(name: str, *names: str) -> Lab:
    """A lab with these checks alone, each with its first visible case."""
    lab = find_lab(name)
    lab.checks = tuple(replace(one, visible=one.visible[:1], needs=()) for one in lab.checks if one.name in names)
    return lab


@pytest.mark.usefixtures("warm_children")
@pytest.mark.parametrize(("name", "check", "file", "key", "field", "kind"), tried())
def test_nonsense_page_fails_case_with_hint_of_check(
    name: str, check: str, file: str, key: str, field: str, kind: str, tmp_path: Path
) -> None:
    folder = write_solution(name, tmp_path / "handed_in")
    program = STORES.replace("DOES", KINDS[kind]).replace("KEY", repr(key)).replace("FIELD", repr(field))
    with (folder / file).open("a") as opened:
        opened.write(program)
    graded = grade_submission(of_one_case(name, check), folder, None, "none")
    assert graded.status == "graded", graded.error
    assert graded.faults == []
    (case,) = graded.checks[0].cases
    assert case.hint or case.is_passed
    # Others may do without the page: a landing may succeed by other pages.
    assert graded.points == 0.0 or check not in [row[4] for row in PAGES]
    assert decode_graded(encode_graded(graded)) == graded


@pytest.mark.usefixtures("warm_children")
@pytest.mark.parametrize(
    ("name", "check", "file", "more", "feedback"),
    [
        ("04_pub_sub_graph", "holds_heading", "graph.py", "x = (", "read"),
        ("04_pub_sub_graph", "apart", "heading.py", "x = (", "heading.py could not be parsed"),
        ("09_debug_by_replay", "diverges", "findings.toml", "x = =", "look at the line named"),
        ("10_lunar_lander_q", "encodes", "q_lander.py", "def encode(h, v): return 10**400", ""),
        ("10_lunar_lander_q", "encodes", "q_lander.py", "STATES = None", ""),
        ("10_lunar_lander_q", "chooses", "q_lander.py", "def choose(*a): return []", ""),
        ("10_lunar_lander_q", "updates", "q_lander.py", "def update(t, s): t.values[s.state] = 'x'", "Rows"),
        ("10_lunar_lander_q", "updates", "q_lander.py", "def update(t, s): t.values[s.state][0] = 10**400", "Rows"),
        ("10_lunar_lander_q", "updates", "q_lander.py", "def update(t, s): t.visits.clear()", "do not append"),
        ("11_write_the_queue", "keeps_order", "task_queue.py", "TaskQueue.put = lambda *a: 10**400", ""),
        ("11_write_the_queue", "drives_a_node", "task_queue.py", "TaskQueue.take = lambda *a: 'x'", ""),
        ("11_write_the_queue", "keeps_order", "task_queue.py", "TaskQueue = None", ""),
    ],
)
def test_nonsense_file_fails_case(name: str, check: str, file: str, more: str, feedback: str, tmp_path: Path) -> None:
    folder = write_solution(name, tmp_path / "handed_in")
    with (folder / file).open("a") as opened:
        opened.write(f"\n{more}\n")
    graded = grade_submission(of_one_case(name, check), folder, None, "none")
    assert (graded.status, graded.faults) == ("graded", []), graded.error
    assert graded.points == 0.0
    assert graded.checks[0].cases[0].hint
    assert feedback in graded.checks[0].cases[0].hint


@pytest.mark.usefixtures("warm_children")
@pytest.mark.parametrize(("name", "file", "line", "nonsense"), NONSENSE)
def test_nonsense_loses_points_and_is_reported(name: str, file: str, line: str, nonsense: str, tmp_path: Path) -> None:
    lab = find_lab(name)
    folder = write_solution(name, tmp_path / "handed_in")
    replace_text(file, line, nonsense)(folder)
    lab.checks = tuple(replace(check, visible=check.visible[:1]) for check in lab.checks)
    graded = grade_submission(lab, folder, None, "none")
    assert graded.status == "graded", graded.error
    assert graded.points <= 80.0
    assert any(case.hint for check in graded.checks for case in check.cases)
