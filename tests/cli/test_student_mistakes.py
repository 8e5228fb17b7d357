"""Score of the messages about students' mistakes, in points: `student_mistakes.py` is the table."""

import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from snr_sim.core.config import MAX_TASKS_PER_MOMENT, Config
from snr_sim.scenario.simulation_run import SimulationRun
from tests.cli.student_mistakes import COMMAND, GENTLE, MISTAKES, WATCHED, Mistake, in_flight

Snr = Callable[..., Any]
BEGINS = "=== the run begins\n"
MIN_MEAN, MIN_BEFORE = 5.4, 0.6
TRIED = [one for one in MISTAKES if not one.elsewhere]
# By number: those whose message lacks one of the six points.
FIVE_POINTS = {23, 70, 71, 72, 74, 214, 306, 311}


@pytest.fixture(autouse=True)
def _show_where_a_run_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    run = SimulationRun.run

    def begin(self: SimulationRun, *args: Any) -> Any:
        print(BEGINS, end="", file=sys.stderr)
        return run(self, *args)

    monkeypatch.setattr(SimulationRun, "run", begin)


@pytest.fixture(autouse=True)
def _few_tasks_per_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tenth of the usual limit: what has no end takes a tenth of the time."""
    monkeypatch.setitem(Config.__init__.__kwdefaults__, "max_tasks_per_moment", MAX_TASKS_PER_MOMENT // 10)


def output_of(mistake: Mistake, snr: Snr, here: Path) -> str:
    """Make a mistake as a student would, and return the messages."""
    (here / "gentle.py").write_text(GENTLE)
    for name, change in mistake.files.items():
        path = here / name
        path.write_text(change(path.read_text() if path.exists() else ""), errors="surrogateescape")
    answer = snr(*mistake.words)
    if mistake.then:
        run = next(iter((here / "runs").iterdir()), None) if (here / "runs").is_dir() else None
        if "{damaged}" in mistake.then:
            assert run is not None
            lines = (run / "trace.jsonl").read_text().splitlines(keepends=True)
            (run / "trace.jsonl").write_text("".join([*lines[:19], "{bad" + lines[19], *lines[20:]]))
        answer = snr(*(word.format(run=run, damaged=run) for word in mistake.then))
    return f"{answer.err}\n{answer.out}"


def messages(output: str) -> Iterator[str]:
    """Yield each message with the lines that belong to it."""
    lines: list[str] = []
    for line in filter(str.strip, output.splitlines()):
        if not line.startswith(" ") and lines:
            yield "\n".join(lines)
            lines = []
        lines.append(line)
    if lines:
        yield "\n".join(lines)


def points_of(mistake: Mistake, output: str) -> tuple[int, str]:
    """Return how many points the best message gets, and which they are not."""
    best, missing = 0, "silent"
    for message in messages(output):
        marks = [bool(one and re.search(one, message)) for one in mistake.patterns]
        is_short = len(message.splitlines()) <= 6 and "snr_sim/" not in message.splitlines()[0]
        points = sum(marks) + (is_short if any(marks) else 0)
        if points > best:
            lacking = [
                name
                for name, mark in zip(("line", "name", "expected", "found", "action"), marks, strict=True)
                if not mark
            ]
            best, missing = points, ", ".join([*lacking, *([] if is_short else ["short"])])
    return best, missing


@pytest.mark.parametrize(
    "mistake",
    [pytest.param(one, marks=[pytest.mark.slow] * one.is_slow) for one in TRIED],
    ids=[f"{one.number}_{one.what}" for one in TRIED],
)
def test_mistake_is_reported_with_line_and_fix(mistake: Mistake, snr: Snr, here: Path) -> None:
    output = output_of(mistake, snr, here)
    points, missing = points_of(mistake, output)
    expected = 5 if mistake.number in FIVE_POINTS else 6
    assert points >= expected, f"{points} of 6, without {missing}:\n{output}"
    before = points_of(mistake, output.partition(BEGINS)[0])[0] >= 5 if not mistake.then or mistake.is_before else False
    assert before or not mistake.is_before, f"reported only in the run:\n{output}"


@pytest.mark.slow
@pytest.mark.parametrize(
    "new",
    ["return task", COMMAND.replace('"throttle"', '"throtle"'), "while True: pass", "__import__('time').sleep(600)"],
)
def test_edit_that_would_end_the_run_is_rolled_back_and_replays(snr: Snr, here: Path, new: str) -> None:
    (here / "gentle.py").write_text(in_flight(COMMAND, new)["gentle.py"](GENTLE))
    answer = snr(*WATCHED)
    assert (answer.status, "rolled back: gentle as before it" in answer.err) == (0, True)
    replayed = snr("replay", next((here / "runs").iterdir()), "--check")
    assert (replayed.status, "identical" in replayed.out) == (0, True)


def test_three_of_five_mistakes_are_reported_before_the_run() -> None:
    assert sum(one.is_before for one in MISTAKES) >= MIN_BEFORE * len(MISTAKES)
    assert len({one.number for one in MISTAKES}) == len(MISTAKES)


@pytest.mark.parametrize("place", [one.elsewhere for one in MISTAKES if "::" in one.elsewhere])
def test_mistake_tested_elsewhere_has_its_test(place: str) -> None:
    file, _, name = place.partition("::")
    assert f"def {name}(" in (Path(__file__).parents[2] / file).read_text()


def test_mean_score_reaches_minimum() -> None:
    assert {one.number for one in TRIED} >= FIVE_POINTS
    assert 6.0 - len(FIVE_POINTS) / len(TRIED) >= MIN_MEAN
