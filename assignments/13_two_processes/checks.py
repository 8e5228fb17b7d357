"""Checks of the lab "two processes": images, timelines of images and events, and runs of Housecat."""

from __future__ import annotations

import difflib
import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from snr_sim.grading import Lab, Student, SubmissionError, Verdict, check, failed, partial_credit, passed, require_field

from .grader.own_code import MODULES, OWN, find_borrowed
from .grader.rules import OF_2D, Change, Entry, each_event_once, entries_of_outputs, entries_of_run, together
from .grader.timelines import TIMELINES, anything, judge_rest, judge_states
from .grader.world import Picture, Timeline, housecat, mono_page, robot_info, yard_pictures

PROGRAMS = ("process_2d.py", "stereo.py", "lidar.py", "slow.py", "answers.py")
PICTURES, PERIOD_S, SHARE = 10, 0.2, 0.8
SLACK_RAD = 0.06  # two columns of the image
WORK_S, STEP_S = 0.3, 0.05  # the slowest work, and the time between two calls of a process
MIN_OWN_EVENTS = 3
DEMO_SEED = 9  # of the run that answers.py is about


@dataclass(frozen=True)
class Scene:
    """A kind of case, and where its details come from."""

    kind: str
    seed: int

    @property
    def label(self) -> str:
        """What reports call it."""
        return f"{self.kind}, seed {self.seed}"


@dataclass(frozen=True)
class Yard:
    """A run in the yard of a seed."""

    seed: int


def drawn(kinds: Sequence[str], count: int) -> Callable[[random.Random], list[Scene]]:
    """Return what draws so many hidden cases of each kind."""
    return lambda rng: [Scene(kind, rng.getrandbits(63)) for kind in kinds for _ in range(count)]


def draw_yards(count: int) -> Callable[[random.Random], list[Yard]]:
    """Return what draws hidden yards."""
    return lambda rng: [Yard(rng.getrandbits(63)) for _ in range(count)]


@check(points=5, all_or_nothing=True)
def own_process(student: Student) -> Verdict:
    """The programs are your own: they import what the README lists, and not the robot's Process_2D."""
    for file in PROGRAMS:
        found = student.parse(file, find_borrowed)
        if found:
            hint = (
                f"{file}, {found} is not among what the README lists. Writing Process_2D is this lab: import nothing "
                "else of the robot, and nothing that leads to it."
            )
            return failed(hint, "names that the README lists", found)
    tops = {module.partition(".")[0] for module in MODULES if module != OWN}
    shadows = [name for name in sorted(tops) if any((student.folder / f"{name}{end}").exists() for end in ("", ".py"))]
    if shadows:
        hint = f"A file of yours is called like the module '{shadows[0]}', which would be taken for it."
        return failed(hint, "another name", shadows[0])
    return passed()


# -- images -----------------------------------------------------------------------------------------------------------

MISTAKES: list[tuple[str, Callable[[float], float]]] = [
    ("The bearing has the wrong sign: to the left of the middle is positive.", lambda right: -right),
    ("The bearing is in degrees. Angles are in radians.", math.degrees),
    ("The bearing is counted from an edge of the image, not from its middle.", lambda right: 0.61 - right),
    ("The bearing is counted from an edge of the image, not from its middle.", lambda right: right - 0.61),
]
MISSED = {
    "one group": "Which pixels show stones? Compare red with blue, as the README does for stones and for posts.",
    "two groups": "The nearest stones count, also if those behind are more: on a level floor, lower is nearer.",
    "some without": "Every other image shows no stones, only floor, walls, posts or pit: store nothing for these.",
}


