"""`snr machine try`: a changed program on a recorded run says where it first differs, and which states it visits."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer

from snr_sim.cli.machine import machine
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ParameterError
from snr_sim.scenario import library
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded

STOP = library.find("robots", "dora").path / "controllers" / "stop.lrp"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run folder, in which the program was edited and stops later than its first text says."""
    (tmp_path / "mine.lrp").write_text(STOP.read_text().replace("40", "60"))
    folder = tmp_path / "run"
    folder.mkdir()
    edit = (0.5, tasks.event("dora.edit", [STOP.read_text()]))
    request = Request("dora_wall", controller=str(tmp_path / "mine.lrp"))
    run_recorded(prepare(request), folder / "trace.jsonl", [edit])
    return folder


def test_program_that_does_the_same_is_identical(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine("try", str(STOP), other=str(run), trust=True)
    shown = capsys.readouterr().out
    assert "1 edit of the run is left out." in shown
    assert "identical: every change of state as recorded" in shown


def test_changed_program_names_its_first_difference_and_its_states(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit) as caught:
        machine("try", str(run.parent / "mine.lrp"), other=str(run), trust=True, as_json=True)
    assert caught.value.exit_code == 1
    found = json.loads(capsys.readouterr().out)
    recorded, now = found["first"]
    assert (recorded["source"], recorded["target"]) == (now["source"], now["target"])
    assert now["t_ns"] < recorded["t_ns"]
    assert found["edits_left_out"] == 1
    assert all(row["recorded"] == row["now"] == 1 for row in found["states"])
    with pytest.raises(typer.Exit):
        machine("try", str(run.parent / "mine.lrp"), other=str(run), trust=True)
    shown = capsys.readouterr().out
    assert f"first difference, recorded: t = {recorded['t_ns'] / 1e9:.4f} s" in shown
    assert f"snr resim {run} --with FILE" in shown


def test_rehearsal_lists_what_both_programs_do(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine("try", str(run.parent / "mine.lrp"), other=str(run), at=1.0, trust=True)
    shown = capsys.readouterr().out
    assert shown.startswith("From 1 s to 11 s of the simulation, run again:\nwith its own program: 1 change of state\n")
    machine("try", str(run.parent / "mine.lrp"), other=str(run), at=1.0, trust=True, as_json=True)
    found = json.loads(capsys.readouterr().out)
    (late,), (early,) = (found[one]["changes"] for one in ("unchanged", "edited"))
    assert (late["target"], early["target"]) == ("stopped", "stopped")
    assert early["t_ns"] < late["t_ns"]  # it stops 60 cm before the wall, and not 40


def test_program_that_never_changes_its_state_again_is_named(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sleeper = run.parent / "sleeper.lrp"
    sleeper.write_text(STOP.read_text().replace("40", "-1"))
    with pytest.raises(typer.Exit):
        machine("try", str(sleeper), other=str(run), trust=True)
    assert "now: no further change of state" in capsys.readouterr().out


def test_run_without_a_machine_is_refused(tmp_path: Path) -> None:
    run_recorded(prepare(Request("lander_vertical", controller="coast")), tmp_path / "trace.jsonl")
    with pytest.raises(ParameterError, match="no state machine"):
        machine("try", str(STOP), other=str(tmp_path), trust=True)
