"""The lab "lunar lander: Q-learning": its reference gets all points, each wrong solution loses those of its mistake.

How sure its reference is of its points (`learning.train` and `fly` over seeds that no test has):

- `lands` asks for 95 of 100: policy.npz landed 10 000 of 10 000 starts; `is_sturdy` asks for 75: it landed 10 000 of
  10 000 in each of its four worlds. So at most 3 in 10 000 fail (95 % sure), and 6 of 100 less than once in 1e11.
- `learns` asks for 80 of 100 from each of four seeds, in one of two trainings. Of 1340 trainings one landed 73, the
  next ones 80, 83 and 84 of 100: so at most 4 in 1000 fail (95 % sure), and a grading less than once in 15 000. (With
  half the steps, and without the mean of the last tables, 3 of 337 failed.)
"""

import json
import pickle
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab.lab import load_lab
from snr_sim.grading.lab.student import Student
from snr_sim.grading.lab.verdicts import Misbehaved
from snr_sim.grading.reports.results import Graded
from snr_sim.learning.q_table import QTable
from snr_sim.scenario.library import load_program
from tests.assignments.lunar_lander_q.mistakes import CHEATS, MISTAKES, WRONG
from tests.assignments.mistakes import write_solution

pytestmark = pytest.mark.usefixtures("warm_children")

LAB = Path(__file__).parents[2] / "assignments" / "10_lunar_lander_q"
GRADER = load_lab(LAB / "checks.py").module("grader.learning")
REFERENCE = Path(__file__).parent / "lunar_lander_q" / "reference"
# Policies that were handed in; the rest of these submissions is the reference.
HANDED_IN = {"policy_file": 5, "lands": 25, "is_sturdy": 10}


def submission(folder: Path, mistake: str = "") -> Path:
    """Write the reference, or a mistake, into a folder."""
    return write_solution(LAB.name, folder, mistake, starter=False)


def graded(folder: Path, secret: bytes | None = None) -> Graded:
    return grade_submission(load_lab(LAB / "checks.py"), folder, secret, "none")


def lost(result: Graded) -> dict[str, float]:
    return {check.name: check.of - check.points for check in result.checks if check.points < check.of}


def told(result: Graded) -> str:
    return "\n".join(f"{case.hint} {case.error}" for check in result.checks for case in check.cases)


def handed_in(folder: Path, secret: bytes | None = None) -> dict[str, Any]:
    """What each check that looks at policy.npz alone says, of all its cases."""
    lab, said = load_lab(LAB / "checks.py"), {}
    for check in lab.checks:
        if check.name in HANDED_IN:
            fractions, words = [], []
            for case in check.cases("10_lunar_lander_q", secret):
                student = Student(folder)
                try:
                    verdict = check.judge(student, case)
                    fractions.append(verdict.fraction)
                    words.append(verdict.hint)
                except Misbehaved as wrong:
                    fractions.append(0.0)
                    words.append(f"{wrong.message} {wrong.hint}")
                finally:
                    student.close()
            said[check.name] = (sum(fractions) / len(fractions), " ".join(words))
    return said


def test_the_reference_gets_all_points_also_of_hidden_cases() -> None:
    result = graded(REFERENCE, b"secret")
    assert (result.status, lost(result), result.points) == ("graded", {}, 100.0)


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_solution_loses_the_points_of_its_mistake_and_is_told_it(name: str, tmp_path: Path) -> None:
    result = graded(submission(tmp_path, name))
    assert result.status == "graded"
    assert lost(result) == WRONG[name].lost
    assert WRONG[name].hint in told(result)


def test_numbers_that_numpy_has_made_are_numbers(tmp_path: Path) -> None:
    file = submission(tmp_path) / "q_lander.py"
    wrapped = "import numpy as np\nSTATES = np.int64(STATES)\n"
    for name, kind in (("encode", "int64"), ("choose", "int32"), ("reward", "float32"), ("epsilon", "float32")):
        wrapped += f"def {name}(*given, own={name}):\n    return np.{kind}(own(*given))\n"
    wrapped += "def update(table, step, own=update):\n    own(table, step)\n"
    for rows, kind in (("values", "float64"), ("visits", "int64")):
        place = f"table.{rows}[step.state][step.action]"
        wrapped += f"    {place} = np.{kind}({place})\n"
    file.write_text(f"{file.read_text()}\n\n{wrapped}")
    result = graded(tmp_path)
    assert (lost(result), told(result).strip()) == ({}, "")


