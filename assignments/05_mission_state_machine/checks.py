"""Checks of the lab "mission state machine": timelines of inputs at the surface, and the mission's expected states."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from snr_sim.grading import (
    Lab,
    Output,
    ScenarioRun,
    Stimulus,
    Student,
    Verdict,
    check,
    failed,
    passed,
    require_field,
    require_page,
)
from snr_sim.recording import TruthRecord
from snr_sim.scenario import library

library.load_robot(library.find("robots", "urov"))
gate_scenario: Any = library.load_scenario(library.find("scenarios", "urov_gate"))

PANEL_S, FIX_S, LEAK_S = 0.05, 0.1, 0.5
SLACK_S = 0.15  # three panel pages: the change may be handled at any of them
STOP_S = 0.5  # from the button to propellers that stand still
FLIGHT_STOP_S = 5.0
THRUSTERS = {thruster.name for thruster in gate_scenario.parameters(0).vehicle.thrusters}

# The picture in the README.
ARROWS = {
    "waiting": {"lining_up", "surfacing", "stopped"},
    "lining_up": {"passing", "holding", "surfacing", "stopped"},
    "passing": {"lining_up", "holding", "surfacing", "stopped"},
    "holding": {"lining_up", "surfacing", "stopped"},
    "surfacing": {"done", "stopped"},
    "done": {"stopped"},
    "stopped": {"waiting"},
}
STATES = tuple(ARROWS)


# -- timelines: inputs, and the expected state ------------------------------------------------------------------------


@dataclass(frozen=True)
class ExpectedSegment:
    """States that are right from a time on, and the hint for any other state."""

    from_s: float
    states: tuple[str, ...]
    hint: str


class Timeline:
    """Pages that arrive at the surface, over time.

    Args:
        seed: of the gates.
    """

    def __init__(self, seed: int) -> None:
        self.parameters = gate_scenario.parameters(seed)
        self.route = self.parameters.route
        self.pages: list[Stimulus] = []
        self.segments: list[ExpectedSegment] = []
        self.ticks = 0
        self.state = "waiting"
        self.position: list[float] | None = [-9.0, 0.0, -1.5]
        self.stop = self.reset = self.is_wet = self.is_stopped = False
        self.is_vehicle_sending = True
        self.depth_m = 1.5

    @property
    def now_s(self) -> float:
        """The time of the next pages."""
        return self.ticks * PANEL_S

    def at(self, index: int, off_m: float = 0.0) -> Timeline:
        """Put the vehicle at a point of the route, or slightly south of it."""
        goal = self.route[index]
        self.position, self.depth_m = [goal.x_m, goal.y_m - off_m, -goal.depth_m], goal.depth_m
        return self

    def be(self, state: str, seconds: float, hint: str, slack_s: float = SLACK_S, **world: Any) -> Timeline:
        """Advance the time; the mission should be in a state, or at first still in the previous one."""
        for name, value in world.items():
            setattr(self, name, value)
        if state != self.state:
            self.segments.append(ExpectedSegment(self.now_s, (self.state, state), hint))
            self.segments.append(ExpectedSegment(self.now_s + slack_s, (state,), hint))
        else:
            self.segments.append(ExpectedSegment(self.now_s, (state,), hint))
        self.state = state
        for _ in range(round(seconds / PANEL_S)):
            self._tick()
        return self

    def press(self, button: str, state: str, hint: str) -> Timeline:
        """Press a button for a moment."""
        self.be(state, 0.2, hint, **{button: True})
        setattr(self, button, False)
        return self

    def was_stopped_at(self, time_s: float) -> bool:
        """Return whether the vehicle had reported by then that it keeps a stop."""
        reported = [one.value["is_stopped"] for one in self.pages if one.key == "vehicle" and one.at_s <= time_s + 1e-9]
        return bool(reported) and bool(reported[-1])

    def _tick(self) -> None:
        now_s, each = self.now_s, self.pages.append
        if self.ticks % round(LEAK_S / PANEL_S) == 0:
            each(Stimulus(now_s, "leak", {"is_wet": self.is_wet, "stamp_s": now_s}))
        if self.ticks % round(FIX_S / PANEL_S) == 0:
            each(Stimulus(now_s, "depth", {"depth_m": self.depth_m, "stamp_s": now_s}, process=False))
            if self.is_vehicle_sending:
                each(
                    Stimulus(
                        now_s, "vehicle", {"is_stopped": self.is_stopped, "is_armed": False, "control_state": "idle"}
                    )
                )
            if self.position is not None:
                each(Stimulus(now_s, "position_fix", {"position_m": self.position, "yaw_rad": 0.0, "stamp_s": now_s}))
        each(Stimulus(now_s, "panel", {"stop": self.stop, "reset": self.reset}))
        self.ticks += 1


def to_lining_up(timeline: Timeline) -> Timeline:
    """From the beginning to the first gate."""
    timeline.be("waiting", 1.9, "The mission begins in 'waiting' and stays there for two seconds.")
    return timeline.be(
        "lining_up", 1.5, "After two seconds, with the vehicle received and seen, 'waiting' goes to 'lining_up'.", 0.3
    )


def to_passing(timeline: Timeline) -> Timeline:
    """On to before the first gate, for a second."""
    to_lining_up(timeline)
    timeline.at(0).be("lining_up", 0.85, "To line up takes a whole second near the point before the gate.")
    return timeline.at(0).be(
        "passing", 1.0, "After a second within 0.25 m of the point before the gate: 'passing'.", 0.4
    )


def to_holding(timeline: Timeline) -> Timeline:
    """On, and out of sight."""
    to_lining_up(timeline)
    timeline.be("lining_up", 0.35, "A position that is 0.3 s old is still valid.", position=None)
    return timeline.be("holding", 1.5, "When the newest position is older than half a second: 'holding'.", 0.4)


def to_surfacing(timeline: Timeline) -> Timeline:
    """On, and water comes in."""
    to_lining_up(timeline)
    return timeline.be("surfacing", 2.0, "Water in the hull: 'surfacing', from wherever it is.", 0.7, is_wet=True)


def to_done(timeline: Timeline) -> Timeline:
    """On, up to the surface."""
    to_surfacing(timeline)
    return timeline.be("done", 1.5, "Less deep than half a metre: 'surfacing' goes to 'done'.", 0.3, depth_m=0.3)


def to_stopped(timeline: Timeline) -> Timeline:
    """On, and the stop button is pressed."""
    to_lining_up(timeline)
    return timeline.press("stop", "stopped", STOPS)


STOPS = "The emergency stop counts in every state, at once, also if the button is down for a moment only."
PATHS: dict[str, Callable[[Timeline], Timeline]] = {
    "waiting": lambda timeline: timeline.be("waiting", 1.0, "The mission begins in 'waiting'."),
    "lining_up": to_lining_up,
    "passing": to_passing,
    "holding": to_holding,
    "surfacing": to_surfacing,
    "done": to_done,
    "stopped": to_stopped,
}


# -- outputs of a timeline --------------------------------------------------------------------------------------------


def run_timeline(student: Student, timeline: Timeline) -> list[Output]:
    """Return what the mission answers to a timeline."""
    return student.run_inputs("mission.py", timeline.pages, role="topside", parameters=timeline.parameters)


def outputs_of(made: Sequence[Output], key: str) -> list[tuple[float, dict[str, Any]]]:
    """Return the time and the data of each page of a key."""
    return [(one.at_s, require_page(one.value, key)) for one in made if one.kind == "store_page" and one.name == key]


def state_of(page: Any) -> str:
    """Return the state in a page "mission"."""
    return require_field(page, "mission", "state", str)


def states_right(timeline: Timeline, made: Sequence[Output]) -> Verdict:
    """Return whether the mission was always in the right state."""
    pages = outputs_of(made, "mission")
    if len(pages) != timeline.ticks:
        return failed(
            "The mission stores one page 'mission' for each page 'panel'.", str(timeline.ticks), f"{len(pages)} pages"
        )
    for now_s, page in pages:
        segment = next(one for one in reversed(timeline.segments) if one.from_s <= now_s + 1e-9)
        if state_of(page) not in segment.states:
            right = " or ".join(segment.states)
            return failed(segment.hint, f"'{right}' at {now_s:.2f} s", f"'{state_of(page)}'")
    return passed()


def first_wrong_arrow(made: Sequence[Output]) -> str:
    """Return the first change of state that no arrow allows, or an empty text."""
    before = "waiting"
    for _, page in outputs_of(made, "mission"):
        state = state_of(page)
        if state != before and state not in ARROWS.get(before, ()):
            return f"{before} -> {state}"
        before = state
    return ""


@dataclass(frozen=True)
class Case:
    """A timeline.

    Args:
        what: happens on it.
        seed: of the gates.
    """

    what: str
    seed: int

    @property
    def label(self) -> str:
        """What it is about."""
        return self.what.replace("_", " ")


def of(kinds: Sequence[str]) -> Callable[[random.Random], list[Case]]:
    """Return what draws each kind of timeline once more, with other gates."""
    return lambda rng: [Case(kind, rng.getrandbits(63)) for kind in kinds]


def visible(kinds: Sequence[str], seed: int = 1) -> list[Case]:
    """Return each kind of timeline, as a visible case."""
    return [Case(kind, seed) for kind in kinds]


# -- checks -----------------------------------------------------------------------------------------------------------


def whole_day(timeline: Timeline) -> None:
    """All three gates, and up."""
    to_passing(timeline)
    for gate in range(3):
        if gate:
            timeline.at(2 * gate, 1.0).be("lining_up", 2.0, "Behind a gate it lines up for the next one.")
            timeline.at(2 * gate).be("passing", 2.0, "After a second near the point before the gate: 'passing'.", 1.3)
        following = "lining_up" if gate < 2 else "surfacing"
        hint = "Within 0.4 m of the point behind the gate it has passed; behind the last gate it comes up."
        timeline.at(2 * gate + 1, 0.3).be(following, 0.6, hint, 0.3)
    timeline.be("surfacing", 1.0, "It comes up until it is less deep than half a metre.")
    timeline.be("done", 1.0, "Less deep than half a metre: 'surfacing' goes to 'done'.", 0.3, depth_m=0.4)


def short_stays(timeline: Timeline) -> None:
    """Near, and away again, and near."""
    to_lining_up(timeline)
    hint = (
        "'passing' requires a whole second without a break near the point before the gate: short stays do not add up."
    )
    for _ in range(3):
        timeline.at(0).be("lining_up", 0.7, hint)
        timeline.at(0, 0.6).be("lining_up", 0.3, hint)
    timeline.at(0, 0.2).be(
        "passing", 1.6, "0.2 m from the point before the gate, for more than a second: 'passing'.", 1.3
    )


def vehicle_silent(timeline: Timeline) -> None:
    """No page from the vehicle for a while."""
    hint = "Do not arm a vehicle before its first page was received: 'waiting'."
    timeline.be("waiting", 4.0, hint, is_vehicle_sending=False)
    timeline.be(
        "lining_up", 1.0, "Received, seen, and two seconds have passed: 'lining_up'.", 0.3, is_vehicle_sending=True
    )


def position_missing(timeline: Timeline) -> None:
    """No position for a while."""
    timeline.be("waiting", 4.0, "Without a position the vehicle cannot be steered: 'waiting'.", position=None)
    timeline.at(0, 2.0).be("lining_up", 1.0, "Received, seen, and two seconds have passed: 'lining_up'.", 0.3)


USUAL = {
    "whole_day": whole_day,
    "short_stays": short_stays,
    "vehicle_silent": vehicle_silent,
    "position_missing": position_missing,
}


@check(points=12, visible=visible(["whole_day", "short_stays"]), hidden=of(list(USUAL)))
def follows_the_picture(student: Student, case: Case) -> Verdict:
    """Through three gates as in the picture, each arrow when it is due"""
    timeline = Timeline(case.seed)
    USUAL[case.what](timeline)
    return states_right(timeline, run_timeline(student, timeline))


def all_states(timeline: Timeline) -> None:
    """Every state, one after the other."""
    to_passing(timeline)
    timeline.be("holding", 1.5, "", 1.0, position=None)
    timeline.at(0, 1.0).be("lining_up", 1.0, "", 0.3)
    timeline.press("stop", "stopped", STOPS).be("stopped", 0.5, "", is_stopped=True)
    timeline.press("reset", "waiting", "").be("waiting", 0.5, "").be("waiting", 1.5, "", is_stopped=False)
    timeline.be("lining_up", 1.0, "", 0.5).be("surfacing", 2.0, "", 0.7, is_wet=True)
    timeline.be("done", 1.0, "", 0.3, depth_m=0.3)


@check(points=8, visible=visible(["every_state"]), hidden=of(["every_state"] * 2))
def check_controls(student: Student, case: Case) -> Verdict:
    """In each state it sends the controls of the table"""
    timeline = Timeline(case.seed)
    all_states(timeline)
    made = run_timeline(student, timeline)
    asked, states = outputs_of(made, "controls"), outputs_of(made, "mission")
    if len(asked) != timeline.ticks or len(states) != timeline.ticks:
        hint = "Store one page 'controls' and one page 'mission' for each page 'panel': without 'controls' it stops."
        return failed(hint, f"{timeline.ticks} pages", f"{len(asked)} and {len(states)}")
    numbers = [page.get("number") for _, page in asked]
    if numbers != list(range(1, timeline.ticks + 1)):
        hint = "Number the pages 'controls' from 1 on."
        return failed(hint, f"1 to {timeline.ticks}", f"{numbers[0]} to {numbers[-1]}")
    seen = set()
    for (now_s, page), (_, mission) in zip(asked, states, strict=True):
        state = state_of(mission)
        seen.add(state)
        for name, right in _table(timeline, state, now_s).items():
            if name not in page or page[name] != right:
                hint = f"In '{state}', '{name}' of the controls does not match the table in the README."
                return failed(hint, f"{name}: {right}", str(page.get(name, "nothing")))
    missing = [state for state in STATES if state not in seen]
    return failed(f"It never reached '{missing[0]}'.", "all seven states") if missing else passed()


def _table(timeline: Timeline, state: Any, now_s: float) -> dict[str, Any]:
    """Return the row of a state in the README's table."""
    right: dict[str, Any] = {
        "mode": "heading_hold",
        "is_armed": state in ("lining_up", "passing", "holding", "surfacing"),
        "is_stop": state == "stopped",
        "clears_stop": state == "waiting" and timeline.was_stopped_at(now_s),
        "depth_m": 0.2 if state == "surfacing" else None,
        "heading_rad": None,
    }
    if state in ("lining_up", "passing"):
        goal = timeline.route[0 if state == "lining_up" else 1]
        return right | {"depth_m": goal.depth_m, "heading_rad": goal.heading_rad}
    return right | {"surge": 0.0, "sway": 0.0}


