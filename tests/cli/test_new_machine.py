"""`snr new machine`: a program in LRP that can be checked and run at once, for every robot with parts for programs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from snr_sim.scenario import library

ROBOTS = [one.name for one in library.list_available("robots") if (one.path / "bridge.py").is_file()]


@pytest.mark.parametrize("robot", ROBOTS)
def test_new_machine_has_no_problem_and_runs_at_once(here: Path, snr: Any, robot: str) -> None:
    begun = snr("new", "machine", "mine", "--robot", robot)
    assert (begun.status, begun.err) == (0, "")
    checked = snr("machine", "check", "mine.lrp", "--robot", robot)
    assert (checked.status, checked.out) == (0, "mine.lrp: no problem was found.\n")
    (scenario,) = re.findall(r"snr run (\w+) --controller \./mine\.lrp", begun.out)
    scenario = {"dora_corners": "dora_wall"}.get(scenario, scenario)  # 5 minutes of driving
    answer = snr("run", scenario, "--controller", "./mine.lrp", "--no-rrd", "--json", "--out", "runs")
    assert "error" not in answer.json
    changes = [one for one in snr("trace", "--json").out.splitlines() if "mine.transition" in one]
    assert any('"moving"' in one for one in changes)
    assert not any(note.startswith("Machine 'mine', line") for note in answer.json["notes"])


def test_new_machine_names_every_part(here: Path, snr: Any) -> None:
    snr("new", "machine", "mine", "--robot", "dora")
    text = (here / "mine.lrp").read_text()
    for part in library.bridge_of_robot("dora").parts:
        assert f";   {part} " in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("mine",), "A machine needs a robot"),
        (("mine", "--robot", "dara"), "no robot 'dara'"),
        (("mine", "--robot", "housecat"), "no parts that an LRP program could name"),
        (("Mine", "--robot", "dora"), "'Mine' is not a valid machine name"),
        (("range", "--robot", "dora"), "A page of robot 'dora' is named 'range'"),
        (("taken", "--robot", "dora"), "taken.lrp is there already"),
        (("mine", "--robot", "dora", "--from", "stop"), "--from does not apply to a machine"),
    ],
)
def test_request_that_cannot_be_met_changes_nothing(here: Path, snr: Any, words: tuple[str, ...], message: str) -> None:
    (here / "taken.lrp").write_text("mine")
    answer = snr("new", "machine", *words)
    assert answer.status == 2
    assert message in answer.err
    assert [path.name for path in here.iterdir()] == ["taken.lrp"]