def test_the_kits_own_learning_is_not_imported_and_the_line_is_told(tmp_path: Path) -> None:
    file = submission(tmp_path) / "q_lander.py"
    file.write_text("from snr_sim.learning.tabular import Learner\n" + file.read_text())
    result = graded(tmp_path)
    assert result.points == 40.0  # for policy.npz, which is read and flown here
    assert "q_lander.py, line 1: imports snr_sim.learning.tabular.Learner, but it is this lab, solved." in told(result)


@pytest.mark.parametrize("name", CHEATS)
def test_who_learns_nothing_lands_nothing(name: str, tmp_path: Path) -> None:
    result = graded(submission(tmp_path, name))
    assert result.status == "graded"
    assert lost(result) == CHEATS[name].lost
    assert CHEATS[name].hint in told(result)


def test_a_policy_that_was_trained_on_the_visible_starts_lands_those_alone_and_is_told_so(tmp_path: Path) -> None:
    submission(tmp_path, "trained_on_the_test")
    assert handed_in(tmp_path)["lands"] == (1.0, "")
    share, words = handed_in(tmp_path, b"secret")["lands"]
    assert share < 0.3
    assert MISTAKES["trained_on_the_test"].hint in words


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-900])


def pickled(path: Path) -> None:
    path.write_bytes(pickle.dumps(np.zeros((63, 4))))


def rewritten(path: Path, **changed: Any) -> None:
    with np.load(path) as arrays:
        kept = dict(arrays)
    np.savez_compressed(path, **{**kept, **changed})


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (pickled, "Whoever opens a pickle runs what is in it"),
        (cut, "copy all of it"),
        (lambda path: rewritten(path, values=np.full((7360, 4), np.nan)), "not finite"),
        (lambda path: rewritten(path, values=np.zeros((63, 4))), "is float64 of shape (63, 4)"),
        (lambda path: rewritten(path, more=np.zeros(200_000)), "less than 1000000 bytes"),
        (lambda path: path.write_text("no table"), "no npz file"),
    ],
)
def test_a_policy_that_is_none_is_told_and_loses_what_it_would_have_flown(
    spoil: Any, words: str, tmp_path: Path
) -> None:
    spoil(submission(tmp_path) / "policy.npz")
    said = handed_in(tmp_path)
    assert {name: share for name, (share, _) in said.items()} == dict.fromkeys(HANDED_IN, 0.0)
    assert words in said["policy_file"][1]


def test_an_update_that_makes_rows_longer_is_told_and_is_no_fault_of_the_lab(tmp_path: Path) -> None:
    file = submission(tmp_path) / "q_lander.py"
    file.write_text(
        file.read_text().replace(
            "    expected = 0.0\n", "    table.values[step.state].append(0.0)\n    expected = 0.0\n"
        )
    )
    (check,) = [one for one in load_lab(LAB / "checks.py").checks if one.name == "updates"]
    student = Student(tmp_path)
    try:
        with pytest.raises(Misbehaved, match="larger or smaller"):
            check.judge(student, check.cases("10_lunar_lander_q", None)[0])
    finally:
        student.close()


def test_a_pickle_is_not_opened(tmp_path: Path) -> None:
    class Payload:
        def __reduce__(self) -> tuple[Any, ...]:
            return (Path.touch, (tmp_path / "ran",))

    for data in (pickle.dumps(Payload()), b"PK" + pickle.dumps(Payload())):
        (submission(tmp_path) / "policy.npz").write_bytes(data)
        assert handed_in(tmp_path)["policy_file"][0] == 0.0
    np.savez(tmp_path / "policy.npz", about=np.array([Payload()], object), values=1, visits=1)
    assert "no table of action values" in handed_in(tmp_path)["policy_file"][1]
    assert not (tmp_path / "ran").exists()


def test_without_a_policy_what_the_file_learns_here_flies(tmp_path: Path) -> None:
    (submission(tmp_path) / "policy.npz").unlink()
    said = handed_in(tmp_path)
    assert said["policy_file"][0] == 0.0
    assert said["lands"][0] > 0.9