@check(
    points=15,
    visible=[Scene("one group", 1), Scene("two groups", 2), Scene("some without", 3)],
    hidden=drawn(list(MISSED), 2),
    needs=["own_process"],
)
def finds(student: Student, case: Scene) -> Verdict:
    """The bearing of the nearest stones, from each image that shows some"""
    given = yard_pictures(case.kind, case.seed, PICTURES)
    stamps = [PERIOD_S * (i + 1) for i in range(PICTURES)]
    pages = [mono_page(stamp, one.rgb) for stamp, one in zip(stamps, given, strict=True)]
    outputs = student.run_inputs("stereo.py", pages, robot=robot_info(), until_s=stamps[-1] + PERIOD_S)
    found: list[list[float]] = [[] for _ in given]
    for one in outputs:
        if one.kind == "store_page" and one.name == "heap_2d":
            stamp, bearing = (require_field(one.value, "heap_2d", name, float) for name in ("stamp_s", "bearing_rad"))
            nearest = min(range(PICTURES), key=lambda i: abs(stamps[i] - stamp))
            if abs(stamps[nearest] - stamp) > 1e-6:
                return failed("'stamp_s' must be that of the image.", "a time of an image", f"{stamp:g}")
            found[nearest].append(bearing)
    if any(len(bearings) > 1 for bearings in found):
        return failed("An image was looked at twice: each has its own 'stamp_s'.", "one page 'heap_2d' an image", "two")
    right = sum(_is_right(one, bearings) for one, bearings in zip(given, found, strict=True))
    if right >= SHARE * PICTURES:
        return passed()
    hint = MISSED[case.kind]
    made = [(one.nearest_rad, bearing) for one, bearings in zip(given, found, strict=True) for bearing in bearings]
    for text, turned in MISTAKES:
        alike = sum(near is not None and _is_near(sorted(map(turned, near)), bearing) for near, bearing in made)
        if made and alike >= SHARE * len(made):
            hint = text
    return failed(hint, f"right in {SHARE:.0%} of {PICTURES} images", f"right in {right}")


def _is_near(near: Sequence[float], bearing: float) -> bool:
    return near[0] - SLACK_RAD <= bearing <= near[1] + SLACK_RAD


def _is_right(given: Picture, found: Sequence[float]) -> bool:
    if given.nearest_rad is None:
        return not found
    return bool(found) and _is_near(given.nearest_rad, found[0])


# -- states -----------------------------------------------------------------------------------------------------------

VISIBLE = ("stones in sight", "out of sight", "an old image", "a second search")


@check(
    points=20,
    visible=[Scene(kind, 4 + i) for i, kind in enumerate(VISIBLE)],
    hidden=drawn(list(TIMELINES), 1),
    needs=["own_process"],
)
def follows_states(student: Student, case: Scene) -> Verdict:
    """In each state it sends the events of the table, when they are due"""
    timeline = Timeline(case.seed)
    TIMELINES[case.kind](timeline)
    entries = run_timeline(student, timeline)
    verdict = judge_states(timeline, entries)
    return verdict if verdict.fraction < 1.0 else judge_rest(entries)


def run_timeline(student: Student, timeline: Timeline) -> list[Entry]:
    """Return what the student's components send."""
    made = student.run_inputs("stereo.py", timeline.pages, robot=robot_info())
    return entries_of_outputs(made, timeline.pages)


@check(points=10, visible=[Scene("anything", 1)], hidden=drawn(["anything"], 2), needs=["own_process"])
def all_together(student: Student, case: Scene) -> Verdict:
    """Whatever comes: all processes end a state before one of them begins the next"""
    entries = run_timeline(student, anything(case.seed))
    return few_events(entries) or together(entries)[0]


@check(points=10, visible=[Scene("anything", 2)], hidden=drawn(["anything"], 2), needs=["own_process"])
def events_once(student: Student, case: Scene) -> Verdict:
    """Whatever comes: each event changes the state once, in order, or is dropped if its state is over"""
    entries = run_timeline(student, anything(case.seed))
    verdict = each_event_once(entries, housecat().STATES)
    return verdict if verdict.fraction < 1.0 else few_events(entries) or verdict


def few_events(entries: Sequence[Entry]) -> Verdict | None:
    """Return a verdict if process_2d has sent too few events to be judged by."""
    own = [one for one in entries if one.source == "process_2d" and one.name == "reference.publish"]
    if len(own) >= MIN_OWN_EVENTS:
        return None
    hint = f"process_2d published too few events to be judged: {' and '.join(OF_2D)}, by self.publish_event."
    return failed(hint, f"{MIN_OWN_EVENTS} or more", f"{len(own)}")


# -- runs -------------------------------------------------------------------------------------------------------------


def clear(student: Student, file: str, seed: int, ranging: str = "stereo") -> tuple[Verdict, list[Change]]:
    """Run housecat_clear; judge whether the yard was cleared by processes that change their state together."""
    run = student.run_scenario("housecat_clear", seed, file, options={"ranging": ranging})
    entries = entries_of_run(run)
    verdict, changes = together(entries)
    if verdict.fraction == 1.0:
        verdict = each_event_once(entries, housecat().STATES)
    if verdict.fraction == 1.0 and not run.success:
        hint = "The yard was not cleared. Look at the states, and at what process_2d sent: snr trace RUN."
        verdict = failed(hint, "cleared", "; ".join([run.outcome, *run.notes]))
    return verdict, changes


