"""Random stories of state machines: the shortest that fails is found and printed as a test, which fails, too."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer
from hypothesis import Phase, settings
from hypothesis.stateful import run_state_machine_as_test

from snr_sim.behaviors import Bridge, Interpreter, Read, after, machine, on, parse, state
from snr_sim.cli.machine import machine as machine_verb
from snr_sim.prelude.errors import MissingExtraError, ParameterError
from snr_sim.testing.machines import MachineStory, StoryChoices, failing_story, random_stories

# Fails after two signals with a time-out between them.
LAMP = """(var lit := [0])
(machine lamp
  (event on) (event off)
  (state dark (onentry [lit = 0]))
  (state bright (onentry [lit = 1]))
  (state dim)
  (on on dark -> bright)
  (ontime 500 bright -> dim)
  (on off bright -> dark)
  (on [robot.light.read() > 40] dim -> dark)
  (on on dim -> bright twice))
(always off_when_dim [not (lit == 1 and in_state_ms > 700)])
(spawn lamp dark)
"""
SOUND = LAMP.replace("in_state_ms > 700", "in_state_ms < 0")


def reason_of(act: Callable[[], Any]) -> str:
    with pytest.raises(AssertionError) as caught:
        act()
    return str(caught.value)


def test_story_takes_steps_with_signals_readings_and_time() -> None:
    story = MachineStory(parse(SOUND))
    story.signal("on")
    story.wait(499.0)
    assert story.interpreter.active == {"lamp": "bright"}
    story.wait(1.0)
    story.read("light", 40)
    story.set("lit", 0)
    assert story.interpreter.active == {"lamp": "dim"}
    story.read("light", 41)
    assert story.interpreter.active == {"lamp": "dark"}
    assert story.calls[:3] == [("signal", ("on",)), ("wait", (499.0,)), ("wait", (1.0,))]


def test_pause_lets_no_time_out_advance() -> None:
    story = MachineStory(parse(SOUND))
    story.signal("on")
    story.pause(10_000.0)
    story.wait(499.0)
    assert story.interpreter.active == {"lamp": "bright"}
    story.wait(1.0)
    assert story.interpreter.active == {"lamp": "dim"}


def test_text_that_is_saved_again_keeps_states_and_variables() -> None:
    story = MachineStory(parse(SOUND))
    story.signal("on")
    story.save_again()
    story.wait(500.0)
    assert (story.interpreter.active, story.interpreter.variables) == ({"lamp": "dim"}, {"lit": 1})


def test_rule_that_does_not_hold_fails_the_story() -> None:
    story = MachineStory(parse(LAMP))
    story.signal("on")
    story.wait(500.0)
    assert reason_of(lambda: story.wait(701.0)) == "Line 12, off_when_dim: it must always hold, and does not."


def test_block_that_fails_counts_in_a_strict_story_only() -> None:
    program = parse(SOUND.replace("[lit = 1]", "[lit = signal[0]]"))
    MachineStory(program).signal("on")
    story = MachineStory(program, is_strict=True)
    assert "IndexError" in reason_of(lambda: story.signal("on"))


def test_step_that_a_snapshot_does_not_repeat_fails_the_story(monkeypatch: pytest.MonkeyPatch) -> None:
    story = MachineStory(parse(SOUND))
    monkeypatch.setattr(Interpreter, "restore", lambda self, snapshot: None)
    story._twin.set("lit", 1)
    assert "from a snapshot" in reason_of(lambda: story.wait(1.0))


@pytest.mark.slow
def test_shortest_story_is_found_and_fails_as_a_test(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "lamp.lrp").write_text(LAMP)
    with pytest.raises(typer.Exit) as caught:
        machine_verb("try", str(tmp_path / "lamp.lrp"), cases=100)
    assert caught.value.exit_code == 1
    text = capsys.readouterr().out
    assert text.startswith("# Line 12, off_when_dim: it must always hold, and does not.\nfrom pathlib import Path\n")
    calls = re.findall(r"    story\.(\w+)\(.*\n", text)
    assert calls[0] == "signal"
    assert 3 <= len(calls) <= 5  # it is lit, it dims, and time passes
    names: dict[str, Any] = {"__file__": str(tmp_path / "test_lamp.py")}
    exec(compile(text, "test_lamp.py", "exec"), names)
    assert reason_of(names["test_lamp"]) == "Line 12, off_when_dim: it must always hold, and does not."
    (tmp_path / "lamp.lrp").write_text(SOUND)
    names["test_lamp"]()
    machine_verb("try", str(tmp_path / "lamp.lrp"), cases=30, as_json=True)
    assert json.loads(capsys.readouterr().out) == {"cases": 30, "reason": None}


PYTHON = """
from snr_sim.behaviors import after, machine, on, state


