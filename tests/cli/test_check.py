"""`snr check` and `snr new lab`: what they print about a lab, and the next step."""

from pathlib import Path
from typing import Any

import pytest

CHECKS = '''
from snr_sim.grading import Lab, Student, Verdict, check, failed, passed


@check(points=30, visible=[2])
def doubles(student: Student, case: int) -> Verdict:
    """Doubles."""
    got = student.call("mine.py", "double", case, returns=int)
    return passed() if got == 2 * case else failed("Twice.", expected=str(2 * case), actual=str(got))


@check(points=70, needs=["doubles"])
def lands(student: Student) -> Verdict:
    """Lands."""
    run = student.run_scenario("lander_vertical", 1, "mine.py")
    return passed() if run.success else failed("It fell.", actual=run.outcome)


lab = Lab("Doubling", files=["mine.py"], checks=[doubles, lands])
'''
COAST = (Path(__file__).parents[2] / "robots" / "lander" / "controllers" / "coast.py").read_text()
WRONG = "def double(x):\n    print('doubling', x)\n    return x"
FALLS = COAST + "\n\ndef double(x):\n    return 2 * x\n"


@pytest.fixture
def lab(here: Path) -> Path:
    """A lab of one's own, which is found from the current folder."""
    lab = here / "assignments" / "04_doubling"
    (lab / "starter").mkdir(parents=True)
    (lab / "README.md").write_text("# Doubling\n")
    (lab / "checks.py").write_text(CHECKS)
    (lab / "starter" / "mine.py").write_text(WRONG)
    return lab


@pytest.mark.slow
def test_new_lab_then_check_reports_practice_points(here: Path, lab: Path, snr: Any) -> None:
    begun = snr("new", "lab", "doubling")
    assert (begun.status, begun.err) == (0, "")
    assert "snr check doubling doubling" in begun.out
    assert (here / "doubling" / "mine.py").read_text() == WRONG
    tried = snr("check", "doubling", "doubling")
    assert tried.status == 1
    output = (
        "practice",
        "0 of 30",
        "Twice.",
        "expected: 4",
        "actual:   2",
        "doubling 2",
        "not tried",
        "Next: 'Doubles.'",
    )
    assert [words for words in output if words not in tried.out] == []
    assert snr("new", "lab", "doubling").status == 2


def test_new_lab_copies_page_and_pictures_into_given_folder(here: Path, lab: Path, snr: Any) -> None:
    (lab / "pictures").mkdir()
    (lab / "pictures" / "two.svg").write_text("<svg/>")
    begun = snr("new", "lab", "doubling", "weeks/second")
    assert (begun.status, begun.err) == (0, "")
    assert "snr check doubling weeks/second" in begun.out
    second = here / "weeks" / "second"
    assert {path.name for path in second.rglob("*")} == {"mine.py", "README.md", "pictures", "two.svg"}
    (here / "a_file").touch()
    assert "a_file/third" in snr("new", "lab", "doubling", "a_file/third").err
    assert snr("new", "robot", "crab", "elsewhere").status == 2


@pytest.mark.slow
def test_failed_run_is_kept_and_replays_and_passed_run_is_deleted(here: Path, lab: Path, snr: Any) -> None:
    (here / "mine.py").write_text(FALLS)
    fallen = snr("check", "04_doubling")
    assert fallen.status == 1
    run = here / "runs" / "check_04_doubling" / "lands-1" / "run-1"
    assert f"snr replay {run.relative_to(here)}" in fallen.out
    assert snr("replay", run).status == 0
    (here / "mine.py").write_text(FALLS)
    (lab / "checks.py").write_text(CHECKS.replace("if run.success", "if not run.success"))
    assert snr("check", "doubling").status == 0
    assert not run.exists()


@pytest.mark.slow
def test_json_contains_whole_record(here: Path, lab: Path, snr: Any) -> None:
    (here / "mine.py").write_text(WRONG)
    answer = snr("check", "doubling", "--json")
    record = answer.json
    assert answer.status == 1
    assert (record["lab"], record["isolation"], record["includes_hidden"]) == ("04_doubling", "none", False)
    assert record["checks"][0]["cases"][0]["printed"] == "doubling 2\n"


def test_missing_file_reports_cause_and_fix(here: Path, lab: Path, snr: Any) -> None:
    answer = snr("check", "doubling")
    assert answer.status == 2
    assert "There is no mine.py" in answer.err
    assert "snr new lab doubling" in answer.err
    assert snr("check", "dubling").status == 2
    assert snr("check", "doubling", "nowhere").status == 2
    (here / "mine.py").write_text(WRONG)
    assert "mine.py is a file, not a folder" in snr("check", "doubling", "mine.py").err


@pytest.mark.slow
def test_reason_of_skipped_checks_is_printed_once(here: Path, lab: Path, snr: Any) -> None:
    stays = '@check(points=30, needs=["doubles"])\ndef stays(student: Student) -> Verdict:\n    """Stays."""\n'
    stays += "    return passed()"
    three = CHECKS.replace("points=70", "points=40").replace("lands])", "lands, stays])")
    (lab / "checks.py").write_text(three.replace("\nlab =", f"\n{stays}\n\n\nlab ="))
    (here / "mine.py").write_text(WRONG)
    output = snr("check", "doubling").out
    assert output.count("not tried") == 1
    assert "    Lands.\n    Stays.\n" in output


@pytest.mark.slow
def test_error_in_lab_is_not_a_student_error(here: Path, lab: Path, snr: Any) -> None:
    (here / "mine.py").write_text(FALLS)
    (lab / "checks.py").write_text(CHECKS.replace('"lander_vertical"', '"lander_nowhere"'))
    answer = snr("check", "doubling")
    assert answer.status == 2
    assert "lander_nowhere" in answer.err


@pytest.mark.slow
def test_equal_failures_of_several_cases_are_printed_once(lab: Path, snr: Any) -> None:
    (lab / "checks.py").write_text(CHECKS.replace("visible=[2]", "visible=[2, 3]"))
    (lab / "starter" / "mine.py").write_text("def double(x):\n    return 1 / 0\n")
    output = snr("check", "doubling", lab / "starter").out
    assert output.count("ZeroDivisionError") == 1
    assert "x Doubles. (case 2; case 3)\n" in output
    (lab / "starter" / "mine.py").write_text("def double(x):\n    return x\n")
    output = snr("check", "doubling", lab / "starter").out
    assert "x Doubles. (case 2)\n" in output
    assert "x Doubles. (case 3)\n" in output


@pytest.mark.slow
def test_source_errors_are_reported_with_line(here: Path, lab: Path, snr: Any) -> None:
    (here / "mine.py").write_text(FALLS.replace("return self.store_data_task", "self.store_data_task"))
    answer = snr("check", "doubling")
    place, words, fix = answer.err.splitlines()[:3]
    assert place.startswith("note: mine.py, line ")
    assert words.startswith("  on_radar() of Coast makes a task there and drops it")
    assert fix.startswith("  Try: return self.store_data_task(")


def test_missing_file_in_a_labs_folder_is_to_be_copied_again(here: Path, snr: Any) -> None:
    snr("new", "lab", "hello_thruster")
    (here / "hello_thruster" / "wiring.py").unlink()
    answer = snr("check", "hello_thruster", "hello_thruster")
    assert "There is no wiring.py" in answer.err
    assert "copy it again: " in answer.err
    assert "/starter/wiring.py" in answer.err
