"""Reports: students see little of hidden cases, the same everywhere, and no text of theirs breaks a format."""

import csv
import io
import json
import re
import unicodedata
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.grading.reports.class_reports import (
    Summary,
    cell,
    draw_distribution,
    write_cases,
    write_class,
    write_leaderboard,
)
from snr_sim.grading.reports.results import CaseResult, CheckResult, Graded
from snr_sim.grading.reports.student_reports import check50, fenced, gradescope_results, junit, markdown, student_page
from snr_sim.prelude.text import plain

FOR_STUDENTS: dict[str, Callable[[Graded], str]] = {
    "markdown": student_page,
    "gradescope": gradescope_results,
    "junit": junit,
    "check50": check50,
}
EVIL = [
    "<script>alert(1)</script>", "![x](http://evil/a.png)", "```\n# free\n```", "````", "| a | b |", "&amp;&lt;",
    "\x1b[31mred\x1b[0m\x1b]0;title\x07", "\x00\x01\x02", "\u202egnirts\u2066", "\ud800", "]]>", "--><!--",
    "=HYPERLINK(\"http://evil\")", "+1", "-1+1", "@SUM(A1)", "\t=1", "\r\n=1", "{{7*7}}", "\ufffe\uffff", "a" * 100_000,
]  # fmt: skip


def graded(text: str = "words", **changes: object) -> Graded:
    cases = (
        CaseResult(label="from 1 m to 3 m", is_visible=True, fraction=1.0, metrics={"fuel_kg": 2.0}),
        CaseResult(
            label="from 2 m to 1 m", is_visible=True, fraction=0.0, hint="Too deep.", expected="< 0.15 m",
            actual=text, error=text, printed=text, run_folder="runs/settles-2",
        ),
        CaseResult(
            label="HIDDEN start 7.125", is_visible=False, fraction=0.5, hint="Too deep.", expected="HIDDEN expected",
            actual="HIDDEN actual", error="HIDDEN error", printed="HIDDEN printed", run_folder="HIDDEN-run",
            metrics={"fuel_kg": 4.0},
        ),
        CaseResult(label="HIDDEN other", is_visible=False, fraction=1.0, hint="HIDDEN note"),
    )  # fmt: skip
    checks = (
        CheckResult(name="loads", title="Loads.", points=10.0, max_points=10.0, cases=(cases[0],)),
        CheckResult(name="settles", title="Settles within 8 s.", points=37.5, max_points=60.0, cases=cases),
        CheckResult(
            name="calm", title="Does not jerk.", points=0.0, max_points=30.0, skipped_because="'settles' comes first."
        ),
    )
    whole = Graded(
        submission="ada", lab="02_depth_hold", title="Depth hold", checks=checks, isolation="sandbox",
        includes_hidden=True, version="0.1.0", notes=(text[:300],), leaderboard={"settles.fuel_kg": "asc"},
    )  # fmt: skip
    return msgspec.structs.replace(whole, **changes)


REFUSED = graded(checks=(), status="rejected", error="Your submission is empty.", notes=())
FAULT = graded(checks=(), status="grader_error", error="KeyError 'x' in checks.py line 3: HIDDEN")


@pytest.mark.parametrize("form", FOR_STUDENTS)
def test_reports_show_only_counts_and_hints_of_hidden_cases(form: str) -> None:
    text = FOR_STUDENTS[form](graded())
    assert "HIDDEN" not in text
    assert "7.125" not in text
    assert "1 of 2 passed" in text
    assert "1 x: Too deep." in text


@pytest.mark.parametrize("form", FOR_STUDENTS)
def test_reports_of_equal_results_are_byte_identical(form: str) -> None:
    assert FOR_STUDENTS[form](graded()) == FOR_STUDENTS[form](graded())


@pytest.mark.parametrize("form", FOR_STUDENTS)
def test_grader_error_hides_its_message_and_rejection_shows_it(form: str) -> None:
    assert "HIDDEN" not in FOR_STUDENTS[form](FAULT)
    assert "the grader failed, not you" in FOR_STUDENTS[form](FAULT)
    assert "Your submission is empty." in FOR_STUDENTS[form](REFUSED)


@pytest.mark.parametrize("text", EVIL)
@pytest.mark.parametrize("form", FOR_STUDENTS)
def test_student_text_is_escaped_and_truncated(form: str, text: str) -> None:
    shown = FOR_STUDENTS[form](graded(text))
    assert all(char in "\n\t" or unicodedata.category(char) not in ("Cc", "Cf", "Cs", "Cn") for char in shown)
    assert len(shown) < 40_000
    shown.encode()


@pytest.mark.slow
@given(st.text(max_size=200))
def test_reports_with_hostile_output_are_parseable(text: str) -> None:
    whole = graded(text)
    suite = ElementTree.fromstring(junit(whole))
    assert [suite.get(name) for name in ("tests", "failures", "errors", "skipped")] == ["3", "1", "0", "1"]
    assert json.loads(gradescope_results(whole))["score"] == 47.5
    assert [one["passed"] for one in json.loads(check50(whole))["results"]] == [True, False, None]


@given(st.text(alphabet="`~\n ab\r", max_size=60))
def test_hostile_text_stays_inside_its_fenced_block(text: str) -> None:
    lines = fenced(text).split("\n")
    fence = lines[0].removesuffix("text")
    assert set(fence) == {"`"}
    assert [i for i, line in enumerate(lines) if line.strip().startswith(fence)] == [0, len(lines) - 1]