def line_too_long(timeline: Timeline) -> None:
    """Never near the gate."""
    to_lining_up(timeline)
    timeline.be("lining_up", 28.0, "'lining_up' may take 30 s.")
    timeline.be(
        "surfacing", 2.0, "'lining_up' for more than 30 s: 'surfacing'. Counted from when the state began.", 1.2
    )


def pass_too_long(timeline: Timeline) -> None:
    """Never behind the gate."""
    to_passing(timeline)
    hint = "'passing' may take 20 s, counted from when 'passing' began, not from the start of the mission."
    timeline.be("passing", 18.5, hint)
    timeline.be("surfacing", 2.0, "'passing' for more than 20 s: 'surfacing'.", 1.2)


def hold_too_long(timeline: Timeline) -> None:
    """Out of sight for good."""
    to_holding(timeline)
    timeline.be("holding", 3.0, "'holding' may take 5 s.")
    timeline.be("surfacing", 2.0, "'holding' for more than 5 s: 'surfacing'.", 1.2)


def rise_too_long(timeline: Timeline) -> None:
    """Caught under something."""
    to_surfacing(timeline)
    timeline.be("surfacing", 17.0, "'surfacing' may take 20 s.")
    timeline.be("done", 2.5, "'surfacing' for more than 20 s: 'done'. A vehicle that is caught must stop pushing.", 2.0)


