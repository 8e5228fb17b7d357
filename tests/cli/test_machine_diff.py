"""`snr machine diff RUN --with NEW` and `snr replay RUN --with NEW --keep-program`: a changed program in an old run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from snr_sim.prelude import tasks
from snr_sim.scenario import library
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded

STOP = (library.find("robots", "dora").path / "controllers" / "stop.lrp").read_text()
EARLIER = STOP.replace("[40]", "[60]")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run, in which an edit made the robot stop earlier."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "mine.lrp").write_text(STOP)
    (folder / "run").mkdir()
    request = Request("dora_wall", controller=str(folder / "mine.lrp"))
    run_recorded(prepare(request), folder / "run" / "trace.jsonl", [(0.6, tasks.event("dora.edit", [EARLIER]))])
    return folder


@pytest.fixture
def run(recorded: Path, monkeypatch: pytest.MonkeyPatch, here: Path) -> Path:
    """The run; the current folder is empty, so no run is written into the other one."""
    (here / "same.lrp").write_text(f"; a comment moves all lines\n\n{STOP}")
    (here / "other.lrp").write_text(STOP.replace("(onentry [robot.stop()])", "(onentry [robot.motor_a.stop()])"))
    (here / "nearer.lrp").write_text(STOP.replace("(ontime", "").replace("[40]", "[39]"))
    return recorded / "run"


def diff(snr: Any, run: Path, file: str, *more: str) -> Any:
    return snr("machine", "diff", run, "--with", file, "--trust", *more)


def test_program_that_does_the_same_is_identical(snr: Any, run: Path) -> None:
    answer = diff(snr, run, "same.lrp")
    assert answer.status == 0, answer.err
    assert answer.out.splitlines() == [
        "no differences", "the programs do the same", "the replay is identical",
        "compared up to 0.6 s, when an edit replaced the program of the run",
    ]  # fmt: skip


def test_change_that_was_not_evaluated_before_the_edit_is_named(snr: Any, run: Path) -> None:
    answer = diff(snr, run, "other.lrp")
    assert answer.status == 0
    assert "state stopped onentry changed" in answer.out
    assert "none of them is evaluated in this run" in answer.out


def test_change_that_explains_the_first_difference_is_named(snr: Any, run: Path) -> None:
    answer = diff(snr, run, "nearer.lrp")
    assert answer.status == 1, answer.err
    lines = answer.out.splitlines()
    assert lines[2] == "first evaluated: t = 0.0000 s, nearer.lrp:0: variable near_cm changed"
    assert lines[3].startswith("first difference: t = 0.0000 s, seq ")
    fields = diff(snr, run, "nearer.lrp", "--json").json
    assert fields["explained"] is True
    assert fields["first_divergence"]["field"] == "dora.variables.near_cm"


def test_difference_that_no_change_explains_ends_with_status_3(
    snr: Any, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("snr_sim.scenario.machine_change._evaluated_ns", lambda one, old, new: 0.5e9)
    answer = diff(snr, run, "nearer.lrp")
    assert answer.status == 3
    assert "unexplained: no changed element was evaluated before" in answer.out


def test_replay_with_a_program_says_where_edits_replace_it(snr: Any, run: Path) -> None:
    answer = snr("replay", run, "--with", "same.lrp", "--trust")
    assert (answer.status, answer.out.startswith("identical")) == (0, True), answer.out
    assert "Edits of the run replace the program" in answer.err


def test_replay_that_keeps_the_program_leaves_edits_out(snr: Any, run: Path) -> None:
    answer = snr("replay", run, "--with", "same.lrp", "--keep-program", "--trust")
    assert "1 edit of the run is left out." in answer.err
    assert answer.status == 1
    assert "t = 1.550 s" in answer.out, "there the edited program stops, and this one continues"
    kept = snr("replay", run, "--keep-program", "--trust")
    assert kept.status == 1
    assert "1 edit of the run is left out." in kept.err
