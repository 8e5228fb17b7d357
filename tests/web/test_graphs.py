"""Machines as drawings need them, from texts: also from texts with mistakes, listings and imported files."""

from __future__ import annotations

import pytest

from snr_sim.behaviors import after, exits, machine, on, parse, state
from snr_sim.web.graphs import MAX_STATES, graphs_of, signals_in
from snr_sim.web.messages import Graph

NESTED = """(machine outer
  (event go)
  (event near [1 < 2])
  (state a)
  (state b
    (machine scan
      (event found)
      (state left)
      (state right)
      (ontime 250 left -> right)
      (ontime speed right -> left slowly)
      (exit found left -> a))
    (onentry (spawn scan left))
    (onentry (spawn scan right)))
  (on near a -> b)
  (on [x
        > 3] * -> a)
  (eps b -> a))
(spawn outer a)
"""


def test_graph_has_states_and_transitions_with_lines_and_labels() -> None:
    (outer,) = graphs_of(NESTED)
    assert (outer.path, outer.name, outer.initial, outer.line) == ("outer", "outer", "a", 1)
    assert [(one.name, one.line) for one in outer.states] == [("a", 4), ("b", 5)]
    assert [(one.name, one.kind, one.source, one.target, one.line, one.label) for one in outer.transitions] == [
        ("a->b", "on", "a", "b", 15, "near"),
        ("*->a", "on", "*", "a", 16, "[x > 3]"),
        ("b->a", "eps", "b", "a", 18, "at once"),
    ]


def test_machines_inside_a_state_have_their_own_paths() -> None:
    (outer,) = graphs_of(NESTED)
    first, second = outer.states[1].machines
    assert (first.path, first.initial) == ("outer/b/scan", "left")
    assert (second.path, second.name, second.initial) == ("outer/b/scan#2", "scan#2", "right")
    assert [(one.name, one.kind, one.label) for one in first.transitions] == [
        ("left->right", "ontime", "after 0.25 s"),
        ("slowly", "ontime", "after speed ms"),
        ("left->a", "exit", "found"),
    ]


def paths_in(graphs: list[Graph]) -> list[str]:
    found = []
    for one in graphs:
        found.append(one.path)
        for each in one.states:
            found += paths_in(each.machines)
    return found


def test_paths_equal_those_of_the_program() -> None:
    program = parse(NESTED.replace("speed", "300").replace("[x\n        > 3]", "[1 > 3]"))
    assert paths_in(graphs_of(program.text)) == [path for path, _ in program.walk()]


def is_near(m: object) -> bool:
    return False


SCAN = machine("scan", "left", [state("left", after(0.5, to="right")), state("right", exits(on("lost", to="home")))])
LOOK = machine("look", "home", [state("home", on(is_near, to="away")), state("away", machines=[SCAN])])


def test_listing_of_a_machine_in_python_gives_its_graph() -> None:
    (look,) = graphs_of(LOOK.text)
    assert paths_in([look]) == [path for path, _ in LOOK.walk()]
    assert [(one.name, one.label) for one in look.transitions] == [("home->away", "[is_near]")]
    scan = look.states[1].machines[0]
    assert [(one.name, one.kind, one.label) for one in scan.transitions] == [
        ("left->right", "ontime", "after 0.5 s"),
        ("right->home", "exit", "lost"),
    ]


@pytest.mark.parametrize(
    ("text", "states"),
    [
        (NESTED.replace("(state a)", "(state a"), None),
        (NESTED.replace("(on near a -> b)", "(on near a ->)"), ["a", "b"]),
        (NESTED.replace("-> b)", "-> nowhere)"), ["a", "b"]),
        ("(spawn outer a)", None),
        ("(machine outer)(spawn outer)", None),
        ("(machine outer)(spawn outer a)", []),
        ("(machine)(machine 3 (state))(spawn 3 a)", []),
        ("((((", None),
        ("", None),
    ],
)
def test_text_with_mistakes_gives_what_can_be_read(text: str, states: list[str] | None) -> None:
    graphs = graphs_of(text)
    if states is not None:
        assert [one.name for one in graphs[0].states] == states


def test_machine_that_spawns_itself_is_drawn_once() -> None:
    text = "(machine m (state a (onentry (spawn m a))))(spawn m a)"
    assert paths_in(graphs_of(text)) == ["m"]


def test_machines_that_multiply_are_bounded() -> None:
    spawns = "(onentry (spawn m{0} s))" * 4
    machines = (
        "".join(f"(machine m{i} (state s {spawns.format(i + 1)}))" for i in range(12)) + "(machine m12 (state s))"
    )
    assert len(paths_in(graphs_of(f"{machines}(spawn m0 s)"))) <= 5 * MAX_STATES


def test_imported_machines_are_found() -> None:
    files = {
        "turns.lrp": '(import "more.lrp")(machine turn (event stop)(state left))',
        "more.lrp": '(import "turns.lrp")',
    }
    text = '(import "turns.lrp")(machine m (event go)(state a (onentry (spawn turn left))))(spawn m a)'
    assert paths_in(graphs_of(text, files)) == ["m", "m/a/turn"]
    assert signals_in(text, files) == ["go", "stop"]


def test_signals_are_events_without_a_condition() -> None:
    assert signals_in(NESTED) == ["found", "go"]


def test_long_label_is_shortened() -> None:
    (one,) = graphs_of(f"(machine m (state a)(state b)(on [{'x + ' * 100}1] a -> b))(spawn m a)")
    assert len(one.transitions[0].label) == 80
    assert one.transitions[0].label.endswith("...")
