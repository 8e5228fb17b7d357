"""`snr machine edits`: a run whose program was saved again while it ran, written as edits, runs again the same."""

from __future__ import annotations

import json
from pathlib import Path
from threading import Thread
from time import monotonic, sleep

import pytest
import typer

from snr_sim.cli.machine import machine
from snr_sim.scenario import library
from snr_sim.scenario.machine_edits import TABLE
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded
from tests.cli.conftest import Snr

STOP = library.find("robots", "dora").path / "controllers" / "stop.lrp"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run folder, without an edit."""
    (tmp_path / "mine.lrp").write_text(STOP.read_text())
    folder = tmp_path / "run"
    folder.mkdir()
    run_recorded(prepare(Request("dora_wall", controller=str(tmp_path / "mine.lrp"))), folder / "trace.jsonl")
    return folder


def test_edits_are_written_beside_the_run(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine("edits", str(run), trust=True)
    printed = capsys.readouterr().out
    assert "0 edits of dora" in printed
    assert "run again with them: identical" in printed
    assert sorted(path.name for path in (run / "edits").iterdir()) == ["0.lrp", TABLE]


def test_other_physics_end_with_status_1(
    run: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("snr_sim.cli.machine_edits.changes_again", lambda edits, first: "other")
    with pytest.raises(typer.Exit):
        machine("edits", str(run), out=run / "e", trust=True)
    assert "its states change differently" in capsys.readouterr().out
    with pytest.raises(typer.Exit):
        machine("edits", str(run), out=run / "e", trust=True, as_json=True)
    assert json.loads(capsys.readouterr().out)["identical"] is False


def saved_while_it_runs(here: Path, *texts: str) -> Thread:
    """Begin to save texts as the program of a run, from a second after its start on, a second after each other."""

    def save() -> None:
        deadline_s = monotonic() + 60.0
        while not list(here.glob("runs/*/trace.jsonl")) and monotonic() < deadline_s:
            sleep(0.05)
        for text in texts:
            sleep(1.0)
            (here / "mine.lrp").write_text(text)

    editor = Thread(target=save)
    editor.start()
    return editor


WATCHED = ("run", "dora_wall", "--controller", "./mine.lrp", "--speed", "3", "--watch", "--no-rrd")


@pytest.mark.slow
def test_guarded_run_puts_the_program_before_an_edit_back(snr: Snr, here: Path) -> None:
    text = STOP.read_text()
    (here / "mine.lrp").write_text(text.replace("[55]", "[15]"))
    editor = saved_while_it_runs(here, text.replace("robot.ultra.read() <", "robot.ultra.read() / 0 <"))
    answer = snr(*WATCHED, "--guard", "5")
    editor.join()
    assert answer.status == 0, answer.err
    assert "Machine 'dora' has the program before an edit again: line" in answer.err
    replayed = snr("replay", "--check")
    assert "identical" in replayed.out, replayed.out + replayed.err
    refused = snr("run", "dora_wall", "--guard", "0")
    assert (refused.status, "--guard must be greater than 0" in refused.err) == (2, True)


@pytest.mark.slow
def test_watched_run_is_the_same_again_with_its_edits(snr: Snr, here: Path) -> None:
    text = STOP.read_text()
    (here / "mine.lrp").write_text(text.replace("[55]", "[5]"))
    editor = saved_while_it_runs(here, text.replace("[55]", "[5"), text)
    answer = snr(*WATCHED)
    editor.join()
    assert answer.status == 0, answer.err
    edits = snr("machine", "edits", next(here.glob("runs/*")), "--out", "edits")
    assert edits.status == 0, edits.err
    assert "2 edits of dora" in edits.out
    assert "identical" in edits.out
    assert (here / "edits" / "2.lrp").read_text() == text
