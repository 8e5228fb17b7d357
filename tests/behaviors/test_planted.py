"""Each tool finds what is planted in a program, by name, and nothing in programs that are sound."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import typer

from snr_sim.behaviors import parse
from snr_sim.behaviors.explore import explore
from snr_sim.cli.machine import machine as machine_verb
from snr_sim.cli.machine_why import why
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded
from snr_sim.testing.machines import StoryChoices, failing_story

PLANTED = Path(__file__).with_name("planted")
SOUND = ("sound_landing", "sound_interlock")
Tool = Callable[[Path], set[str]]


@pytest.fixture
def tools(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> dict[str, Tool]:
    def printed(*arguments: Any, **options: Any) -> Any:
        with suppress(typer.Exit):
            machine_verb(*arguments, **options, as_json=True)
        return json.loads(capsys.readouterr().out)

    def check(file: Path) -> set[str]:
        return {row["message"] for row in printed("check", str(file), robot="lander")["problems"]}

    def explored(file: Path) -> set[str]:
        found = explore(parse(file.read_text()))
        return {f"{one.kind} {one.name}" for one in found.findings} | {*found.left_out, *found.undecided}

    def coverage(file: Path) -> set[str]:
        (report,) = printed("coverage", "lander_vertical", seeds="0..1", controller=str(file))["machines"].values()
        found = {f"state {row['state']}" for row in report["states"] if not row["is_reached"]}
        return found | {row["transition"] for row in report["transitions"] if not row["taken"]}

    def explained(file: Path) -> set[str]:
        run_recorded(prepare(Request("lander_vertical", controller=str(file))), tmp_path / FILE_NAME)
        why(tmp_path, "", "", 0.0, 1000.0, trust=True, as_json=True)
        return {row["transition"] for row in json.loads(capsys.readouterr().out)["rows"] if not row["taken"]}

    def tried(file: Path) -> set[str]:
        found = failing_story(StoryChoices(parse(file.read_text()), is_strict=True), 100)
        return set() if found is None else {str(found[1])}

    return {"check": check, "explore": explored, "coverage": coverage, "why": explained, "try": tried}


@pytest.mark.parametrize(
    ("file", "tool", "found"),
    [
        (
            "hidden_transition",
            "check",
            "Transition 'retry' is never taken: 'coasting->burning' in line 11 comes first.",
        ),
        ("hidden_transition", "explore", "hidden retry"),
        ("dead_end", "check", "State 'braking' cannot be left."),
        ("dead_end", "explore", "dead_end braking"),
        ("unset_variable", "explore", "never hovers"),
        ("race", "explore", "violated enough_power"),
        pytest.param(
            "race", "try", "Line 23, enough_power: it must always hold, and does not.", marks=pytest.mark.slow
        ),
        pytest.param(
            "unsent_value",
            "try",
            "Line 10, limit_mps = signal[0]: IndexError: tuple index out of range",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_tool_finds_what_is_planted_and_nothing_else(tools: dict[str, Tool], file: str, tool: str, found: str) -> None:
    assert tools[tool](PLANTED / f"{file}.lrp") == {found}


@pytest.mark.slow
def test_coverage_finds_the_state_that_no_seed_reaches(tools: dict[str, Tool]) -> None:
    file = PLANTED / "unreached_state.lrp"
    assert tools["coverage"](file) == {"state too_high", "coasting->too_high", "too_high->burning"}
    assert tools["explore"](file) == set()  # it is up to the scenario


@pytest.mark.slow
def test_why_names_the_transition_that_is_never_taken(tools: dict[str, Tool]) -> None:
    assert tools["why"](PLANTED / "wrong_sign.lrp") == {"coasting->burning"}


@pytest.mark.slow
@pytest.mark.parametrize("tool", ["check", "explore", "coverage", "why", "try"])
@pytest.mark.parametrize("file", SOUND)
def test_tool_finds_nothing_in_a_sound_program(tools: dict[str, Tool], file: str, tool: str) -> None:
    assert tools[tool](PLANTED / f"{file}.lrp") == set()
