"""Labs: definitions are checked when they are read; hidden cases come from the secret; points are shared."""

import logging
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from snr_sim.grading import Lab, Student, Verdict, check, failed, partly, passed
from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab.lab import find_lab, load_lab
from snr_sim.grading.lab.verdicts import LabFault, Misbehaved
from snr_sim.grading.remote.sent_code import sent
from snr_sim.grading.reports.results import Graded
from snr_sim.grading.reports.told import as_text
from snr_sim.prelude.errors import UnknownName


@dataclass(frozen=True)
class Start:
    start_m: float
    goal_m: float


def draw(rng: random.Random) -> list[int]:
    return [rng.randrange(10**9) for _ in range(3)]


@check(points=100, visible=[1, 2], hidden=draw)
def doubles(student: Student, case: int) -> Verdict:
    """Doubles.

    More words.
    """
    got = student.call("mine.py", "double", case, returns=int)
    return passed(metrics={"got": got}) if got == 2 * case else failed("Twice.", expected=str(2 * case))


def graded(folder: Path, source: str, *checks: object, secret: bytes | None = None, points: float = 100.0) -> Graded:
    (folder / "mine.py").write_text(source)
    lab = Lab("Small", files=["mine.py"], checks=checks)  # type: ignore[arg-type]
    return grade_submission(lab, folder, secret, "none")


def test_points_must_sum_to_a_hundred_and_needs_come_before() -> None:
    one = check(points=60)(lambda student: passed())
    with pytest.raises(LabFault, match="give 60 points"):
        Lab("Small", files=[], checks=[one])
    late = check(points=40, needs=["doubled"])(doubles.function)
    with pytest.raises(LabFault, match="needs 'doubled', which does not come before it"):
        Lab("Small", files=[], checks=[one, late])


def test_a_case_is_called_by_its_fields_its_label_or_what_the_check_calls_its_number() -> None:
    one = check(points=100, visible=[Start(1.0, 3.0), 7])(doubles.function)
    assert [case.label for case in one.cases("small", None)] == ["start 1 m, goal 3 m", "case 7"]
    assert one.title == "Doubles."


def test_hidden_cases_are_the_same_for_the_same_secret_and_differ_by_secret_lab_and_check() -> None:
    def hidden(lab: str, secret: bytes) -> list[int]:
        return [case.value for case in doubles.cases(lab, secret) if not case.is_visible]

    assert hidden("small", b"a") == hidden("small", b"a")
    assert len({tuple(hidden(lab, secret)) for lab in ("small", "large") for secret in (b"a", b"b")}) == 4
    other = check(points=100, hidden=draw)(passed)
    assert [case.value for case in other.cases("small", b"a")] != hidden("small", b"a")


@pytest.mark.slow
def test_the_grader_tries_hidden_cases_and_practice_does_not(tmp_path: Path) -> None:
    by_heart = "def double(x):\n    return {1: 2, 2: 4}.get(x, 0)"
    assert graded(tmp_path, by_heart, doubles).points == 100.0
    official = graded(tmp_path, by_heart, doubles, secret=b"s")
    assert official.points == 40.0
    assert [case.is_visible for case in official.checks[0].cases] == [True, True, False, False, False]
    assert official.is_hidden_included


@pytest.mark.slow
def test_the_same_submission_lab_and_secret_give_the_same_result(tmp_path: Path) -> None:
    source = "import random\ndef double(x):\n    print({'a', 'b', 'c'})\n    return 2 * x"
    assert graded(tmp_path, source, doubles, secret=b"s") == graded(tmp_path, source, doubles, secret=b"s")


def test_a_part_of_a_case_gives_a_part_of_its_points_unless_all_or_nothing(tmp_path: Path) -> None:
    def half(student: Student, case: int) -> Verdict:
        return partly(0.5, "Half.") if case else passed()

    shared = check(points=50, visible=[0, 1])(half)
    whole = check(points=50, visible=[0, 1], all_or_nothing=True)(half)
    with pytest.raises(LabFault, match="Two checks are called 'half'"):
        graded(tmp_path, "", shared, whole)
    half.__name__ = "other"
    both = graded(tmp_path, "", shared, check(points=50, visible=[0, 1], all_or_nothing=True)(lambda s, c: half(s, c)))
    assert [one.points for one in both.checks] == [37.5, 0.0]


