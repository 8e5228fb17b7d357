"""The grader's side of the lab "mission state machine": days at the surface, and what a mission makes of them."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from snr_sim.grading import Flown, Given, Lab, Produced, Student, Verdict, check, failed, field_of, page_of, passed
from snr_sim.recording.records import TruthRecord
from snr_sim.scenario import library

library.load_robot(library.find("robots", "urov"))
gate_scenario: Any = library.load_scenario(library.find("scenarios", "urov_gate"))

PANEL_S, PLACE_S, LEAK_S = 0.05, 0.1, 0.5
SLACK_S = 0.15  # three looks at the panel: which one notices first is nobody's business
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


# -- a day: what comes in, and which state is right -------------------------------------------------------------------


@dataclass(frozen=True)
class Part:
    """From a moment on, these states are right, and if they are not this is to be said."""

    from_s: float
    states: tuple[str, ...]
    hint: str


class Day:
    """Pages that come at the surface, moment by moment.

    Args:
        seed: of the gates.
    """

    def __init__(self, seed: int) -> None:
        self.parameters = gate_scenario.parameters(seed)
        self.route = self.parameters.route
        self.pages: list[Given] = []
        self.parts: list[Part] = []
        self.ticks = 0
        self.state = "waiting"
        self.place: list[float] | None = [-9.0, 0.0, -1.5]
        self.stop = self.reset = self.is_wet = self.is_stopped = False
        self.is_heard = True
        self.depth_m = 1.5

    @property
    def now_s(self) -> float:
        """The time of the next pages."""
        return self.ticks * PANEL_S

    def at(self, index: int, off_m: float = 0.0) -> Day:
        """Puts the vehicle at a place of the route, or somewhat south of it."""
        goal = self.route[index]
        self.place, self.depth_m = [goal.x_m, goal.y_m - off_m, -goal.depth_m], goal.depth_m
        return self

    def be(self, state: str, seconds: float, hint: str, slack_s: float = SLACK_S, **world: Any) -> Day:
        """Lets time pass, in which the mission should be in a state; at first it may still be in the one before."""
        for name, value in world.items():
            setattr(self, name, value)
        if state != self.state:
            self.parts.append(Part(self.now_s, (self.state, state), hint))
            self.parts.append(Part(self.now_s + slack_s, (state,), hint))
        else:
            self.parts.append(Part(self.now_s, (state,), hint))
        self.state = state
        for _ in range(round(seconds / PANEL_S)):
            self._tick()
        return self

    def press(self, button: str, state: str, hint: str) -> Day:
        """Presses a button for a moment."""
        self.be(state, 0.2, hint, **{button: True})
        setattr(self, button, False)
        return self

    def was_stopped_at(self, time_s: float) -> bool:
        """Returns whether the vehicle had said by then that it keeps a stop."""
        said = [one.value["is_stopped"] for one in self.pages if one.key == "vehicle" and one.at_s <= time_s + 1e-9]
        return bool(said) and bool(said[-1])

    def _tick(self) -> None:
        now_s, each = self.now_s, self.pages.append
        if self.ticks % round(LEAK_S / PANEL_S) == 0:
            each(Given(now_s, "leak", {"is_wet": self.is_wet, "stamp_s": now_s}))
        if self.ticks % round(PLACE_S / PANEL_S) == 0:
            each(Given(now_s, "depth", {"depth_m": self.depth_m, "stamp_s": now_s}, process=False))
            if self.is_heard:
                each(Given(now_s, "vehicle", {"is_stopped": self.is_stopped, "is_armed": False, "rules": "idle"}))
            if self.place is not None:
                each(Given(now_s, "place", {"position_m": self.place, "yaw_rad": 0.0, "stamp_s": now_s}))
        each(Given(now_s, "panel", {"stop": self.stop, "reset": self.reset}))
        self.ticks += 1


def to_lining_up(day: Day) -> Day:
    """From the beginning to the first gate."""
    day.be("waiting", 1.9, "The mission begins in 'waiting' and stays there for two seconds.")
    return day.be(
        "lining_up", 1.5, "After two seconds, with the vehicle heard and seen, 'waiting' goes to 'lining_up'.", 0.3
    )


def to_passing(day: Day) -> Day:
    """On to before the first gate, for a second."""
    to_lining_up(day)
    day.at(0).be("lining_up", 0.85, "To line up takes a whole second near the place before the gate.")
    return day.at(0).be("passing", 1.0, "After a second within 0.25 m of the place before the gate: 'passing'.", 0.4)


def to_holding(day: Day) -> Day:
    """On, and out of sight."""
    to_lining_up(day)
    day.be("lining_up", 0.35, "A place that is 0.3 s old is still good.", place=None)
    return day.be("holding", 1.5, "When the newest place is older than half a second: 'holding'.", 0.4)


def to_surfacing(day: Day) -> Day:
    """On, and water comes in."""
    to_lining_up(day)
    return day.be("surfacing", 2.0, "Water in the hull: 'surfacing', from wherever it is.", 0.7, is_wet=True)


def to_done(day: Day) -> Day:
    """On, up to the surface."""
    to_surfacing(day)
    return day.be("done", 1.5, "Less deep than half a metre: 'surfacing' goes to 'done'.", 0.3, depth_m=0.3)


def to_stopped(day: Day) -> Day:
    """On, and somebody presses the button."""
    to_lining_up(day)
    return day.press("stop", "stopped", STOPS)


STOPS = "The emergency stop counts in every state, at once, also if the button is down for a moment only."
WAYS: dict[str, Callable[[Day], Day]] = {
    "waiting": lambda day: day.be("waiting", 1.0, "The mission begins in 'waiting'."),
    "lining_up": to_lining_up,
    "passing": to_passing,
    "holding": to_holding,
    "surfacing": to_surfacing,
    "done": to_done,
    "stopped": to_stopped,
}


# -- what is said of a day --------------------------------------------------------------------------------------------


def spent(student: Student, day: Day) -> list[Produced]:
    """Brings a day to the mission."""
    return student.feed("mission.py", day.pages, role="topside", parameters=day.parameters)


def told(made: Sequence[Produced], key: str) -> list[tuple[float, dict[str, Any]]]:
    """Returns when pages of a key came and what they said."""
    return [(one.at_s, page_of(one.value, key)) for one in made if one.kind == "store_page" and one.name == key]


def state_of(page: Any) -> str:
    """Returns the state that a page "mission" tells."""
    return field_of(page, "mission", "state", str)


def states_right(day: Day, made: Sequence[Produced]) -> Verdict:
    """Returns whether the mission was in the right state all day."""
    pages = told(made, "mission")
    if len(pages) != day.ticks:
        return failed(
            "The mission stores one page 'mission' for each page 'panel'.", str(day.ticks), f"{len(pages)} pages"
        )
    for now_s, page in pages:
        part = next(one for one in reversed(day.parts) if one.from_s <= now_s + 1e-9)
        if state_of(page) not in part.states:
            right = " or ".join(part.states)
            return failed(part.hint, f"'{right}' at {now_s:.2f} s", f"'{state_of(page)}'")
    return passed()


def first_wrong_arrow(made: Sequence[Produced]) -> str:
    """Returns the first change of state that no arrow allows, or an empty text."""
    before = "waiting"
    for _, page in told(made, "mission"):
        state = state_of(page)
        if state != before and state not in ARROWS.get(before, ()):
            return f"{before} -> {state}"
        before = state
    return ""


@dataclass(frozen=True)
class Case:
    """A day.

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
    """Returns what draws each kind of day once more, with other gates."""
    return lambda rng: [Case(kind, rng.getrandbits(63)) for kind in kinds]