LIMITS = {
    "line_too_long": line_too_long,
    "pass_too_long": pass_too_long,
    "hold_too_long": hold_too_long,
    "rise_too_long": rise_too_long,
}


@check(points=15, visible=visible(["line_too_long", "hold_too_long"]), hidden=of(list(LIMITS)))
def time_outs(student: Student, case: Case) -> Verdict:
    """Time limits of four states, each counted from when the state began"""
    timeline = Timeline(case.seed)
    LIMITS[case.what](timeline)
    return states_right(timeline, run_timeline(student, timeline))


def lost_and_found(timeline: Timeline) -> None:
    """Out of sight while it passes, and back."""
    to_passing(timeline)
    timeline.be("passing", 0.35, "A position that is 0.3 s old is still valid.", position=None)
    timeline.be(
        "holding", 1.5, "When the newest position is older than half a second, also while passing: 'holding'.", 0.4
    )
    hint = "Seen again: 'lining_up' for the same gate, wherever it has drifted to."
    timeline.at(0, 1.0).be("lining_up", 1.5, hint, 0.3)
    timeline.at(0).be("passing", 2.0, "It lines up for the same gate again, for a whole second.", 1.3)


def wet_while(state: str) -> Callable[[Timeline], None]:
    """Return a timeline in which water enters in a state."""

    def timeline_of(timeline: Timeline) -> None:
        PATHS[state](timeline)
        timeline.be(
            "surfacing",
            2.0,
            f"Water in the hull in '{state}': 'surfacing'.",
            2.5 if state == "waiting" else 0.7,
            is_wet=True,
        )

    return timeline_of


