"""What machines reach over several seeds: states, transitions, conditions that were false, time-outs never due."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer

from snr_sim.behaviors import Interpreter, draw, exits, machine, on, parse, state
from snr_sim.behaviors.coverage import Coverage
from snr_sim.cli.machine import machine as machine_verb
from snr_sim.cli.machine_coverage import coverage
from snr_sim.cli.machine_why import why
from snr_sim.prelude.errors import ParameterError, UnknownNameError
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded

TEXT = """(var n := [0])
(machine m
  (event go)
  (state a (running [n = n + 1])) (state b) (state c)
  (on go a -> b)
  (on [n > 3] a -> b by_count)
  (ontime 1000 a -> c)
  (on [n > 100] b -> c))
(spawn m a)
"""


def covered(text: str, steps: int, signals: dict[int, str] | None = None) -> Coverage:
    counted = Coverage()
    interpreter = Interpreter(parse(text), evaluations=counted)
    interpreter.spawn(0)
    for i in range(1, steps + 1):
        interpreter.step(i * 10_000_000, (signals or {}).get(i))
    return counted


def test_states_and_transitions_are_counted() -> None:
    report = covered(TEXT, 10).report(parse(TEXT))
    assert {row["state"]: row["is_reached"] for row in report["states"]} == {"a": True, "b": True, "c": False}
    rows = {row["transition"]: (row["evaluated"], row["taken"], row["was_false"]) for row in report["transitions"]}
    assert rows == {"a->b": (0, 0, 0), "by_count": (5, 1, 4), "a->c": (4, 0, 0), "b->c": (5, 0, 5)}
    assert report["percent"] == pytest.approx(100.0 * 3 / 7)


def test_several_runs_count_together() -> None:
    counted = covered(TEXT, 10)
    interpreter = Interpreter(parse(TEXT), evaluations=counted)
    interpreter.spawn(0)
    interpreter.step(1, "go")
    rows = {row["transition"]: row["taken"] for row in counted.report(parse(TEXT))["transitions"]}
    assert rows == {"a->b": 1, "by_count": 1, "a->c": 0, "b->c": 0}


def test_conditions_count_in_all_transitions_that_name_them() -> None:
    text = TEXT.replace("(event go)", "(event many [n > 3])").replace("go a", "many a").replace("[n > 100] b", "many b")
    (many, by_count) = covered(text, 10).report(parse(text))["conditions"]
    assert (many["condition"], many["was_true"], many["was_false"]) == ("many", 2, 4)
    assert (by_count["condition"], by_count["was_true"], by_count["was_false"]) == ("n > 3", 0, 4)


def test_time_out_is_cancelled_when_its_state_is_left_before() -> None:
    text = TEXT.replace("[n > 100] b -> c", "[in_state_ms >= 20] b -> a").replace("[n > 3]", "[in_state_ms >= 30]")
    (time_out,) = covered(text, 40).report(parse(text))["time_outs"]
    assert (time_out["fired"], time_out["cancelled"], time_out["longest_s"]) == (0, 7, 0.02)
    fired = covered(text.replace("1000 a", "20 a"), 40, {1: "go"}).report(parse(text.replace("1000 a", "20 a")))
    assert (fired["time_outs"][0]["fired"], fired["time_outs"][0]["cancelled"]) == (1, 0)


def test_exit_reaches_the_state_around_and_spawned_machines_begin() -> None:
    inner = machine("inner", "x", [state("x", exits(on("out", to="b")))])
    made = machine("outer", "a", [state("a", machines=[inner]), state("b")])
    counted = Coverage()
    interpreter = Interpreter(made, evaluations=counted)
    interpreter.spawn(0)
    report = counted.report(made)
    assert {(row["machine"], row["state"]) for row in report["states"] if row["is_reached"]} == {
        ("outer", "a"), ("outer/a/inner", "x"),
    }  # fmt: skip
    interpreter.step(1, "out")
    assert counted.report(made)["percent"] == 100.0


BACK_AND_FORTH = TEXT.replace("[n > 100] b -> c", "[in_state_ms >= 20] b -> a").replace(
    "[n > 3]", "[in_state_ms >= 30]"
)


def test_pairs_of_transitions_are_counted_within_a_run() -> None:
    counted = covered(BACK_AND_FORTH, 40)
    again = Interpreter(parse(BACK_AND_FORTH), evaluations=counted)
    again.spawn(0)
    for i in range(1, 41):
        again.step(i * 10_000_000)
    rows = {(row["first"], row["then"]): row["taken"] for row in counted.report(parse(BACK_AND_FORTH))["pairs"]}
    assert rows == {
        ("a->b", "b->a"): 0, ("by_count", "b->a"): 16,
        ("b->a", "a->b"): 0, ("b->a", "by_count"): 14, ("b->a", "a->c"): 0,
    }  # fmt: skip


def test_pair_of_an_exit_begins_inside_and_continues_around() -> None:
    inner = machine("inner", "x", [state("x", on("in", to="y")), state("y", exits(on("out", to="b")))])
    made = machine("outer", "a", [state("a", machines=[inner]), state("b", on("back", to="a"))])
    counted = Coverage()
    interpreter = Interpreter(made, evaluations=counted)
    interpreter.spawn(0)
    for i, signal in enumerate(("in", "out", "back", "in", "out")):
        interpreter.step(i + 1, signal)
    rows = {(row["first"], row["then"]): row["taken"] for row in counted.report(made)["pairs"]}
    assert rows == {("x->y", "y->b"): 2, ("y->b", "b->a"): 1}


def test_drawing_shows_counts_and_states_that_were_not_reached() -> None:
    counts = covered(BACK_AND_FORTH, 40).counts(parse(BACK_AND_FORTH))
    mermaid = draw(parse(BACK_AND_FORTH), "mermaid", counts)
    assert "m_a --> m_b : go (0 times)" in mermaid
    assert "m_b --> m_a : [in_state_ms >= 20] (8 times)" in mermaid
    assert [line.strip() for line in mermaid.splitlines() if "unreached" in line] == [
        "class m_c unreached", "classDef unreached fill:#eee,color:#777,stroke-dasharray:4",
    ]  # fmt: skip
    dot = draw(parse(BACK_AND_FORTH), "dot", counts)
    assert '"m/c" [label="c", style="rounded,dashed", fontcolor=gray];' in dot
    assert '"m/b" [label="b"];' in dot


def test_verb_draws_what_was_reached(inside: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine_verb("coverage", "lander_vertical", seeds="0", controller=str(inside), to="dot")
    shown = capsys.readouterr().out
    assert '"fall/high" -> "fall/low" [label="[is_low] (1 times)"];' in shown
    with pytest.raises(UnknownNameError, match="no format 'scxml'"):
        machine_verb("coverage", "lander_vertical", to="scxml")


@pytest.mark.slow
def test_verb_runs_seeds_and_names_what_was_not_reached(capsys: pytest.CaptureFixture[str]) -> None:
    coverage("dora_wall", "1..3", "", 0.0, as_json=False)
    shown = capsys.readouterr().out
    assert "runs: 3 stopped" in shown
    assert "dora: 100 %: 3 of 3 states, 2 of 2 transitions" in shown
    with pytest.raises(typer.Exit):
        coverage("dora_wall", "1", "explorer", 90.0, as_json=True)
    report = json.loads(capsys.readouterr().out)["machines"]["dora"]
    assert report["percent"] < 90.0
    assert "bump" in [row["condition"] for row in report["conditions"] if not row["was_true"]]
    assert {row["state"]: row["is_reached"] for row in report["states"]}["backing"] is False


@pytest.mark.parametrize("seeds", ["", "a", "3..1", "0..100000", "-1", "1..", "1.5"])
def test_wrong_seeds_are_refused(seeds: str) -> None:
    with pytest.raises(ParameterError, match=r"0\.\.19"):
        coverage("dora_wall", seeds, "", 0.0, as_json=False)


def test_controller_without_machine_is_named(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="no state machine"):
        coverage("lander_vertical", "0", "", 0.0, as_json=False)


INSIDE = """
from snr_sim import Endpoint, handles
from snr_sim.behaviors import Interpreter, machine, on, state

