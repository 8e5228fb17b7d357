"""The lab "lunar lander: Q-learning": its reference gets all points, each wrong solution loses those of its mistake.

How sure its reference is of its points (`learning.train` and `simulate_landings` over seeds that no test has):

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
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab.lab import load_lab
from snr_sim.grading.lab.student import Student
from snr_sim.grading.lab.verdicts import SubmissionError
from snr_sim.grading.reports.results import Graded
from snr_sim.learning.q_table import QTable
from snr_sim.scenario.library import load_program
from tests.assignments.lunar_lander_q.mistakes import CHEATS, MISTAKES, WRONG
from tests.assignments.mistakes import write_solution

pytestmark = pytest.mark.usefixtures("warm_children")

LAB = Path(__file__).parents[2] / "assignments" / "10_lunar_lander_q"
GRADER = load_lab(LAB / "checks.py").module("grader.learning")
CHECKS = load_lab(LAB / "checks.py").module("checks")
REFERENCE = Path(__file__).parent / "lunar_lander_q" / "reference"
# Policies that were handed in; the rest of these submissions is the reference.
HANDED_IN = {"policy_file": 5, "lands": 25, "is_sturdy": 10}


def submission(folder: Path, mistake: str = "") -> Path:
    """Write the reference, or a mistake, into a folder."""
    return write_solution(LAB.name, folder, mistake, starter=False)


def graded(folder: Path, secret: bytes | None = None) -> Graded:
    return grade_submission(load_lab(LAB / "checks.py"), folder, secret, "none")


def lost(result: Graded) -> dict[str, float]:
    return {check.name: check.max_points - check.points for check in result.checks if check.points < check.max_points}


def messages(result: Graded) -> str:
    return "\n".join(f"{case.hint} {case.error}" for check in result.checks for case in check.cases)


def handed_in(folder: Path, secret: bytes | None = None) -> dict[str, Any]:
    """What each check that looks at policy.npz alone says, of all its cases."""
    lab, found = load_lab(LAB / "checks.py"), {}
    for check in lab.checks:
        if check.name in HANDED_IN:
            fractions, words = [], []
            for case in check.cases("10_lunar_lander_q", secret):
                student = Student(folder)
                try:
                    verdict = check.evaluate(student, case)
                    fractions.append(verdict.fraction)
                    words.append(verdict.hint)
                except SubmissionError as wrong:
                    fractions.append(0.0)
                    words.append(f"{wrong.message} {wrong.hint}")
                finally:
                    student.close()
            found[check.name] = (sum(fractions) / len(fractions), " ".join(words))
    return found


def test_reference_gets_all_points_of_hidden_cases() -> None:
    result = graded(REFERENCE, b"secret")
    assert (result.status, lost(result), result.points) == ("graded", {}, 100.0)


@pytest.mark.parametrize("name", WRONG)
def test_mistake_loses_its_points_and_gets_its_hint(name: str, tmp_path: Path) -> None:
    result = graded(submission(tmp_path, name))
    assert result.status == "graded"
    assert lost(result) == WRONG[name].lost
    assert WRONG[name].hint in messages(result)


def test_numpy_numbers_are_accepted(tmp_path: Path) -> None:
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
    assert (lost(result), messages(result).strip()) == ({}, "")


def test_import_of_snr_sim_learning_is_rejected_with_line(tmp_path: Path) -> None:
    file = submission(tmp_path) / "q_lander.py"
    file.write_text("from snr_sim.learning.tabular import TabularLearner\n" + file.read_text())
    result = graded(tmp_path)
    assert result.points == 40.0  # for policy.npz, which is read and simulated here
    assert (
        "q_lander.py, line 1: imports snr_sim.learning.tabular.TabularLearner, but it is this lab, solved."
        in messages(result)
    )


@pytest.mark.parametrize("name", CHEATS)
def test_submission_without_learning_gets_no_landing_points(name: str, tmp_path: Path) -> None:
    result = graded(submission(tmp_path, name))
    assert result.status == "graded"
    assert lost(result) == CHEATS[name].lost
    assert CHEATS[name].hint in messages(result)


def test_policy_overfitted_to_visible_starts_fails_hidden_ones(tmp_path: Path) -> None:
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
    ("corrupt", "words"),
    [
        (pickled, "Loading a pickle can run any code"),
        (cut, "copy all of it"),
        (lambda path: rewritten(path, values=np.full((7360, 4), np.nan)), "not finite"),
        (lambda path: rewritten(path, values=np.zeros((63, 4))), "is float64 of shape (63, 4)"),
        (lambda path: rewritten(path, more=np.zeros(200_000)), "at most 1000000 bytes"),
        (lambda path: path.write_text("no table"), "is not a table of action values"),
    ],
)
def test_invalid_policy_file_is_reported_and_loses_its_points(corrupt: Any, words: str, tmp_path: Path) -> None:
    corrupt(submission(tmp_path) / "policy.npz")
    found = handed_in(tmp_path)
    assert {name: share for name, (share, _) in found.items()} == dict.fromkeys(HANDED_IN, 0.0)
    assert words in found["policy_file"][1]


@given(st.lists(st.tuples(st.integers(0, 2**16), st.integers(0, 255)), max_size=4), st.booleans())
@example([], True)
def test_no_bytes_of_a_policy_are_an_error_of_the_grader(changes: list[tuple[int, int]], is_far: bool) -> None:
    """Changes are at the end, where zip has its directory, or anywhere."""
    data = bytearray((REFERENCE / "policy.npz").read_bytes())
    for place, byte in changes:
        data[-1 - place % (len(data) if is_far else 350)] = byte
    check_rejection(data)


@pytest.mark.parametrize(
    ("places", "byte"), [([6], 100), ([9, 46], 0xFF), ([24, 25, 26, 27], 0xFF)], ids=["version", "name", "size"]
)
def test_directory_of_a_policy_that_zipfile_cannot_read_is_rejected(places: list[int], byte: int) -> None:
    data = bytearray((REFERENCE / "policy.npz").read_bytes())
    for place in places:
        data[data.find(b"PK\x01\x02") + place] = byte
    assert check_rejection(data)


def check_rejection(data: bytes) -> bool:
    """Return whether a policy is rejected; any other error is the grader's own."""
    with TemporaryDirectory() as folder:
        (Path(folder) / "policy.npz").write_bytes(data)
        try:
            CHECKS.policy_of(SimpleNamespace(folder=Path(folder).resolve()))
        except SubmissionError as wrong:
            assert str(folder) not in wrong.message
            return True
    return False


