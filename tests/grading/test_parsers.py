"""Texts that hold a parser for minutes: they cost the grader's own process nothing."""

import time
from pathlib import Path

import pytest

from snr_sim.grading.lab.lab import find_lab
from snr_sim.grading.lab.student import Student
from snr_sim.grading.lab.verdicts import SubmissionError
from tests.slowness import slowness

pytestmark = pytest.mark.slow
DOTTED = ".".join("a" * 20_000) + " = 1"


def findings(folder: Path, text: str) -> SubmissionError | None:
    """Have lab 9 check a findings.toml; return the error. The grader itself must not parse it."""
    (folder / "findings.toml").write_text(text)
    (check,) = (one for one in find_lab("09_debug_by_replay").checks if one.name == "filled_in")
    begun_s = time.process_time()
    wrong = None
    with Student(folder) as student:
        try:
            assert check.evaluate(student, check.cases("", None)[0]).fraction == 0.0
        except SubmissionError as error:
            wrong = error
    assert time.process_time() - begun_s < 0.5 * slowness()
    return wrong


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (DOTTED, "findings.toml has more than 16384 bytes."),
        (DOTTED[-15_000:], "findings.toml: "),
        ("a = " + "[" * 15_000, "findings.toml: "),
        ("a = " + "[" * 100 + "]" * 100, "findings.toml: "),
        ("a = " + "9" * 15_000, "findings.toml: "),
        ("a = 0x" + "9" * 15_000, "findings.toml: "),
        ("a = 1\na = 2", "findings.toml: Cannot overwrite a value"),
    ],
    ids=["long", "dotted keys", "open brackets", "brackets", "digits", "hexadecimal", "twice"],
)
def test_slow_toml_is_rejected_with_the_file_name(tmp_path: Path, text: str, message: str) -> None:
    wrong = findings(tmp_path, text)
    assert wrong is not None
    assert wrong.message.startswith(message)


def test_date_in_findings_is_accepted(tmp_path: Path) -> None:
    assert findings(tmp_path, "[[finding]]\nseq = 0xff\nday = 2026-01-01\n") is None


def test_slow_python_source_costs_the_grader_no_cpu_time(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("a = 1\ntext = f'" + "{a}" * 40_000 + "'\ndef f():\n    return 1\n")
    begun_s = time.process_time()
    with Student(tmp_path) as student:
        assert student.call("mine.py", "f", budget_s=30.0) == 1
    assert time.process_time() - begun_s < 0.5 * slowness()


def test_many_slow_modules_cost_the_time_of_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("snr_sim.grading.remote.parsers.MAX_IMPORTS_CPU_S", 0.5)
    (tmp_path / "parts").mkdir()
    (tmp_path / "mine.py").write_text("import parts\ndef f():\n    return 1\n")
    for number in range(40):
        (tmp_path / "parts" / f"m{number}.py").write_text("a = 1\ntext = f'" + "{a}" * 10_000 + "'\n")
    with Student(tmp_path) as student, pytest.raises(SubmissionError, match=r"the imports of mine\.py took") as wrong:
        student.call("mine.py", "f", budget_s=30.0)
    assert wrong.value.hint == "Hand in only what the lab asks for."