def visible(kinds: Sequence[str], seed: int = 1) -> list[Case]:
    """Returns each kind of day, for all to see."""
    return [Case(kind, seed) for kind in kinds]


# -- checks -----------------------------------------------------------------------------------------------------------


def whole_day(day: Day) -> None:
    """All three gates, and up."""
    to_passing(day)
    for gate in range(3):
        if gate:
            day.at(2 * gate, 1.0).be("lining_up", 2.0, "Behind a gate it lines up for the next one.")
            day.at(2 * gate).be("passing", 2.0, "After a second near the place before the gate: 'passing'.", 1.3)
        following = "lining_up" if gate < 2 else "surfacing"
        hint = "Within 0.4 m of the place behind the gate it has passed; behind the last one it comes up."
        day.at(2 * gate + 1, 0.3).be(following, 0.6, hint, 0.3)
    day.be("surfacing", 1.0, "It comes up until it is less deep than half a metre.")
    day.be("done", 1.0, "Less deep than half a metre: 'surfacing' goes to 'done'.", 0.3, depth_m=0.4)


def short_stays(day: Day) -> None:
    """Near, and away again, and near."""
    to_lining_up(day)
    hint = "A whole second without a break near the place before the gate: two short stays are none."
    for _ in range(3):
        day.at(0).be("lining_up", 0.7, hint)
        day.at(0, 0.6).be("lining_up", 0.3, hint)
    day.at(0, 0.2).be("passing", 1.6, "0.2 m from the place before the gate, for more than a second: 'passing'.", 1.3)


