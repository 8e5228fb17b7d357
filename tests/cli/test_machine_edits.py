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


@pytest.mark.slow
def test_watched_run_is_the_same_again_with_its_edits(snr: Snr, here: Path) -> None:
    file, text = here / "mine.lrp", STOP.read_text()
    file.write_text(text.replace("[55]", "[5]"))

    def edit() -> None:
        deadline_s = monotonic() + 60.0
        while not list(here.glob("runs/*/trace.jsonl")) and monotonic() < deadline_s:
            sleep(0.05)
        sleep(1.0)
        file.write_text(text.replace("[55]", "[5"))
        sleep(1.0)
        file.write_text(text)

    editor = Thread(target=edit)
    editor.start()
    answer = snr("run", "dora_wall", "--controller", "./mine.lrp", "--speed", "3", "--watch", "--no-rrd")
    editor.join()
    assert answer.status == 0, answer.err
    edits = snr("machine", "edits", next(here.glob("runs/*")), "--out", "edits")
    assert edits.status == 0, edits.err
    assert "2 edits of dora" in edits.out
    assert "identical" in edits.out
    assert (here / "edits" / "2.lrp").read_text() == text
