"""What is no answer at all costs the student points, with a hint, and is never a fault of the first three labs."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab import find_lab

HERE = Path(__file__).parent
HELLO, DEPTH, SMOOTH = "01_hello_thruster", "02_depth_hold", "03_moving_average"

# Of a reference: file, a line in it, and what stands there instead.
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


@pytest.mark.usefixtures("warm_children")
@pytest.mark.parametrize(("name", "file", "line", "nonsense"), NONSENSE)
def test_nonsense_loses_points_and_is_told(name: str, file: str, line: str, nonsense: str, tmp_path: Path) -> None:
    handed_in, lab = tmp_path / "handed_in", find_lab(name)
    shutil.copytree(HERE.parents[1] / "assignments" / name / "starter", handed_in)
    shutil.copytree(HERE / name.partition("_")[2] / "reference", handed_in, dirs_exist_ok=True)
    right = (handed_in / file).read_text()
    assert line in right
    (handed_in / file).write_text(right.replace(line, nonsense))
    lab.checks = tuple(replace(check, visible=check.visible[:1]) for check in lab.checks)
    graded = grade_submission(lab, handed_in, None, "none")
    assert graded.status == "graded", graded.error
    assert graded.points <= 80.0
    assert any(case.hint for check in graded.checks for case in check.cases)
