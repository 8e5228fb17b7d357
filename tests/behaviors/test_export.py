"""Drawings: another tool that reads our SCXML goes through the same states; mermaid and DOT name everything."""

from __future__ import annotations

import re
from typing import Any

from snr_sim.behaviors import (
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