def test_update_that_resizes_rows_is_submission_error(tmp_path: Path) -> None:
    file = submission(tmp_path) / "q_lander.py"
    file.write_text(
        file.read_text().replace(
            "    expected = 0.0\n", "    table.values[step.state].append(0.0)\n    expected = 0.0\n"
        )
    )
    (check,) = [one for one in load_lab(LAB / "checks.py").checks if one.name == "updates"]
    student = Student(tmp_path)
    try:
        with pytest.raises(SubmissionError, match="larger or smaller"):
            check.evaluate(student, check.cases("10_lunar_lander_q", None)[0])
    finally:
        student.close()


def test_pickle_is_not_opened(tmp_path: Path) -> None:
    class Payload:
        def __reduce__(self) -> tuple[Any, ...]:
            return (Path.touch, (tmp_path / "ran",))

    for data in (pickle.dumps(Payload()), b"PK" + pickle.dumps(Payload())):
        (submission(tmp_path) / "policy.npz").write_bytes(data)
        assert handed_in(tmp_path)["policy_file"][0] == 0.0
    np.savez(tmp_path / "policy.npz", about=np.array([Payload()], object), values=1, visits=1)
    assert "is not a table of action values" in handed_in(tmp_path)["policy_file"][1]
    assert not (tmp_path / "ran").exists()


def test_missing_policy_is_replaced_by_trained_one(tmp_path: Path) -> None:
    (submission(tmp_path) / "policy.npz").unlink()
    found = handed_in(tmp_path)
    assert found["policy_file"][0] == 0.0
    assert found["lands"][0] > 0.9


def test_starter_learns_nothing_and_gets_hints(tmp_path: Path) -> None:
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


