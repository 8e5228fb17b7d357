"""Commands in a notebook: what they say is printed as seen from their folder, and their exit status is returned."""

from pathlib import Path

import pytest

from snr_sim.notebook import snr

pytestmark = pytest.mark.slow


def test_command_prints_output_and_returns_status(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert snr("trace", tmp_path / "no_such_run", folder=tmp_path) == 2
    printed = capsys.readouterr().out
    assert "There is no run at no_such_run." in printed  # of stderr, too, and without the folder in front
    assert "\x1b[" not in printed


def test_command_runs_in_given_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert snr("run", "lander_vertical", "--no-rrd", folder=tmp_path) == 0
    assert len(list((tmp_path / "runs").iterdir())) == 1
    assert "landed after" in capsys.readouterr().out