TROUBLE = {"lost_and_found": lost_and_found} | {
    f"wet_while_{state}": wet_while(state) for state in ("lining_up", "passing", "holding")
}


@check(points=10, visible=visible(["lost_and_found", "wet_while_holding"]), hidden=of(list(TROUBLE)))
def trouble(student: Student, case: Case) -> Verdict:
    """Without a position it holds, and continues when it is seen; with water in the hull it comes up"""
    timeline = Timeline(case.seed)
    TROUBLE[case.what](timeline)
    return states_right(timeline, run_timeline(student, timeline))


@check(points=15, visible=visible(["lining_up", "surfacing"]), hidden=of(STATES[:-1]))
def stops(student: Student, case: Case) -> Verdict:
    """The emergency stop: from every state, at once, and it stays when the button is released"""
    timeline = Timeline(case.seed)
    PATHS[case.what](timeline)
    pressed_s = timeline.now_s
    timeline.press("stop", "stopped", f"Pressed in '{case.what}': {STOPS[0].lower()}{STOPS[1:]}")
    timeline.be("stopped", 3.0, "Reset was not pressed: a stop stays when the button is released.", position=None)
    made = run_timeline(student, timeline)
    verdict = states_right(timeline, made)
    if verdict.fraction < 1.0:
        return verdict
    for now_s, page in outputs_of(made, "controls"):
        if now_s >= pressed_s + SLACK_S and (page.get("is_stop") is not True or page.get("is_armed") is not False):
            return failed(
                "In 'stopped', every page 'controls' must have is_stop True and is_armed False. Sticks at 0 do not "
                "stop it: the vehicle still holds its depth.",
                "is_stop: True, is_armed: False",
                f"is_stop: {page.get('is_stop')}, is_armed: {page.get('is_armed')}",
            )
    return passed()