def test_a_check_that_needs_another_is_not_tried_without_it(tmp_path: Path) -> None:
    @check(points=50)
    def first(student: Student) -> Verdict:
        """Stands still."""
        return failed("No.")

    @check(points=50, needs=["first"])
    def second(student: Student) -> Verdict:
        raise AssertionError

    result = graded(tmp_path, "", first, second)
    assert result.points == 0.0
    assert result.checks[1].skipped_because == "'Stands still' comes first, and did not get all its points."


def test_what_components_of_a_flight_warn_of_is_not_shown_and_afterwards_is(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    @check(points=100)
    def flies(student: Student) -> Verdict:
        logging.getLogger("snr.urov.link_tether").warning("link_tether is down")
        return passed()

    assert graded(tmp_path, "", flies).points == 100.0
    assert caplog.messages == []
    logging.getLogger("snr.urov.link_tether").warning("up")
    assert caplog.messages == ["up"]


@pytest.mark.slow
def test_practice_leaves_out_what_has_hidden_cases_only_and_does_not_wait_for_it(tmp_path: Path) -> None:
    hidden = check(points=50, hidden=draw)(doubles.function)

    @check(points=50, needs=["doubles"])
    def after(student: Student) -> Verdict:
        return passed()

    practice = graded(tmp_path, "", hidden, after)
    assert [(one.name, one.points) for one in practice.checks] == [("after", 50.0)]
    official = graded(tmp_path, "", hidden, after, secret=b"s")
    assert [one.points for one in official.checks] == [0.0, 0.0]


def test_a_check_that_draws_no_case_is_a_fault_of_the_lab(tmp_path: Path) -> None:
    empty = check(points=100, hidden=lambda rng: [])(doubles.function)
    assert "The check 'doubles' has no case" in graded(tmp_path, "", empty, secret=b"s").error


def test_a_check_that_fails_by_itself_is_no_mark_and_not_the_students_fault(tmp_path: Path) -> None:
    @check(points=100)
    def wrong(student: Student) -> Verdict:
        return passed(metrics={"one": 1 / 0})

    result = graded(tmp_path, "", wrong)
    assert (result.status, result.points, result.checks) == ("fault", None, ())
    assert "ZeroDivisionError" in result.error
    assert "check 'wrong'" in result.error


@pytest.mark.slow
@pytest.mark.parametrize(
    "judge",
    [
        lambda got: passed() if got["moment_nm"] < 1.0 else failed("Turn less."),
        lambda got: passed(metrics={"moment_nm": got["moment"]}),
        lambda got: None,
    ],
)
def test_what_a_check_cannot_judge_is_zero_for_that_case_and_only_the_instructor_sees_where(
    judge: Callable[[Any], Verdict], tmp_path: Path
) -> None:
    @check(points=60, visible=[1], hidden=lambda rng: [2])
    def turns(student: Student, case: int) -> Verdict:
        return judge(student.call("mine.py", "turn", case, finite=False))

    @check(points=40)
    def answers(student: Student) -> Verdict:
        return passed() if student.call("mine.py", "turn", 1, finite=False) else failed("Turn.")

    result = graded(tmp_path, "def turn(x):\n    return {'moment': float('nan')}", turns, answers, secret=b"s")
    assert (result.status, result.points) == ("graded", 40.0)
    for case in result.checks[0].cases:
        assert case.hint.startswith("What mine.py gave could not be judged.")
        assert "lab.py, line" in case.fault
    assert len(result.faults) == 2
    told = as_text(result.checks[0])
    assert "What mine.py gave could not be judged." in told
    assert "test_lab.py" not in told
    assert told.count("It stopped the check") == 1, "of the hidden case nothing but the hint is told"


@pytest.mark.slow
def test_a_grader_without_memory_or_disk_is_no_fault_of_the_students(tmp_path: Path) -> None:
    @check(points=100)
    def wrong(student: Student) -> Verdict:
        raise OSError(student.call("mine.py", "double", 28))

    assert graded(tmp_path, "def double(x):\n    return x", wrong).status == "fault"


def test_a_check_that_returns_no_verdict_is_a_fault_of_the_lab(tmp_path: Path) -> None:
    @check(points=100)
    def wrong(student: Student) -> Verdict:
        return True  # type: ignore[return-value]

    assert "returned True, which is no Verdict" in graded(tmp_path, "", wrong).error


@pytest.mark.slow
def test_each_case_has_a_fresh_process(tmp_path: Path) -> None:
    source = "seen = []\ndef double(x):\n    seen.append(x)\n    return 2 * x if len(seen) == 1 else 0"
    assert graded(tmp_path, source, doubles, secret=b"s").points == 100.0


def test_a_lab_is_found_by_its_name_with_or_without_its_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "assignments" / "03_small"
    folder.mkdir(parents=True)
    (folder / "README.md").write_text("# Small\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UnknownName, match="'03_small' has no checks"):
        find_lab("small")
    (folder / "checks.py").write_text(
        "from snr_sim.grading import Lab, check, passed\n"
        "lab = Lab('Small', files=[], checks=[check(points=100)(lambda student: passed())])\n"
    )
    assert find_lab("small").name == find_lab("03_small").name == find_lab(str(folder)).name == "03_small"
    with pytest.raises(UnknownName, match="There is no assignment 'smal'"):
        find_lab("smal")


def lab_with_a_bench(folder: Path, word: str) -> Lab:
    """Write a lab called "benched" that has a grader's module of its own."""
    (folder / "benched" / "grader").mkdir(parents=True)
    (folder / "benched" / "grader" / "bench.py").write_text(
        f"class Bench:\n    def __init__(self, module): self.module = module\n"
        f"    def word(self): return '{word} ' + self.module.WORD\n"
        "def size(data): return len(data)\n"
    )
    checks = folder / "benched" / "checks.py"
    checks.write_text(
        "from snr_sim.grading import Lab, check, passed\nfrom .grader.bench import Bench\n"
        "lab = Lab('Benched', [], [check(points=100)(lambda student: passed())])\n"
    )
    return load_lab(checks)


@pytest.mark.slow
def test_class_of_a_lab_runs_in_a_process_that_cannot_find_the_lab(tmp_path: Path) -> None:
    lab = lab_with_a_bench(tmp_path, "own")
    submission = tmp_path / "submission"
    submission.mkdir()
    (submission / "mine.py").write_text(
        "import sys\ntry:\n    from snr_sim_lab_benched import checks\nexcept ImportError as error:\n"
        "    WORD = error.name\nSEEN = [name for name in sys.modules if 'benched' in name]\n"
        "def seen(): return SEEN\n"
    )
    module = lab.module("grader.bench")
    with Student(submission) as student:
        with pytest.raises(Misbehaved, match="a submission does not grade itself"):
            student.host("mine.py", module.Bench)
        assert student.parse("mine.py", module.size) == (submission / "mine.py").stat().st_size
    hidden = (submission / "mine.py").read_text().replace("from snr_sim_lab_benched import checks", "exec(IMPORT)")
    (submission / "mine.py").write_text("IMPORT = 'from snr_sim' + '_lab_benched import checks'\n" + hidden)
    with Student(submission) as student:
        assert student.host("mine.py", module.Bench).ask("word", returns=str) == "own snr_sim_lab_benched"
        assert student.call("mine.py", "seen") == ["snr_sim_lab_benched.grader.bench"]


def test_labs_of_one_name_in_two_folders_have_each_its_own_grader(tmp_path: Path) -> None:
    for word in ("first", "second"):
        bench = lab_with_a_bench(tmp_path / word, word).module("grader.bench")
        assert bench.Bench(SimpleNamespace(WORD="")).word() == f"{word} "


def test_only_a_module_below_a_labs_folder_is_sent() -> None:
    with pytest.raises(LabFault, match="SimpleNamespace of types cannot be sent"):
        sent(SimpleNamespace)


@pytest.mark.parametrize(("text", "told"), [("lab = 3", "has no `lab`"), ("x = 1 / 0", "ZeroDivisionError")])
def test_checks_that_cannot_be_read_are_a_fault_of_the_lab(text: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "checks.py").write_text(text)
    with pytest.raises(LabFault, match=told):
        load_lab(tmp_path / "checks.py")


@pytest.mark.parametrize("leaderboard", [{"land.fuel_kg": "asc"}, {"lands.fuel_kg": "least"}, {"fuel_kg": "asc"}])
def test_a_leaderboard_ranks_what_a_check_measures(leaderboard: dict[str, Any]) -> None:
    @check(points=100)
    def lands(student: Student) -> Verdict:
        return passed(metrics={"fuel_kg": 3.0})

    assert Lab("L", ["a.py"], [lands], leaderboard={"lands.fuel_kg": "asc"}).leaderboard == {"lands.fuel_kg": "asc"}
    with pytest.raises(LabFault, match="The leaderboard ranks"):
        Lab("L", ["a.py"], [lands], leaderboard=leaderboard)