@check(points=10, visible=[Yard(DEMO_SEED)], hidden=draw_yards(2), needs=["all_together"])
def clears_by_stereo(student: Student, case: Yard) -> Verdict:
    """In the yard: with the stereo camera, 80 % of the stones are in the pit within two minutes"""
    return clear(student, "stereo.py", case.seed)[0]


@check(points=5, needs=["own_process"])
def one_line(student: Student) -> Verdict:
    """lidar.py differs from stereo.py in one line."""
    before, after = (_lines(student.source(file)) for file in ("stereo.py", "lidar.py"))
    changes = [one for one in difflib.ndiff(before, after) if one[:1] in "+-"]
    removed, added = (sum(one[0] == sign for one in changes) for sign in "-+")
    if (removed, added) == (1, 1):
        return passed()
    if not changes:
        return failed("lidar.py is still stereo.py: name the states of Process_3D that use the lidar.", "one line", "0")
    hint = "Other sensors are other states of Process_3D, and nothing else changes."
    return failed(hint, "1 line taken away, 1 added", f"{removed} taken away, {added} added")


def _lines(source: str) -> list[str]:
    """Return the lines of a program without its comments and empty lines."""
    lines = [line.partition("#")[0].rstrip() for line in source.splitlines()]
    return [line for line in lines if line]


@check(points=10, visible=[Yard(DEMO_SEED)], hidden=draw_yards(2), needs=["all_together"])
def clears_by_lidar(student: Student, case: Yard) -> Verdict:
    """In the yard: with the lidar"""
    return clear(student, "lidar.py", case.seed, "lidar")[0]


@check(points=15, visible=[Yard(DEMO_SEED)], hidden=draw_yards(1), needs=["all_together"])
def slow_and_explained(student: Student, case: Yard) -> Verdict:
    """With two slow processes: no change of state takes longer than the slowest, and answers.py says why."""
    verdict, changes = clear(student, "slow.py", case.seed)
    if verdict.fraction < 1.0:
        return verdict
    longest_s = max(one.lasted_s for one in changes)
    if longest_s > WORK_S + STEP_S + 0.01:
        hint = "A change of state took longer than the slowest work: works must run next to each other."
        return failed(hint, f"at most {WORK_S + STEP_S:g} s", f"{longest_s:.2f} s")
    if longest_s < 0.5 * WORK_S:
        hint = "slow.py is not slow: a look takes 0.2 s in 2-D and 0.3 s in 3-D, as in the starter."
        return failed(hint, "changes that wait for work", f"at most {longest_s:.2f} s")
    return judge_answers(student, changes) if case.seed == DEMO_SEED else passed()


def judge_answers(student: Student, changes: Sequence[Change]) -> Verdict:
    """Judge the answers by the changes of state in the run that they are about."""
    given = student.call("answers.py", "answers")
    if not isinstance(given, dict):
        raise SubmissionError("answers() returned no dict.", "Keep the form of answers.py.")
    longest_s = max(one.lasted_s for one in changes)
    change = next((one for one in changes if one.epoch == given.get("epoch")), None)
    last_s = max(change.ended_s.values()) if change else 0.0
    last = [name for name, at_s in change.ended_s.items() if at_s > last_s - 1e-6] if change else []
    words = str(given.get("why", "")).split()
    parts = [
        (
            change is not None
            and change.lasted_s > longest_s - 1e-6
            and _is_about(given, "longest_s", longest_s, 0.006),
            "'epoch' or 'longest_s': which change of state took longest, from phase 'ending' to the next 'running'?",
        ),
        (given.get("last") in last, "'last': which process was the last to report 'reference.ended' in that epoch?"),
        (
            _is_about(given, "together_s", WORK_S, STEP_S + 0.01) and _is_about(given, "in_turn_s", 0.5, STEP_S + 0.01),
            "'together_s' or 'in_turn_s': works that run next to each other, and one after the other.",
        ),
        (8 <= len(words) <= 40, "'why' takes one sentence of 8 to 40 words. Your instructor reads it."),
    ]
    wrong = [hint for is_right, hint in parts if not is_right]
    if wrong:
        return partial_credit(1.0 - len(wrong) / (len(parts) + 1), wrong[0], "the answers of the trace", "others")
    return passed(note=" ".join(words))


def _is_about(given: dict[str, Any], name: str, right: float, slack: float) -> bool:
    value = given.get(name)
    return isinstance(value, (int, float)) and abs(value - right) <= slack


lab = Lab(
    "Two processes, one state",
    files=PROGRAMS,
    checks=[
        own_process,
        finds,
        follows_states,
        all_together,
        events_once,
        clears_by_stereo,
        one_line,
        clears_by_lidar,
        slow_and_explained,
    ],
)