def reset_at_once(timeline: Timeline) -> None:
    """Reset, and on."""
    to_passing(timeline).press("stop", "stopped", STOPS)
    timeline.be("stopped", 1.0, "Reset was not pressed.", is_stopped=True)
    timeline.press("reset", "waiting", "Reset, with the stop button up: 'waiting'.")
    timeline.be("waiting", 1.6, "After a reset it waits two seconds, as at the beginning.", is_stopped=False)
    timeline.at(0, 1.0).be("lining_up", 1.5, "After a reset it continues, and lines up for the same gate.", 0.4)


def reset_while_pressed(timeline: Timeline) -> None:
    """Both buttons at once."""
    to_lining_up(timeline)
    timeline.be("stopped", 0.5, STOPS, stop=True, is_stopped=True)
    timeline.press("reset", "stopped", "Reset while the stop button is down does nothing.")
    timeline.be(
        "stopped", 0.5, "Reset while the stop button is down does nothing, also when it is released.", stop=False
    )
    timeline.press("reset", "waiting", "Reset, with the stop button up: 'waiting'.")


def reset_before(timeline: Timeline) -> None:
    """A reset before the stop has no effect."""
    to_lining_up(timeline).press("reset", "lining_up", "Reset in another state than 'stopped' does nothing.")
    timeline.press("stop", "stopped", STOPS)
    timeline.be("stopped", 2.0, "A reset from before the stop does not count: it must be pressed again.")


