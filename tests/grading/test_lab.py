"""Labs: definitions are checked when they are read; hidden cases come from the secret; points are shared."""

import logging
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from snr_sim.grading import Lab, Student, Verdict, check, failed, partial_credit, passed
from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab.lab import find_lab, load_lab
from snr_sim.grading.lab.verdicts import GraderError, SubmissionError
from snr_sim.grading.remote.sent_code import code_to_send
from snr_sim.grading.reports.feedback import as_text
from snr_sim.grading.reports.results import Graded
from snr_sim.prelude.errors import UnknownNameError


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


def test_lab_with_wrong_point_sum_or_order_of_needs_raises() -> None:
    one = check(points=60)(lambda student: passed())
    with pytest.raises(GraderError, match="give 60 points"):
        Lab("Small", files=[], checks=[one])
    late = check(points=40, needs=["doubled"])(doubles.function)
    with pytest.raises(GraderError, match="needs 'doubled', which does not come before it"):
        Lab("Small", files=[], checks=[one, late])


def test_case_label_comes_from_label_fields_or_argument_name() -> None:
    one = check(points=100, visible=[Start(1.0, 3.0), 7])(doubles.function)
    assert [case.label for case in one.cases("small", None)] == ["start 1 m, goal 3 m", "case 7"]
    assert one.title == "Doubles."


def test_hidden_cases_depend_on_secret_lab_and_check() -> None:
    def hidden(lab: str, secret: bytes) -> list[int]:
        return [case.value for case in doubles.cases(lab, secret) if not case.is_visible]

    assert hidden("small", b"a") == hidden("small", b"a")
    assert len({tuple(hidden(lab, secret)) for lab in ("small", "large") for secret in (b"a", b"b")}) == 4
    other = check(points=100, hidden=draw)(passed)
    assert [case.value for case in other.cases("small", b"a")] != hidden("small", b"a")


@pytest.mark.slow
def test_hidden_cases_run_only_with_a_secret(tmp_path: Path) -> None:
    by_heart = "def double(x):\n    return {1: 2, 2: 4}.get(x, 0)"
    assert graded(tmp_path, by_heart, doubles).points == 100.0
    official = graded(tmp_path, by_heart, doubles, secret=b"s")
    assert official.points == 40.0
    assert [case.is_visible for case in official.checks[0].cases] == [True, True, False, False, False]
    assert official.includes_hidden


@pytest.mark.slow
def test_grading_is_deterministic(tmp_path: Path) -> None:
    source = "import random\ndef double(x):\n    print({'a', 'b', 'c'})\n    return 2 * x"
    assert graded(tmp_path, source, doubles, secret=b"s") == graded(tmp_path, source, doubles, secret=b"s")


def test_partial_credit_scales_points_unless_all_or_nothing(tmp_path: Path) -> None:
    def half(student: Student, case: int) -> Verdict:
        return partial_credit(0.5, "Half.") if case else passed()

    shared = check(points=50, visible=[0, 1])(half)
    whole = check(points=50, visible=[0, 1], all_or_nothing=True)(half)
    with pytest.raises(GraderError, match="Two checks are called 'half'"):
        graded(tmp_path, "", shared, whole)
    half.__name__ = "other"
    both = graded(tmp_path, "", shared, check(points=50, visible=[0, 1], all_or_nothing=True)(lambda s, c: half(s, c)))
    assert [one.points for one in both.checks] == [37.5, 0.0]


def test_check_with_failed_needs_is_skipped(tmp_path: Path) -> None:
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