def not_heard(day: Day) -> None:
    """A vehicle that says nothing for a while."""
    hint = "Nobody arms a vehicle that has not been heard: 'waiting'."
    day.be("waiting", 4.0, hint, is_heard=False)
    day.be("lining_up", 1.0, "Heard, seen, and two seconds are long over: 'lining_up'.", 0.3, is_heard=True)


def not_seen(day: Day) -> None:
    """A vehicle that nobody sees for a while."""
    day.be("waiting", 4.0, "Nobody steers what he does not see: 'waiting'.", place=None)
    day.at(0, 2.0).be("lining_up", 1.0, "Heard, seen, and two seconds are long over: 'lining_up'.", 0.3)


USUAL = {"whole_day": whole_day, "short_stays": short_stays, "not_heard": not_heard, "not_seen": not_seen}


@check(points=12, visible=visible(["whole_day", "short_stays"]), hidden=of(list(USUAL)))
def follows_the_picture(student: Student, case: Case) -> Verdict:
    """Through three gates as in the picture, each arrow when it is due"""
    day = Day(case.seed)
    USUAL[case.what](day)
    return states_right(day, spent(student, day))


def all_states(day: Day) -> None:
    """Every state, one after the other."""
    to_passing(day)
    day.be("holding", 1.5, "", 1.0, place=None)
    day.at(0, 1.0).be("lining_up", 1.0, "", 0.3)
    day.press("stop", "stopped", STOPS).be("stopped", 0.5, "", is_stopped=True)
    day.press("reset", "waiting", "").be("waiting", 0.5, "").be("waiting", 1.5, "", is_stopped=False)
    day.be("lining_up", 1.0, "", 0.5).be("surfacing", 2.0, "", 0.7, is_wet=True)
    day.be("done", 1.0, "", 0.3, depth_m=0.3)


@check(points=8, visible=visible(["every_state"]), hidden=of(["every_state"] * 2))
def asks(student: Student, case: Case) -> Verdict:
    """In each state it asks the vehicle for what the table says"""
    day = Day(case.seed)
    all_states(day)
    made = spent(student, day)
    asked, states = told(made, "controls"), told(made, "mission")
    if len(asked) != day.ticks or len(states) != day.ticks:
        hint = "One page 'controls' for each page 'panel', and one page 'mission': a vehicle that hears nothing stops."
        return failed(hint, f"{day.ticks} pages", f"{len(asked)} and {len(states)}")
    numbers = [page.get("number") for _, page in asked]
    if numbers != list(range(1, day.ticks + 1)):
        return failed("Pages 'controls' are numbered.", f"1 to {day.ticks}", f"{numbers[0]} to {numbers[-1]}")
    seen = set()
    for (now_s, page), (_, mission) in zip(asked, states, strict=True):
        state = state_of(mission)
        seen.add(state)
        for name, right in _table(day, state, now_s).items():
            if name not in page or page[name] != right:
                hint = f"In '{state}', '{name}' of the controls is not what the table in the README says."
                return failed(hint, f"{name}: {right}", str(page.get(name, "nothing")))
    missing = [state for state in STATES if state not in seen]
    return failed(f"It never came to '{missing[0]}'.", "all seven states") if missing else passed()