def not_cleared(timeline: Timeline) -> None:
    """A vehicle that keeps its stop."""
    to_lining_up(timeline).press("stop", "stopped", STOPS)
    timeline.be("stopped", 0.5, "Reset was not pressed.", is_stopped=True)
    timeline.press("reset", "waiting", "Reset, with the stop button up: 'waiting'.")
    hint = "The vehicle still keeps its stop: 'waiting' until it reports that the stop is cleared."
    timeline.be("waiting", 5.0, hint)
    timeline.be("lining_up", 1.0, "The stop is cleared and two seconds are over: 'lining_up'.", 0.3, is_stopped=False)


RESETS = {
    "reset_at_once": reset_at_once,
    "reset_while_pressed": reset_while_pressed,
    "reset_before": reset_before,
    "not_cleared": not_cleared,
}


@check(points=10, visible=visible(["reset_at_once"]), hidden=of(list(RESETS)))
def recovers(student: Student, case: Case) -> Verdict:
    """Out of a stop only by reset, with the stop button up, and then from 'waiting' on"""
    timeline = Timeline(case.seed)
    RESETS[case.what](timeline)
    return states_right(timeline, run_timeline(student, timeline))


@check(points=10, visible=visible(["anything"], 3), hidden=of(["anything"] * 3), all_or_nothing=True)
def arrows(student: Student, case: Case) -> Verdict:
    """Whatever happens: no change of state without an arrow in the picture"""
    timeline, rng = Timeline(case.seed), random.Random(case.seed)
    for _ in range(60):
        _anything(timeline, rng)
        for _ in range(rng.randint(4, 50)):
            timeline._tick()
        timeline.stop = timeline.reset = False
    made = run_timeline(student, timeline)
    seen = {state_of(page) for _, page in outputs_of(made, "mission")}
    if len(seen) < 4:
        return failed("It entered too few states although many inputs changed.", "six or seven", f"{len(seen)}")
    wrong = first_wrong_arrow(made)
    if wrong:
        return failed(f"It went {wrong}: there is no such arrow.", "arrows of the picture only", wrong)
    since: tuple[Any, float] = "waiting", 0.0
    for now_s, page in outputs_of(made, "mission"):
        if state_of(page) != since[0]:
            since = state_of(page), now_s
        since_s = require_field(page, "mission", "since_s", float)
        if abs(since_s - since[1]) > 0.001:
            return failed("'since_s' must be the time at which the state began.", f"{since[1]:.2f}", str(since_s))
    return passed()