def is_low(m):
    return m.data("altitude_m") < 500.0

FALL = machine("fall", "high", [state("high", on(is_low, to="low")), state("low", on("never", to="high"))])

class Pilot(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.radar = {}
        self.interpreter = Interpreter(FALL, self.radar)
        self.interpreter.spawn(0)

    @handles("radar")
    def on_radar(self, radar):
        self.radar.update(altitude_m=radar["altitude_m"])
        self.interpreter.step(round(self.get_time_s() * 1e9))

def factories(robot):
    return [Pilot.factory()]
"""


@pytest.fixture
def inside(tmp_path: Path) -> Path:
    """A controller with an interpreter inside a component."""
    file = tmp_path / "inside.py"
    file.write_text(INSIDE)
    return file


def test_interpreter_inside_a_component_is_counted(inside: Path, capsys: pytest.CaptureFixture[str]) -> None:
    coverage("lander_vertical", "0..1", str(inside), 0.0, as_json=True)
    report = json.loads(capsys.readouterr().out)["machines"]["fall"]
    assert [row["taken"] for row in report["transitions"]] == [2, 0]
    assert report["percent"] == 75.0


def test_verb_names_conditions_and_time_outs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, rest = tmp_path / "fall.py", 'state("low", after(90.0, to="high", when=is_low))'
    text = INSIDE.replace("behaviors import", "behaviors import after,").replace("on(is_low", "on(lambda m: True")
    file.write_text(text.replace('state("low", on("never", to="high"))', rest))
    coverage("lander_vertical", "0", str(file), 0.0, as_json=False)
    shown = capsys.readouterr().out
    assert "fall: the time of low->high in low was never over: " in shown
    assert "fall: condition lambda in line" in shown
    assert "was never false" in shown
    assert "0 of 2 pairs of transitions in sequence" in shown


def test_interpreter_inside_a_component_is_explained(inside: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_recorded(prepare(Request("lander_vertical", controller=str(inside))), inside.parent / FILE_NAME)
    why(inside.parent, "fall", "low", 0.0, 100.0, trust=True, as_json=False)
    assert "taken 1 times" in capsys.readouterr().out