def sink(m):
    raise ValueError("too deep") if m.data("depth") > 3 else None


DIVE = machine("dive", "up", [state("up", on("go", to="down")), state("down", after(1.0, to="up"), during=sink)])
"""


@pytest.mark.slow
def test_machine_in_python_takes_readings_that_are_given(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def sink(m: Any) -> None:
        assert m.data("depth") != 5, "too deep"

    made = machine("dive", "up", [state("up", on("go", to="down")), state("down", after(1.0, to="up"), during=sink)])
    found = failing_story(StoryChoices(made, readings={"depth": [1, 5]}), 100)
    assert found is not None
    assert [call for call in found[0] if call[0] != "wait"] in (
        [("read", ("depth", 5)), ("signal", ("go",))],
        [("signal", ("go",)), ("read", ("depth", 5))],
    )
    (tmp_path / "dive.py").write_text(PYTHON)
    with pytest.raises(typer.Exit):
        machine_verb("try", str(tmp_path / "dive.py"), cases=50)
    assert "from dive import DIVE\n" in capsys.readouterr().out  # it reads a page that nothing has stored


def test_variables_are_set_only_if_their_values_are_given() -> None:
    program = parse(SOUND.replace("(spawn lamp dark)", "(always small [lit < 5])(spawn lamp dark)"))
    assert failing_story(StoryChoices(program), 5) is None
    found = failing_story(StoryChoices(program, sets={"lit": [4, 7]}), 20)
    assert found is not None
    assert len(found[0]) == 2  # and a step, after which the rule is looked at
    assert found[0][0] == ("set", ("lit", 7))


def test_readings_are_drawn_from_the_limits_of_the_bridge() -> None:
    program = parse(SOUND.replace("> 40", "> 90"))
    assert failing_story(StoryChoices(program, bridge=Bridge({"light": Read("x", low=0, high=50)})), 1) is None
    drawn = StoryChoices(program, bridge=Bridge({"light": Read("x", low=0, high=50)}))
    assert max_reading(drawn) == 50
    assert max_reading(StoryChoices(program)) == 1000


def max_reading(choices: StoryChoices) -> float:
    return max(float(value) for _, value in choices.readings if value is not None)


@pytest.mark.slow
def test_suite_of_hypothesis_finds_a_story_that_fails() -> None:
    with pytest.raises(AssertionError, match="it must always hold, and does not"):
        run_state_machine_as_test(
            random_stories(StoryChoices(parse(LAMP.replace("> 700", ">= 0")))),
            settings=settings(derandomize=True, database=None, phases=[Phase.generate]),
        )


def test_program_that_fails_at_once_is_a_story_without_calls() -> None:
    found = failing_story(StoryChoices(parse(SOUND.replace("(spawn", "(always never [lit > 5])(spawn"))), 1)
    assert found is not None
    assert (found[0], str(found[1])) == ([], "Line 13, never: it must always hold, and does not.")


def test_missing_hypothesis_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hypothesis", None)
    with pytest.raises(MissingExtraError, match="hypothesis"):
        random_stories(StoryChoices(parse(SOUND)))


def test_number_of_stories_has_limits(tmp_path: Path) -> None:
    (tmp_path / "lamp.lrp").write_text(SOUND)
    with pytest.raises(ParameterError, match="--cases 0"):
        machine_verb("try", str(tmp_path / "lamp.lrp"), cases=0)