def test_reference_trains_at_home_and_lands_in_node(tmp_path: Path) -> None:
    shutil.copytree(LAB / "starter", tmp_path, dirs_exist_ok=True)
    shutil.copy(REFERENCE / "q_lander.py", tmp_path)
    done = subprocess.run([sys.executable, tmp_path / "learn.py", "--seed", "2"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    command = done.stdout.splitlines()[-1].split()
    assert command[:4] == ["snr", "run", "lander_vertical", "--seed"]
    ran = subprocess.run(
        [sys.executable, "-m", "snr_sim", *command[1:], "--no-rrd", "--out", tmp_path / "runs"],
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0, ran.stderr
    (run,) = (tmp_path / "runs").iterdir()
    again = subprocess.run([sys.executable, "-m", "snr_sim", "replay", run, "--check"], capture_output=True, text=True)
    assert again.returncode == 0, again.stdout + again.stderr


def test_training_in_child_equals_local_and_keeps_budget() -> None:
    """The student's process knows neither the seeds nor the starts, and gives the same table for the same seed."""
    here = GRADER.LocalSubmission(load_program(str(REFERENCE / "q_lander.py")))
    student = Student(REFERENCE)
    try:
        apart = student.create_object("q_lander.py", GRADER.StudentPolicy)
        known = [GRADER.Evidence(one, 7) for one in (here, apart)]
        took = [GRADER.train(one, 7, of, 2560, 10_000) for one, of in zip((here, apart), known, strict=True)]
        assert took[0] == took[1]
        assert took[0].steps == 2560
        assert known[0].reference.plain() == known[1].reference.plain()
        assert here.ask("table_rows") == apart.ask("table_rows")
        for one in known:
            one.check_update()
        stats = [GRADER.simulate_landings(GRADER.TablePolicy(GRADER.policy_table(one)), 3, 20) for one in known]
        assert stats[0] == stats[1]
        assert here.ask("table_rows") == apart.ask("table_rows")
    finally:
        student.close()
    few = GRADER.train(here, 7, None, 10_000_000, GRADER.LANDERS + 50)
    assert GRADER.LANDERS + 50 < few.episodes < 2 * GRADER.LANDERS + 50


@pytest.mark.parametrize(("mean_mps", "is_blamed"), [(2.2, False), (4.0, True)])
def test_crash_hint_blames_mean_speed_only_above_limit(mean_mps: float, is_blamed: bool) -> None:
    checks = sys.modules[load_lab(LAB / "checks.py").checks[0].function.__module__]
    stats = GRADER.LandingStats([True] * 8 + [False] * 2, {"landed": 8, "crashed": 2, "timeout": 0}, 240.0, mean_mps)
    assert ("slow enough, but too many landings are not" in checks.crash_hint(stats, None)) is not is_blamed
    assert checks.outcome_text(stats) == "8 landed, 2 crashed, 0 timeout"


def test_local_run_uses_functions_and_table_of_student(tmp_path: Path) -> None:
    file = submission(tmp_path) / "q_lander.py"
    file.write_text(file.read_text().replace("    return max(tried(table", "    return 0\n    return max(tried(table"))
    here = GRADER.LocalSubmission(load_program(str(file)))
    GRADER.train(here, 0, max_steps=2560)
    assert GRADER.simulate_landings(here, 1, 20).outcomes == {"landed": 0, "crashed": 20, "timeout": 0}


def test_batch_landings_equal_scenario(tmp_path: Path) -> None:
    """The same table in the environment that a node's run is equal to, and in the batch: both land."""
    from snr_sim.learning.lander_envs import LanderVertical
    from snr_sim.learning.tabular import evaluate

    table = QTable.load(REFERENCE / "policy.npz")
    ends = evaluate(LanderVertical(), table.act, range(1, 11))
    flights = GRADER.simulate_landings(GRADER.TablePolicy(table), 1, 100)
    assert sum(end["success"] for end in ends) == 10
    assert flights.share == 1.0
    assert GRADER.simulate_landings(GRADER.TablePolicy(table), 1, 100, gravity=3.0, thrust=0.5).share < 0.5
