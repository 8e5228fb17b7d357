"""`snr new service`: a unit file of systemd for the processes in a file."""

from __future__ import annotations

import configparser
import shlex
import sys
from pathlib import Path
from typing import Any

import pytest


def test_new_service_runs_the_file_with_this_python_and_notifies(here: Path, snr: Any) -> None:
    (here / "rover.py").write_text("")
    answer = snr("new", "service", "rover")
    assert (answer.status, answer.err) == (0, "")
    unit = configparser.ConfigParser(interpolation=None)
    unit.optionxform = str  # type: ignore[assignment]  # names of options keep their capitals
    unit.read(here / "rover.service")
    service = unit["Service"]
    command = shlex.split(service["ExecStart"])
    assert command == [sys.executable, "-m", "snr_sim", "processes", str((here / "rover.py").resolve())]
    assert (service["Type"], service["Restart"], service["WorkingDirectory"]) == (
        "notify",
        "on-failure",
        str(here.resolve()),
    )
    assert float(service["WatchdogSec"]) > 0
    assert unit["Unit"]["StartLimitBurst"] == "5"
    assert snr("new", "service", "rover").status == 2


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["rover"], "There is no rover.py here."),
        (["rover", "--robot", "dora"], "--from and --robot do not apply to a service."),
        (["per%cent"], "is not a valid service name"),
    ],
)
def test_invalid_service_is_status_2_and_leaves_no_files(here: Path, snr: Any, words: list[str], message: str) -> None:
    answer = snr("new", "service", *words)
    assert (answer.status, message in answer.err) == (2, True), answer.err
    assert list(here.glob("*.service")) == []


def test_folder_that_no_unit_file_can_name_is_rejected(here: Path, snr: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = here / "50%"
    folder.mkdir()
    (folder / "rover.py").write_text("")
    monkeypatch.chdir(folder)
    answer = snr("new", "service", "rover")
    assert (answer.status, "A unit file cannot have the path" in answer.err) == (2, True), answer.err