def _anything(timeline: Timeline, rng: random.Random) -> None:
    what = rng.randrange(10)
    if what < 5:
        timeline.at(rng.randrange(len(timeline.route)), rng.choice((0.0, 0.0, 0.2, 1.0)))
    elif what == 5:
        timeline.position = None
    elif what == 6:
        timeline.is_wet = not timeline.is_wet
    elif what == 7:
        timeline.stop = True
    elif what == 8:
        timeline.depth_m = 0.3
    timeline.reset = rng.random() < 0.4
    timeline.is_stopped = rng.random() < 0.2
    timeline.is_vehicle_sending = True


@dataclass(frozen=True)
class MissionCase:
    """A run through the gates."""

    seed: int


def draw_missions(rng: random.Random) -> list[MissionCase]:
    """Three other courses."""
    return [MissionCase(rng.getrandbits(63)) for _ in range(3)]


def draw_mission(rng: random.Random) -> list[MissionCase]:
    """Another course."""
    return [MissionCase(rng.getrandbits(63))]


@check(points=12, visible=[MissionCase(1)], hidden=draw_missions, needs=["arrows"])
def runs_mission(student: Student, case: MissionCase) -> Verdict:
    """Under water: through all three gates, touching nothing (urov_gate)"""
    run = student.run_scenario("urov_gate", case.seed, "mission.py")
    wrong = next((f"{a} -> {b}" for a, b in _changes(run) if b not in ARROWS.get(a, ())), "")
    if wrong:
        return failed(f"It went {wrong}: there is no such arrow.", "arrows of the picture only", wrong)
    if not run.success:
        return failed("It did not pass the three gates.", "completed", "; ".join([run.outcome, *run.notes]))
    return passed(metrics={"time_s": run.metrics["time_s"], "energy_j": run.metrics["energy_j"]})


def _changes(run: ScenarioRun) -> list[tuple[str, str]]:
    states = ["waiting", *(state_of(page) for _, page in run.pages("mission"))]
    return [(a, b) for a, b in pairwise(states) if a != b]


@check(points=8, visible=[MissionCase(2)], hidden=draw_mission, needs=["arrows"])
def stops_in_the_water(student: Student, case: MissionCase) -> Verdict:
    """Under water: half a second after the button no thruster pushes, until reset; then it continues"""
    stop_s, reset_s = FLIGHT_STOP_S, FLIGHT_STOP_S + 4.0
    run = student.run_scenario(
        "urov_gate", case.seed, "mission.py", options={"stop": f"{stop_s}", "reset": f"{reset_s}"}
    )
    pushes = thrusts_n(run)
    before = max((n for t, n in pushes if stop_s - 1.0 < t < stop_s), default=0.0)
    if before < 1.0:
        return failed("It did not move before the stop.", "thrust", f"{before:.1f} N")
    worst = max((n for t, n in pushes if stop_s + STOP_S < t < reset_s + 1.9), default=0.0)
    if worst > 0.5:
        return failed("Thrusters push after the emergency stop, before a reset.", "0 N", f"{worst:.1f} N")
    if run.metrics["gates"] != ["gate_1", "gate_2", "gate_3"]:
        passed_gates = ", ".join(run.metrics["gates"]) or "no gate"
        return failed("After the reset it did not pass all three gates.", "three gates", passed_gates)
    return passed()


def thrusts_n(run: ScenarioRun) -> list[tuple[float, float]]:
    """Return how hard all thrusters together pushed, 20 times a second."""
    return [
        (record.t, math.fsum(math.hypot(*arrow[3:]) for name, arrow in record.vectors.items() if name in THRUSTERS))
        for record in run.trace.records
        if isinstance(record, TruthRecord)
    ]


lab = Lab(
    "Mission state machine",
    files=["mission.py", "machine.py"],
    checks=[
        follows_the_picture,
        check_controls,
        time_outs,
        trouble,
        stops,
        recovers,
        arrows,
        runs_mission,
        stops_in_the_water,
    ],
)