def test_warnings_are_silenced_during_grading_only(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    @check(points=100)
    def warns(student: Student) -> Verdict:
        logging.getLogger("snr.urov.link_tether").warning("link_tether is down")
        return passed()

    assert graded(tmp_path, "", warns).points == 100.0
    assert caplog.messages == []
    logging.getLogger("snr.urov.link_tether").warning("up")
    assert caplog.messages == ["up"]


@pytest.mark.slow
def test_practice_skips_checks_with_hidden_cases_only(tmp_path: Path) -> None:
    hidden = check(points=50, hidden=draw)(doubles.function)

    @check(points=50, needs=["doubles"])
    def after(student: Student) -> Verdict:
        return passed()

    practice = graded(tmp_path, "", hidden, after)
    assert [(one.name, one.points) for one in practice.checks] == [("after", 50.0)]
    official = graded(tmp_path, "", hidden, after, secret=b"s")
    assert [one.points for one in official.checks] == [0.0, 0.0]


def test_check_without_cases_is_a_grader_error(tmp_path: Path) -> None:
    empty = check(points=100, hidden=lambda rng: [])(doubles.function)
    assert "The check 'doubles' has no case" in graded(tmp_path, "", empty, secret=b"s").error


def test_failing_check_is_a_grader_error_without_points(tmp_path: Path) -> None:
    @check(points=100)
    def wrong(student: Student) -> Verdict:
        return passed(metrics={"one": 1 / 0})

    result = graded(tmp_path, "", wrong)
    assert (result.status, result.points, result.checks) == ("grader_error", None, ())
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
def test_inconclusive_case_gets_zero_and_hides_the_cause(judge: Callable[[Any], Verdict], tmp_path: Path) -> None:
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
    message = as_text(result.checks[0])
    assert "What mine.py gave could not be judged." in message
    assert "test_lab.py" not in message
    assert message.count("It stopped the check") == 1, "of the hidden case nothing but the hint is shown"


@pytest.mark.slow
def test_os_error_in_a_check_is_a_grader_error(tmp_path: Path) -> None:
    @check(points=100)
    def wrong(student: Student) -> Verdict:
        raise OSError(student.call("mine.py", "double", 28))

    assert graded(tmp_path, "def double(x):\n    return x", wrong).status == "grader_error"


def test_check_that_returns_a_non_verdict_is_a_grader_error(tmp_path: Path) -> None:
    @check(points=100)
    def wrong(student: Student) -> Verdict:
        return True  # type: ignore[return-value]

    assert "returned True, which is not a Verdict" in graded(tmp_path, "", wrong).error


@pytest.mark.slow
def test_each_case_runs_in_a_fresh_process(tmp_path: Path) -> None:
    source = "seen = []\ndef double(x):\n    seen.append(x)\n    return 2 * x if len(seen) == 1 else 0"
    assert graded(tmp_path, source, doubles, secret=b"s").points == 100.0


def test_find_lab_accepts_name_with_or_without_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "assignments" / "03_small"
    folder.mkdir(parents=True)
    (folder / "README.md").write_text("# Small\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UnknownNameError, match="'03_small' has no checks"):
        find_lab("small")
    (folder / "checks.py").write_text(
        "from snr_sim.grading import Lab, check, passed\n"
        "lab = Lab('Small', files=[], checks=[check(points=100)(lambda student: passed())])\n"
    )
    assert find_lab("small").name == find_lab("03_small").name == find_lab(str(folder)).name == "03_small"
    with pytest.raises(UnknownNameError, match="There is no assignment 'smal'"):
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
def test_lab_class_runs_in_a_process_without_the_lab(tmp_path: Path) -> None:
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
        with pytest.raises(SubmissionError, match="a submission does not grade itself"):
            student.create_object("mine.py", module.Bench)
        assert student.parse("mine.py", module.size) == (submission / "mine.py").stat().st_size
    hidden = (submission / "mine.py").read_text().replace("from snr_sim_lab_benched import checks", "exec(IMPORT)")
    (submission / "mine.py").write_text("IMPORT = 'from snr_sim' + '_lab_benched import checks'\n" + hidden)
    with Student(submission) as student:
        assert student.create_object("mine.py", module.Bench).ask("word", returns=str) == "own snr_sim_lab_benched"
        assert student.call("mine.py", "seen") == ["snr_sim_lab_benched.grader.bench"]


def test_labs_of_equal_name_load_their_own_grader(tmp_path: Path) -> None:
    for word in ("first", "second"):
        bench = lab_with_a_bench(tmp_path / word, word).module("grader.bench")
        assert bench.Bench(SimpleNamespace(WORD="")).word() == f"{word} "


def test_sending_a_foreign_class_raises_grader_error() -> None:
    with pytest.raises(GraderError, match="SimpleNamespace of types cannot be sent"):
        code_to_send(SimpleNamespace)


@pytest.mark.parametrize(("text", "message"), [("lab = 3", "has no `lab`"), ("x = 1 / 0", "ZeroDivisionError")])
def test_unreadable_checks_raise_grader_error(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "checks.py").write_text(text)
    with pytest.raises(GraderError, match=message):
        load_lab(tmp_path / "checks.py")


@pytest.mark.parametrize("leaderboard", [{"land.fuel_kg": "asc"}, {"lands.fuel_kg": "least"}, {"fuel_kg": "asc"}])
def test_leaderboard_with_unknown_metric_or_order_raises(leaderboard: dict[str, Any]) -> None:
    @check(points=100)
    def lands(student: Student) -> Verdict:
        return passed(metrics={"fuel_kg": 3.0})

    assert Lab("L", ["a.py"], [lands], leaderboard={"lands.fuel_kg": "asc"}).leaderboard == {"lands.fuel_kg": "asc"}
    with pytest.raises(GraderError, match="The leaderboard entry"):
        Lab("L", ["a.py"], [lands], leaderboard=leaderboard)
