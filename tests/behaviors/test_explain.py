"""Why a transition was not taken: each condition with the values of its parts, by executing a run again."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from snr_sim.behaviors import Interpreter, after, machine, on, parse, state
from snr_sim.behaviors.explain import EvaluationLog, summary
from snr_sim.cli.machine_why import why
from snr_sim.prelude.errors import ParameterError, UnknownNameError
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded

TEXT = """(var near := [20])
(def reading [12.5 + near])
(machine m
  (event close [reading() < near and not done])
  (var done := [False])
  (state a)
  (state b)
  (on close a -> b)
  (on [random() < 0.0] a -> b)
  (ontime 500 a -> b late)
  (on [1 / (near - 20) > 1] a -> b broken))
(spawn m a)
"""


def looked_at(text: str, times_ms: list[int], **selection: str) -> EvaluationLog:
    evaluations = EvaluationLog(0, 10**12, **selection)
    interpreter = Interpreter(parse(text), evaluations=evaluations)
    interpreter.spawn(0)
    for time_ms in times_ms:
        interpreter.step(time_ms * 1_000_000)
    return evaluations


def test_values_of_parts_are_those_of_the_step() -> None:
    evaluations = looked_at(TEXT.replace("random()", "near"), [100, 600])
    rows = [(one.transition, one.is_true, one.values) for one in evaluations.found if one.t_ns == 100_000_000]
    assert rows == [
        ("a->b", False, {"reading()": "32.5", "near": "20", "done": "False"}),
        ("a->b", False, {"near": "20"}),
        ("late", False, {}),
        ("broken", False, {"near": "20"}),
    ]
    last = [one for one in evaluations.found if one.t_ns == 600_000_000]
    assert [(one.transition, one.is_true) for one in last] == [("a->b", False), ("a->b", False), ("late", True)]
    assert "ZeroDivisionError" in next(one for one in evaluations.found if one.transition == "broken").error


def test_time_out_that_is_computed_is_shown_with_what_it_is_computed_from() -> None:
    text = "(var turn_ms := [30])(machine m (state a) (state b) (ontime [turn_ms * 2] a -> b))(spawn m a)"
    (one,) = looked_at(text, [20]).found
    assert (one.elapsed_ns, one.after_ns, one.is_true, one.values) == (20_000_000, 60_000_000, False, {"turn_ms": "30"})
    (row,) = summary([one])
    assert (row["after_s"], row["values"]) == (0.06, {"turn_ms": "30"})


def test_random_numbers_are_not_drawn_twice() -> None:
    import numpy as np

    draws = []
    for evaluations in (None, EvaluationLog(0, 10**12)):
        rng = np.random.default_rng(1)
        interpreter = Interpreter(parse(TEXT), rng=rng, evaluations=evaluations)
        interpreter.spawn(0)
        interpreter.step(1_000_000)
        draws.append(rng.random())
    assert draws[0] == draws[1]


def test_steps_are_the_same_while_they_are_logged() -> None:
    made = machine(
        "m",
        "a",
        [state("a", on("go", to="b"), after(0.5, to="b")), state("b", after(0.2, to="a"), on("go", to="a"))],
    )
    changes = []
    for evaluations in (None, EvaluationLog(0, 10**12)):
        interpreter = Interpreter(made, evaluations=evaluations)
        found = interpreter.spawn(0)
        for i in range(1, 300):
            found += interpreter.step(i * 10_000_000, "go" if i % 37 == 0 else None)
        changes.append(found)
    assert changes[0] == changes[1]
    assert len(changes[0]) > 8


def test_only_what_is_asked_for_is_kept() -> None:
    assert {one.target for one in looked_at(TEXT, [100], target="b").found} == {"b"}
    assert looked_at(TEXT, [100], target="c").found == []
    assert looked_at(TEXT, [100], machine="other").found == []


def test_summary_counts_and_gives_ranges() -> None:
    text = TEXT.replace("(state a)", "(state a (running [near = near + 1]))").replace("random()", "near")
    rows = summary(looked_at(text, [10, 20, 30]).found)
    assert [(row["transition"], row["evaluated"], row["taken"]) for row in rows] == [
        ("a->b", 3, 0), ("a->b", 3, 0), ("late", 3, 0), ("broken", 3, 0),
    ]  # fmt: skip
    assert rows[0]["values"]["near"] == "20 to 22"
    assert rows[2]["after_s"] == 0.5


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    assert run_recorded(prepare(Request("dora_wall", 1)), folder / FILE_NAME).success
    return folder


def test_run_is_explained_at_a_moment(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    why(run, "dora", "", 1.0, 1.02, trust=True, as_json=False)
    shown = capsys.readouterr().out
    assert "dora in forward for" in shown
    assert "forward->stopped" in shown
    assert "robot.ultra.read() = " in shown
    assert "near_cm = 40" in shown


def test_run_is_explained_over_an_interval(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    why(run, "", "stopped", 0.0, 60.0, trust=True, as_json=False)
    shown = capsys.readouterr().out
    assert "taken 1 times" in shown
    why(run, "", "stopped", 0.0, 60.0, trust=True, as_json=True)
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert (row["taken"], row["target"]) == (1, "stopped")
    low, high = map(float, row["values"]["robot.ultra.read()"].split(" to "))
    assert low < 40.0 < 100.0 < high


def test_wrong_questions_are_answered(run: Path, record_scenario: object, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'dora'"):
        why(run, "dorra", "", 0.0, 1.0, trust=True, as_json=False)
    with pytest.raises(ParameterError, match="interval"):
        why(run, "", "", 2.0, 1.0, trust=True, as_json=False)
    with pytest.raises(UnknownNameError, match="no state machine"):
        why(record_scenario().path.parent, "", "", 0.0, 1.0, trust=True, as_json=False)  # type: ignore[operator]
    with pytest.raises(UnknownNameError, match="did you mean 'stopped'"):
        why(run, "dora", "stoped", 0.0, 1.0, trust=True, as_json=False)
    why(run, "dora", "waiting", 0.0, 9.0, trust=True, as_json=False)
    assert "no transition was looked at" in capsys.readouterr().out
