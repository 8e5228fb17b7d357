"""Drawings: another tool that reads our SCXML goes through the same states; mermaid and DOT name everything."""

from __future__ import annotations

import hashlib
import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.behaviors import (
    Interpreter,
    Program,
    after,
    always,
    draw,
    exits,
    machine,
    on,
    parse,
    side_by_side,
    state,
)
from snr_sim.behaviors.export import as_text
from snr_sim.behaviors.program import ANY, MachineDef, Place, Spawn, StateDef, Transition


def is_near(m: Any) -> bool:
    return True


def beep(m: Any) -> None: ...


SCAN = machine("scan", "left", [state("left", after(0.1, to="right"), exits(on("lost", to="home"))), state("right")])
MISSION = machine(
    "mission",
    "look",
    [
        state("look", on(is_near, to="grab", do=beep), machines=[SCAN, SCAN], enter=beep, during=beep, leave=beep),
        state("grab", always(to="home"), after(2.5, to="look", when=is_near)),
        state("home", on("go", to="look")),
    ],
    anywhere=[on("stop", to="home")],
    variables={"gate": 3},
)


def test_listing_has_everything_that_the_program_says() -> None:
    assert draw(MISSION, "text").splitlines() == [
        "(machine mission",
        "  (var gate := [3])",
        "  (state look",
        "    (onentry [beep])",
        *2 * [
            "    (machine scan",
            "      (state left",
            "      )",
            "      (state right",
            "      )",
            "      (ontime 100 left -> right left->right)",
            "      (exit lost left -> home left->home)",
            "    )",
            "    (onentry (spawn scan left))",
        ],
        "    (running [beep])",
        "    (onexit [beep])",
        "  )",
        "  (state grab",
        "  )",
        "  (state home",
        "  )",
        "  (on stop * -> home *->home)",
        "  (on [is_near] look -> grab look->grab [beep])",
        "  (eps grab -> home grab->home)",
        "  (ontime 2500 [is_near] grab -> look grab->look)",
        "  (on go home -> look home->look)",
        ")",
        "(spawn mission look)",
    ]  # fmt: skip


def test_mermaid_draws_each_arrow_once() -> None:
    lines = [line.strip() for line in draw(MISSION).splitlines()]
    assert lines[0] == "stateDiagram-v2"
    assert sorted(line for line in lines if "mission_" in line and "-->" in line and "scan" not in line) == [
        "[*] --> mission_look",
        "mission_grab --> mission_home : at once",
        "mission_grab --> mission_home : stop",
        "mission_grab --> mission_look : after 2.5 s [is_near]",
        "mission_home --> mission_look : go",
        "mission_look --> mission_grab : [is_near] / beep",
        "mission_look --> mission_home : stop",
    ]
    assert lines.count("--") == 1  # between the two machines in one state
    assert "note right of mission_look_scan_2_left : lost, leaves to home" in lines


def test_dot_has_a_box_for_each_state_and_arrows_between_boxes_only() -> None:
    text = draw(MISSION, "dot")
    boxes = set(re.findall(r'"([^"]+)" \[(?:label|shape)', text))
    ends = set(re.findall(r'"([^"]+)" ->', text)) | set(re.findall(r'-> "([^"]+)"', text))
    assert ends <= boxes
    assert {"mission/look", "mission/look/scan#2/left", "mission/home"} <= boxes
    assert text.count("{") == text.count("}")


def test_time_outs_are_delayed_events_that_leaving_cancels() -> None:
    text = draw(MISSION, "scxml")
    assert '<send id="after.mission.grab.2" event="after.mission.grab.2" delay="2500ms"/>' in text
    assert '<cancel sendid="after.mission.grab.2"/>' in text


# -- another tool -----------------------------------------------------------------------------------------------------
#
# The common subset: signals. A machine inside has signals of its own, and exits others again, since in SCXML an inner
# transition wins over an outer one. Only a machine that is alone in its state exits: of two that exit at once, tools
# choose differently.


@st.composite
def machines(draw: Any, depth: int, around: list[str] | None) -> Spawn:
    names = ["a", "b", "c"][: draw(st.integers(1, 3))]
    signals = [f"s{depth}", f"t{depth}"]
    states = []
    for name in names:
        count = draw(st.integers(0, 2)) if depth else 0
        targets = names if count == 1 else None
        states.append(StateDef(name, tuple(draw(machines(depth - 1, targets)) for _ in range(count))))
    arrows = []
    for _ in range(draw(st.integers(0, 5))):
        source = draw(st.sampled_from([ANY, *names]))
        if around and draw(st.booleans()):
            arrows.append(Transition("exit", source, draw(st.sampled_from(around)), "", Place(), f"e{depth}"))
        else:
            arrows.append(
                Transition("on", source, draw(st.sampled_from(names)), "", Place(), draw(st.sampled_from(signals)))
            )
    return Spawn(
        MachineDef(draw(st.sampled_from(["m", "n"])), tuple(states), tuple(arrows)), draw(st.sampled_from(names))
    )


@given(
    st.lists(machines(2, None), min_size=1, max_size=2),
    st.lists(st.sampled_from([f"{kind}{depth}" for kind in "ste" for depth in range(3)]), max_size=40),
)
def test_another_tool_that_reads_our_scxml_is_in_the_same_states(spawns: list[Spawn], word: list[str]) -> None:
    pytest.importorskip("statemachine")
    from statemachine.io.scxml.processor import SCXMLProcessor

    text = as_text(tuple(spawns))
    program = Program(text, hashlib.sha256(text.encode()).hexdigest(), tuple(spawns))
    processor = SCXMLProcessor()
    processor.parse_scxml("machine", draw(program, "scxml"))
    theirs, ours = processor.start(), Interpreter(program)
    ours.spawn(0)
    for i, signal in enumerate(["", *word]):
        if signal:
            theirs.send(signal)
            ours.step(i, signal)
        due = {"all"}
        for path, name in ours.active.items():
            due |= {one.replace("/", ".").replace("#", ".") for one in (path, f"{path}/{name}")}
        assert {one.id for one in theirs.configuration} == due, signal


def test_machines_side_by_side_are_drawn_side_by_side() -> None:
    text = draw(side_by_side(MISSION, MISSION), "scxml")
    assert '<state id="mission.2" initial="mission.2.look">' in text


def test_states_whose_names_differ_by_a_sign_are_two_in_mermaid() -> None:
    made = machine("m", "go-on", [state("go-on", on("x", to="go_on")), state("go_on", on("x", to="go-on"))])
    drawn = draw(made)
    assert "    m_go_on --> m_go_on_ : x" in drawn
    assert "    m_go_on_ --> m_go_on : x" in drawn


def test_code_of_a_text_is_that_of_the_text() -> None:
    """Its lines as well: joined by blanks they mean something else."""
    block = """[x = 1
          if x:
            robot.stop()]"""
    text = f"(var x := [0])(machine m (state a (onexit {block})) (state b) (on [x is not None] a -> b))(spawn m a)"
    drawn = draw(parse(text), "scxml")
    assert "cond='x is not None'" in drawn or 'cond="x is not None"' in drawn
    assert "<script>x = 1\nif x:\n  robot.stop()</script>" in drawn
    assert "(onexit [x = 1\nif x:\n  robot.stop()])" in draw(parse(text), "text")