def test_markdown_line_escapes_html_and_links() -> None:
    line = markdown("<img src=x onerror=alert(1)> [a](http://evil) www.evil.org `x`")
    assert not re.search(r"(?<!\\)[<\[`]", line)
    assert "://" not in line
    assert "www." not in line


def test_gradescope_results_follow_its_specification() -> None:
    fields = json.loads(gradescope_results(graded()))
    assert fields["score"] == sum(test["score"] for test in fields["tests"])
    assert fields["leaderboard"] == [{"name": "settles.fuel_kg", "value": 3.0, "order": "asc"}]
    assert {test["visibility"] for test in fields["tests"]} == {fields["visibility"]} == {"visible"}
    assert fields["stdout_visibility"] == "hidden"
    assert {test["status"] for test in fields["tests"]} == {"passed", "failed"}
    assert all(set(test) <= GRADESCOPE_TEST for test in fields["tests"])
    assert "score" not in json.loads(gradescope_results(FAULT))


GRADESCOPE_TEST = {
    *("score", "max_score", "status", "name", "name_format", "number", "output", "output_format", "tags"),
    *("visibility", "extra_data"),
}


def test_student_page_shows_points_hint_and_run() -> None:
    page = student_page(graded())
    assert "**47.5 of 100 points.**" in page
    assert "| Settles within 8 s. | 37.5 of 60 | in part |" in page
    assert "- **from 2 m to 1 m: not passed.** Too deep." in page
    assert "`snr view runs/settles-2`" in page
    assert "Not tried: 'settles' comes first." in page
    assert "not an official mark" not in page
    assert "not an official mark" in student_page(graded(isolation="none"))


# The class


def rows_of(write: Callable[..., None], *arguments: object) -> list[list[str]]:
    table = io.StringIO(newline="")
    write(table, *arguments)
    return list(csv.reader(io.StringIO(table.getvalue(), newline="")))


def test_class_table_has_a_row_per_submission() -> None:
    everybody = [graded(), REFUSED, FAULT]
    rows = rows_of(write_class, lambda: everybody, {"ada": "a/ada.zip"})
    assert rows[0] == [
        *("submission", "points", "max_points", "status", "isolation", "loads", "settles", "calm"),
        *("loads.fuel_kg", "settles.fuel_kg", "error", "given"),
    ]
    assert rows[1] == ["ada", "47.5", "100", "graded", "sandbox", "10", "37.5", "0", "2", "3", "", "a/ada.zip"]
    assert rows[2][1:9] == ["0", "100", "rejected", "sandbox", "", "", "", ""]
    assert rows[3][1:4] == ["", "100", "grader_error"]
    assert rows[3][-2].startswith("KeyError")


@pytest.mark.parametrize("text", EVIL)
def test_table_cells_are_never_formulas(text: str) -> None:
    whole = graded(text, submission=text[:60], error=text)
    for rows in (rows_of(write_class, lambda: [whole], {}), rows_of(write_cases, [whole])):
        assert len({len(row) for row in rows}) == 1
        for value in (value for row in rows[1:] for value in row if not re.fullmatch(r"-?[\d.]+", value)):
            assert not value.startswith(("=", "+", "-", "@", "\t", "\r"))
            assert value == plain(value)


def test_plain_text_cell_is_unchanged() -> None:
    assert cell("It is 0.4 m too deep") == "It is 0.4 m too deep"


def test_case_table_has_a_row_per_case() -> None:
    rows = rows_of(write_cases, [graded(), REFUSED])
    assert len(rows) == 6
    assert rows[4][:5] == ["ada", "settles", "HIDDEN start 7.125", "no", "0.5"]


def test_leaderboard_ranks_ties_equal_in_either_order() -> None:
    summary = Summary()
    for name, fuel in (("ada", 3.0), ("bob", 1.0), ("eve", 1.0), ("dan", 2.0)):
        case = CaseResult(label="", is_visible=True, fraction=1.0, metrics={"fuel_kg": fuel})
        check = CheckResult(name="settles", title="S", points=1.0, max_points=1.0, cases=(case,))
        summary.add(graded(submission=name, checks=(check,)))
    rows = rows_of(write_leaderboard, summary)
    assert [row[1:3] for row in rows[1:]] == [["1", "bob"], ["1", "eve"], ["3", "dan"], ["4", "ada"]]
    summary.orders["settles.fuel_kg"] = "desc"
    assert [row[2] for row in rows_of(write_leaderboard, summary)[1:]] == ["ada", "dan", "bob", "eve"]


def test_summary_mean_excludes_grader_errors() -> None:
    summary = Summary()
    for one in (graded(), REFUSED, FAULT):
        summary.add(one)
    assert summary.sentence() == "2 graded: mean 23.75, median 23.75, from 0 to 47.5 of 100 points."
    assert (summary.rejected, summary.grader_errors) == (["ada"], ["ada"])
    assert Summary().sentence() == "No submission has a mark."


def test_distribution_is_drawn_for_an_empty_class(tmp_path: Path) -> None:
    full, empty = Summary(), Summary()
    for _ in range(9):
        full.add(graded())
    full.add(REFUSED)
    for name, summary in (("full.png", full), ("empty.png", empty)):
        draw_distribution(summary, "Depth hold", tmp_path / name)
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "full.png").stat().st_size > (tmp_path / "empty.png").stat().st_size