def test_the_starter_learns_nothing_says_so_and_is_told_what_it_lacks(tmp_path: Path) -> None:
    shutil.copytree(LAB / "starter", tmp_path, dirs_exist_ok=True)
    done = subprocess.run([sys.executable, tmp_path / "learn.py"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "update() has changed nothing yet" in done.stdout
    assert (tmp_path / "curve.svg").read_text().startswith("<svg")
    done = subprocess.run(
        [sys.executable, "-m", "snr_sim", "check", "lunar_lander_q", tmp_path, "--json"], capture_output=True, text=True
    )
    result = json.loads(done.stdout)
    assert done.returncode == 1, done.stderr
    hints = {check["name"]: check["cases"][0].get("hint", "") for check in result["checks"] if check["cases"]}
    assert all("STATES is 1" in hints[name] for name in ("encodes", "lands", "is_sturdy"))
    assert not [case["error"] for check in result["checks"] for case in check["cases"] if case.get("error")]


def test_the_reference_learns_at_home_and_its_policy_flies_in_a_node(tmp_path: Path) -> None:
    shutil.copytree(LAB / "starter", tmp_path, dirs_exist_ok=True)
    shutil.copy(REFERENCE / "q_lander.py", tmp_path)
    done = subprocess.run([sys.executable, tmp_path / "learn.py", "--seed", "2"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    command = done.stdout.splitlines()[-1].split()
    assert command[:4] == ["snr", "run", "lander_vertical", "--seed"]
    flown = subprocess.run(
        [sys.executable, "-m", "snr_sim", *command[1:], "--no-rrd", "--out", tmp_path / "runs"],
        capture_output=True,
        text=True,
    )
    assert flown.returncode == 0, flown.stderr
    (run,) = (tmp_path / "runs").iterdir()
    again = subprocess.run([sys.executable, "-m", "snr_sim", "replay", run, "--check"], capture_output=True, text=True)
    assert again.returncode == 0, again.stdout + again.stderr


def test_a_file_is_trained_alike_apart_and_here_and_training_keeps_to_its_budget() -> None:
    """The student's process knows neither the seeds nor the starts, and gives the same table for the same seed."""
    here = GRADER.Here(load_program(str(REFERENCE / "q_lander.py")))
    student = Student(REFERENCE)
    try:
        apart = student.host("q_lander.py", GRADER.Pilot)
        known = [GRADER.Evidence(one, 7) for one in (here, apart)]
        took = [GRADER.train(one, 7, of, 2560, 10_000) for one, of in zip((here, apart), known, strict=True)]
        assert took[0] == took[1]
        assert took[0].steps == 2560
        assert known[0].ledger.plain() == known[1].ledger.plain()
        assert here.ask("learned") == apart.ask("learned")
        for one in known:
            one.check_update()
        flown = [GRADER.fly(GRADER.ByTable(GRADER.as_policy(one)), 3, 20) for one in known]
        assert flown[0] == flown[1]
        assert here.ask("learned") == apart.ask("learned")
    finally:
        student.close()
    few = GRADER.train(here, 7, None, 10_000_000, GRADER.LANDERS + 50)
    assert GRADER.LANDERS + 50 < few.episodes < 2 * GRADER.LANDERS + 50


@pytest.mark.parametrize(("mean_mps", "is_blamed"), [(2.2, False), (4.0, True)])
def test_crashes_where_most_land_are_not_blamed_on_the_average(mean_mps: float, is_blamed: bool) -> None:
    checks = sys.modules[load_lab(LAB / "checks.py").checks[0].function.__module__]
    flown = GRADER.Flights([True] * 8 + [False] * 2, {"landed": 8, "crashed": 2, "timeout": 0}, 240.0, mean_mps)
    assert ("slow enough, and too many are not" in checks.why_down(flown, None)) is not is_blamed
    assert checks.told(flown) == "8 landed, 2 crashed, 0 timeout"


def test_at_home_the_students_own_choice_and_table_fly_and_not_the_graders(tmp_path: Path) -> None:
    file = submission(tmp_path) / "q_lander.py"
    file.write_text(file.read_text().replace("    return max(tried(table", "    return 0\n    return max(tried(table"))
    here = GRADER.Here(load_program(str(file)))
    GRADER.train(here, 0, most_steps=2560)
    assert GRADER.fly(here, 1, 20).outcomes == {"landed": 0, "crashed": 20, "timeout": 0}


def test_flights_in_the_batch_end_as_those_of_the_scenario(tmp_path: Path) -> None:
    """The same table in the environment that a node's run is equal to, and in the batch: both land."""
    from snr_sim.learning.lander_envs import LanderVertical
    from snr_sim.learning.tabular import evaluate

    table = QTable.load(REFERENCE / "policy.npz")
    ends = evaluate(LanderVertical(), table.act, range(1, 11))
    flights = GRADER.fly(GRADER.ByTable(table), 1, 100)
    assert sum(end["success"] for end in ends) == 10
    assert flights.share == 1.0
    assert GRADER.fly(GRADER.ByTable(table), 1, 100, gravity=3.0, thrust=0.5).share < 0.5