def _table(day: Day, state: Any, now_s: float) -> dict[str, Any]:
    """Returns what the README's table says of a state."""
    right: dict[str, Any] = {
        "mode": "heading_hold",
        "is_armed": state in ("lining_up", "passing", "holding", "surfacing"),
        "is_stop": state == "stopped",
        "clears_stop": state == "waiting" and day.was_stopped_at(now_s),
        "depth_m": 0.2 if state == "surfacing" else None,
        "heading_rad": None,
    }
    if state in ("lining_up", "passing"):
        goal = day.route[0 if state == "lining_up" else 1]
        return right | {"depth_m": goal.depth_m, "heading_rad": goal.heading_rad}
    return right | {"surge": 0.0, "sway": 0.0}


def line_too_long(day: Day) -> None:
    """Never near the gate."""
    to_lining_up(day)
    day.be("lining_up", 28.0, "'lining_up' may take 30 s.")
    day.be("surfacing", 2.0, "'lining_up' for more than 30 s: 'surfacing'. Counted from when the state began.", 1.2)


def pass_too_long(day: Day) -> None:
    """Never behind the gate."""
    to_passing(day)
    hint = "'passing' may take 20 s, counted from when 'passing' began, not from the mission's begin."
    day.be("passing", 18.5, hint)
    day.be("surfacing", 2.0, "'passing' for more than 20 s: 'surfacing'.", 1.2)


def hold_too_long(day: Day) -> None:
    """Out of sight for good."""
    to_holding(day)
    day.be("holding", 3.0, "'holding' may take 5 s.")
    day.be("surfacing", 2.0, "'holding' for more than 5 s: 'surfacing'.", 1.2)


def rise_too_long(day: Day) -> None:
    """Caught under something."""
    to_surfacing(day)
    day.be("surfacing", 17.0, "'surfacing' may take 20 s.")
    day.be("done", 2.5, "'surfacing' for more than 20 s: 'done'. A vehicle that is caught must not push for ever.", 2.0)


LIMITS = {
    "line_too_long": line_too_long,
    "pass_too_long": pass_too_long,
    "hold_too_long": hold_too_long,
    "rise_too_long": rise_too_long,
}


@check(points=15, visible=visible(["line_too_long", "hold_too_long"]), hidden=of(list(LIMITS)))
def time_outs(student: Student, case: Case) -> Verdict:
    """No state lasts for ever: four limits, each counted from when the state began"""
    day = Day(case.seed)
    LIMITS[case.what](day)
    return states_right(day, spent(student, day))


def lost_and_found(day: Day) -> None:
    """Out of sight while it passes, and back."""
    to_passing(day)
    day.be("passing", 0.35, "A place that is 0.3 s old is still good.", place=None)
    day.be("holding", 1.5, "When the newest place is older than half a second, also while passing: 'holding'.", 0.4)
    hint = "Seen again: 'lining_up' for the same gate, wherever it has drifted to."
    day.at(0, 1.0).be("lining_up", 1.5, hint, 0.3)
    day.at(0).be("passing", 2.0, "It lines up for the same gate again, for a whole second.", 1.3)


def wet_while(state: str) -> Callable[[Day], None]:
    """Returns a day on which water comes in, in a state."""

    def day_of(day: Day) -> None:
        WAYS[state](day)
        day.be(
            "surfacing",
            2.0,
            f"Water in the hull in '{state}': 'surfacing'.",
            2.5 if state == "waiting" else 0.7,
            is_wet=True,
        )

    return day_of


TROUBLE = {"lost_and_found": lost_and_found} | {
    f"wet_while_{state}": wet_while(state) for state in ("lining_up", "passing", "holding")
}


@check(points=10, visible=visible(["lost_and_found", "wet_while_holding"]), hidden=of(list(TROUBLE)))
def trouble(student: Student, case: Case) -> Verdict:
    """Out of sight it holds, and goes on when it is seen; with water in the hull it comes up"""
    day = Day(case.seed)
    TROUBLE[case.what](day)
    return states_right(day, spent(student, day))


