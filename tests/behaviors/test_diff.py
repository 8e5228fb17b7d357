"""What differs between two programs: what a change of its text changes, and nothing else."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer

from snr_sim.behaviors import machine, on, parse, state
from snr_sim.behaviors.diff import differences
from snr_sim.cli.machine import machine as machine_verb

TEXT = """(var near := [20])
(def close [robot.ultra.read() < near])
(always positive [near > 0])
(machine m
  (var turns := [0])
  (event wall [close()])
  (state a (onentry [robot.motor.start(near)]))
  (state b (running [turns = turns + 1])
    (machine inner (state x) (state y) (ontime 100 x -> y))
    (onentry (spawn inner x)))
  (state c)
  (on wall a -> b)
  (ontime 300 b -> c late)
  (on [turns > 3] b -> a)
  (eps c -> a))
(spawn m a)
"""


def rows(text: str) -> list[tuple[str, str, str]]:
    return [(one.what, one.name, one.how) for one in differences(parse(TEXT), parse(text))]


def test_comments_lines_and_white_space_make_no_difference() -> None:
    moved = TEXT.replace("(machine m", "; a comment\n\n(machine m").replace("near > 0", " near>0 ")
    assert rows(moved) == []


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        (":= [20]", ":= [30]", [("variable", "near", "changed")]),
        ("(var turns := [0])", "(var turns := [0]) (var x := [1])", [("variable", "x", "added")]),
        ("start(near)", "start(5)", [("state", "a", "onentry changed")]),
        ("(state c)", "(state c) (state d)", [("state", "d", "added")]),
        ("300 b", "400 b", [("transition", "late", "changed")]),
        ("  (eps c -> a)", "", [("transition", "c->a", "removed")]),
        ("(event wall [close()])", "(event wall [not close()])", [("transition", "a->b", "changed")]),
        ("read() < near]", "read() < 2 * near]", [("transition", "a->b", "changed")]),
        ("(ontime 100 x", "(ontime 200 x", [("transition", "x->y", "changed")]),
        ("(spawn m a)", "(spawn m b)", [("machine", "m", "begins in b, not a")]),
        ("(spawn m a)", "(onerror stop) (spawn m a)", [("program", "onerror", "go_on is now stop")]),
        ("near > 0", "near > 1", [("rule", "always positive", "changed")]),
    ],
)
def test_change_is_named(old: str, new: str, found: list[tuple[str, str, str]]) -> None:
    assert rows(TEXT.replace(old, new)) == found


def test_renamed_state_is_named_as_renamed() -> None:
    text = TEXT.replace("(state c)", "(state away)").replace("b -> c", "b -> away").replace("eps c", "eps away")
    assert rows(text) == [("state", "c", "renamed to away")]


def test_order_of_transitions_is_a_difference() -> None:
    late, back = "(ontime 300 b -> c late)", "(on [turns > 3] b -> a)"
    text = TEXT.replace(late, "LATE").replace(back, late).replace("LATE", back)
    assert rows(text) == [("machine", "m", "order of its transitions changed")]


def test_machine_that_goes_is_named_by_its_path() -> None:
    text = TEXT.replace("(onentry (spawn inner x))", "")
    assert ("machine", "m/b/inner", "removed") in rows(text)


def test_second_transition_of_a_name_has_a_number() -> None:
    made = machine("m", "a", [state("a", on("p", to="b"), on("q", to="b")), state("b")])
    other = machine("m", "a", [state("a", on("p", to="b"), on("r", to="b")), state("b")])
    assert [(one.name, one.how) for one in differences(made, other)] == [("a->b #2", "changed")]


def test_verb_prints_differences_and_exits_with_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.lrp").write_text(TEXT)
    (tmp_path / "b.lrp").write_text(TEXT.replace("300 b", "400 b"))
    files = str(tmp_path / "a.lrp"), str(tmp_path / "b.lrp")
    machine_verb("diff", files[0], other=files[0])
    assert capsys.readouterr().out == "no differences\n"
    with pytest.raises(typer.Exit):
        machine_verb("diff", files[0], other=files[1])
    assert capsys.readouterr().out.splitlines() == [f"{files[1]}:13: m: transition late changed", "1 difference"]
    with pytest.raises(typer.Exit):
        machine_verb("diff", files[0], other=files[1], as_json=True)
    assert json.loads(capsys.readouterr().out)["differences"][0]["name"] == "late"
