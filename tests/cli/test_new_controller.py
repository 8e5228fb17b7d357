"""`snr new controller`: a file that runs at once, for every robot, and what is wrong with a request."""

import re
from pathlib import Path
from typing import Any

import pytest

SCENARIOS = {"lander_vertical": 0, "urov_sticks": 1}  # with the exit status of a run that only begins


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_new_controller_runs_at_once(here: Path, snr: Any, scenario: str) -> None:
    begun = snr("new", "controller", "my_first", "--scenario", scenario)
    assert (begun.status, begun.err) == (0, "")
    assert f"snr run {scenario} --controller ./my_first.py" in begun.out
    source = (here / "my_first.py").read_text()
    assert "class MyFirst(Endpoint):" in source
    assert "Template" not in source
    answer = snr("run", scenario, "--controller", "./my_first.py", "--no-rrd", "--json")
    assert (answer.status, answer.json["outcome"] == "landed") == (SCENARIOS[scenario], scenario == "lander_vertical")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("mine",), "needs a scenario"),
        (("mine", "--scenario", "lander_vertica"), "no scenario 'lander_vertica'.*\n.*lander_vertical"),
        (("Mine", "--scenario", "lander_pad"), "'Mine' is not a valid controller name"),
        (("taken", "--scenario", "lander_pad"), "taken.py is there already"),
        (("mine", "--scenario", "lander_pad", "--from", "coast"), "begins with the template"),
        (("mine", "folder", "--scenario", "lander_pad"), "snr new controller takes no folder, but got 'folder'"),
    ],
)
def test_wrong_request_changes_nothing(here: Path, snr: Any, words: tuple[str, ...], message: str) -> None:
    (here / "taken.py").write_text("mine")
    answer = snr("new", "controller", *words)
    assert answer.status == 2
    assert re.search(message, answer.err), answer.err
    assert [path.name for path in here.iterdir()] == ["taken.py"]
    assert (here / "taken.py").read_text() == "mine"


def test_robot_without_a_template_is_named(here: Path, snr: Any) -> None:
    assert snr("new", "robot", "moth", "--from", "lander").status == 0
    assert snr("new", "scenario", "fall", "--from", "lander_low_gate", "--robot", "moth").status == 0
    assert snr("new", "controller", "mine", "--scenario", "fall").status == 0  # the copy has one
    (here / "robots" / "moth" / "controller_template.py").unlink()
    answer = snr("new", "controller", "other", "--scenario", "fall")
    assert answer.status == 2
    assert "Robot 'moth' of scenario 'fall' has no template" in answer.err


def test_scenario_for_another_kind_is_rejected(snr: Any) -> None:
    assert snr("new", "robot", "moth", "--scenario", "lander_pad").status == 2