@check(points=15, visible=visible(["lining_up", "surfacing"]), hidden=of(STATES[:-1]))
def stops(student: Student, case: Case) -> Verdict:
    """The emergency stop: from every state, at once, and it stays when the button is let go"""
    day = Day(case.seed)
    WAYS[case.what](day)
    pressed_s = day.now_s
    day.press("stop", "stopped", f"Pressed in '{case.what}': {STOPS[0].lower()}{STOPS[1:]}")
    day.be("stopped", 3.0, "Nobody has pressed reset: a stop stays when the button is let go.", place=None)
    made = spent(student, day)
    verdict = states_right(day, made)
    if verdict.fraction < 1.0:
        return verdict
    for now_s, page in told(made, "controls"):
        if now_s >= pressed_s + SLACK_S and (page.get("is_stop") is not True or page.get("is_armed") is not False):
            return failed(
                "While it is 'stopped', every page 'controls' says so: is_stop, and not armed. Sticks at 0 are no "
                "stop: the vehicle still holds its depth.",
                "is_stop: True, is_armed: False",
                f"is_stop: {page.get('is_stop')}, is_armed: {page.get('is_armed')}",
            )
    return passed()


def reset_at_once(day: Day) -> None:
    """Reset, and on."""
    to_passing(day).press("stop", "stopped", STOPS)
    day.be("stopped", 1.0, "Nobody has pressed reset.", is_stopped=True)
    day.press("reset", "waiting", "Reset, with the stop button up: 'waiting'.")
    day.be("waiting", 1.6, "After a reset it waits two seconds, as at the beginning.", is_stopped=False)
    day.at(0, 1.0).be("lining_up", 1.5, "After a reset it goes on, and lines up for the gate it was at.", 0.4)


def reset_while_pressed(day: Day) -> None:
    """Both buttons at once."""
    to_lining_up(day)
    day.be("stopped", 0.5, STOPS, stop=True, is_stopped=True)
    day.press("reset", "stopped", "Reset while the stop button is down does nothing.")
    day.be("stopped", 0.5, "Reset while the stop button is down does nothing, also when that is let go.", stop=False)
    day.press("reset", "waiting", "Reset, with the stop button up: 'waiting'.")


def reset_before(day: Day) -> None:
    """A reset that comes first is none."""
    to_lining_up(day).press("reset", "lining_up", "Reset in another state than 'stopped' does nothing.")
    day.press("stop", "stopped", STOPS)
    day.be("stopped", 2.0, "A reset from before the stop does not count: somebody must press it again.")


def not_cleared(day: Day) -> None:
    """A vehicle that keeps its stop."""
    to_lining_up(day).press("stop", "stopped", STOPS)
    day.be("stopped", 0.5, "Nobody has pressed reset.", is_stopped=True)
    day.press("reset", "waiting", "Reset, with the stop button up: 'waiting'.")
    hint = "The vehicle still keeps its stop: 'waiting' until it says that it does not."
    day.be("waiting", 5.0, hint)
    day.be("lining_up", 1.0, "The stop is cleared and two seconds are over: 'lining_up'.", 0.3, is_stopped=False)


RESETS = {
    "reset_at_once": reset_at_once,
    "reset_while_pressed": reset_while_pressed,
    "reset_before": reset_before,
    "not_cleared": not_cleared,
}


@check(points=10, visible=visible(["reset_at_once"]), hidden=of(list(RESETS)))
def recovers(student: Student, case: Case) -> Verdict:
    """Out of a stop only by reset, with the stop button up, and then from 'waiting' on"""
    day = Day(case.seed)
    RESETS[case.what](day)
    return states_right(day, spent(student, day))


@check(points=10, visible=visible(["anything"], 3), hidden=of(["anything"] * 3), all_or_nothing=True)
def arrows(student: Student, case: Case) -> Verdict:
    """Whatever happens: no change of state without an arrow in the picture"""
    day, rng = Day(case.seed), random.Random(case.seed)
    for _ in range(60):
        _anything(day, rng)
        for _ in range(rng.randint(4, 50)):
            day._tick()
        day.stop = day.reset = False
    made = spent(student, day)
    seen = {state_of(page) for _, page in told(made, "mission")}
    if len(seen) < 4:
        return failed("On a day on which much happens it was in few states.", "six or seven", f"{len(seen)}")
    wrong = first_wrong_arrow(made)
    if wrong:
        return failed(f"It went {wrong}: there is no such arrow.", "arrows of the picture only", wrong)
    since: tuple[Any, float] = "waiting", 0.0
    for now_s, page in told(made, "mission"):
        if state_of(page) != since[0]:
            since = state_of(page), now_s
        said = field_of(page, "mission", "since_s", float)
        if abs(said - since[1]) > 0.001:
            return failed("'since_s' is the moment at which the state began.", f"{since[1]:.2f}", str(said))
    return passed()


def _anything(day: Day, rng: random.Random) -> None:
    what = rng.randrange(10)
    if what < 5:
        day.at(rng.randrange(len(day.route)), rng.choice((0.0, 0.0, 0.2, 1.0)))
    elif what == 5:
        day.place = None
    elif what == 6:
        day.is_wet = not day.is_wet
    elif what == 7:
        day.stop = True
    elif what == 8:
        day.depth_m = 0.3
    day.reset = rng.random() < 0.4
    day.is_stopped = rng.random() < 0.2
    day.is_heard = True


@dataclass(frozen=True)
class Swim:
    """A swim through the gates."""

    seed: int


def draw_swims(rng: random.Random) -> list[Swim]:
    """Three other courses."""
    return [Swim(rng.getrandbits(63)) for _ in range(3)]


def draw_swim(rng: random.Random) -> list[Swim]:
    """Another course."""
    return [Swim(rng.getrandbits(63))]


@check(points=12, visible=[Swim(1)], hidden=draw_swims, needs=["arrows"])
def swims(student: Student, case: Swim) -> Verdict:
    """Under water: through all three gates, touching nothing (urov_gate)"""
    flown = student.fly("urov_gate", case.seed, "mission.py")
    wrong = next((f"{a} -> {b}" for a, b in _changes(flown) if b not in ARROWS.get(a, ())), "")
    if wrong:
        return failed(f"It went {wrong}: there is no such arrow.", "arrows of the picture only", wrong)
    if not flown.success:
        return failed("It did not swim through the three gates.", "swum", "; ".join([flown.outcome, *flown.notes]))
    return passed(metrics={"time_s": flown.metrics["time_s"], "energy_j": flown.metrics["energy_j"]})


def _changes(flown: Flown) -> list[tuple[str, str]]:
    states = ["waiting", *(state_of(page) for _, page in flown.pages("mission"))]
    return [(a, b) for a, b in pairwise(states) if a != b]


@check(points=8, visible=[Swim(2)], hidden=draw_swim, needs=["arrows"])
def stops_in_the_water(student: Student, case: Swim) -> Verdict:
    """Under water: half a second after the button no thruster pushes, until reset; then it swims on"""
    stop_s, reset_s = FLIGHT_STOP_S, FLIGHT_STOP_S + 4.0
    flown = student.fly("urov_gate", case.seed, "mission.py", options={"stop": f"{stop_s}", "reset": f"{reset_s}"})
    pushes = thrusts_n(flown)
    before = max((n for t, n in pushes if stop_s - 1.0 < t < stop_s), default=0.0)
    if before < 1.0:
        return failed("It did not move before the stop.", "thrust", f"{before:.1f} N")
    worst = max((n for t, n in pushes if stop_s + STOP_S < t < reset_s + 1.9), default=0.0)
    if worst > 0.5:
        return failed("Thrusters push after the emergency stop, before anybody has reset it.", "0 N", f"{worst:.1f} N")
    if flown.metrics["gates"] != ["gate_1", "gate_2", "gate_3"]:
        passed_gates = ", ".join(flown.metrics["gates"]) or "no gate"
        return failed("After the reset it did not swim on through all three gates.", "three gates", passed_gates)
    return passed()


def thrusts_n(flown: Flown) -> list[tuple[float, float]]:
    """Returns how hard all thrusters together pushed, 20 times a second."""
    return [
        (record.t, math.fsum(math.hypot(*arrow[3:]) for name, arrow in record.arrows.items() if name in THRUSTERS))
        for record in flown.trace.records
        if isinstance(record, TruthRecord)
    ]


lab = Lab(
    "Mission state machine",
    files=["mission.py", "machine.py"],
    checks=[
        follows_the_picture,
        asks,
        time_outs,
        trouble,
        stops,
        recovers,
        arrows,
        swims,
        stops_in_the_water,
    ],
)
