"""Checks of the lab "live programming": Dora's program by itself, in rooms, and the edits of a run.

A program in LRP is parsed and run in the student's process only. The record of a run could be written by hand: so its
edits are handed in, and the grader runs the room again with them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from snr_sim.grading import (
    Lab,
    Output,
    ScenarioRun,
    Stimulus,
    Student,
    SubmissionError,
    Verdict,
    check,
    failed,
    partial_credit,
    passed,
    require_field,
    require_page,
)
from snr_sim.grading.remote.parsers import toml_in
from snr_sim.scenario.machine_edits import TABLE, digest_of_changes

from .grader.reading import read_program

FILE, EDITS = "dora.lrp", "edits"
TRAP = Path(__file__).parent / "starter" / "trap.lrp"
TRAP_ROOM, TRAP_SEED = "dora_corners", 0
MIN_EDITS, MAX_EDITS = 3, 50
MAX_TEXT_BYTES = 16 * 2**10  # of a program
RUN_S = 300.0
PERIOD_S = 0.05  # of readings
FREE_CM, NEAR_CM = 150.0, 12.0
FRESH_S = 0.5  # an older reading is none, and an older command stops the motors
STOP_S = 0.1  # ten steps, from the event to motors that stand
UNSEEN_S = FRESH_S + 0.2
START_S = 2.0  # until it moves again


# -- the program by itself --------------------------------------------------------------------------------------------


@check(points=5)
def is_program(student: Student) -> Verdict:
    """It is a program without mistakes, in one file."""
    read = student.parse(FILE, read_program)
    if read["files"]:
        hint = "Hand in one file: a program without (import ...) and (actions ...)."
        return failed(hint, "no other file", ", ".join(read["files"])[:80])
    if read["mistake"]:
        return failed(
            "`snr machine check dora.lrp --robot dora` shows every mistake with its line.", "", read["mistake"]
        )
    if read["machine"] != "dora":
        return failed("Call the first machine that is spawned `dora`.", "dora", read["machine"][:40])
    student.run_inputs(FILE, [], robot="dora")  # it names parts of the robot, and only these
    return passed()


@check(points=10, needs=["is_program"])
def has_no_dead_end(student: Student) -> Verdict:
    """`snr machine explore` finds no state that cannot be reached or left, and no hidden transition."""
    found = student.parse(FILE, read_program)["findings"]
    if not found:
        return passed()
    return failed("`snr machine explore dora.lrp` shows the shortest way to each finding.", "nothing", found[0])


# -- timelines: readings and buttons, and whether the motors turn -----------------------------------------------------


@dataclass(frozen=True)
class Moment:
    """A timeline.

    Args:
        what: Dora does when something happens to it: "driving", "turning" or "touching".
        at_s: when that happens.
    """

    what: str
    at_s: float

    @property
    def label(self) -> str:
        """What it is about."""
        return f"while {self.what}"


class Timeline:
    """Readings of Dora's sensors, and buttons, over time."""

    def __init__(self) -> None:
        self.inputs: list[Stimulus] = []
        self.ticks = 0

    @property
    def now_s(self) -> float:
        """The time of the next readings."""
        return self.ticks * PERIOD_S

    def be(self, until_s: float, cm: float | None = FREE_CM, *, is_touching: bool = False) -> Timeline:
        """Advance the time with a distance to what is ahead; None: there is none."""
        while self.now_s < until_s - 1e-9:
            now_s = self.now_s
            if cm is not None:
                page = {"distance_m": cm / 100.0, "confidence": 1.0, "stamp_s": now_s}
                self.inputs.append(Stimulus(now_s, "range", page))
            touch = {"left": is_touching, "right": is_touching, "stamp_s": now_s}
            self.inputs.append(Stimulus(now_s, "touch", touch))
            self.ticks += 1
        return self

    def press(self, button: str) -> Timeline:
        """Bring an event."""
        self.inputs.append(Stimulus(self.now_s, task=("event", button, [])))
        return self

    def lead_to(self, moment: Moment) -> Timeline:
        """Have Dora do what a moment is about, until then: it waits, drives, and perhaps meets something."""
        self.be(0.3, None).be(min(2.0, moment.at_s))
        if moment.what == "touching":
            return self.be(moment.at_s, is_touching=True)
        return self.be(moment.at_s, NEAR_CM if moment.what == "turning" else FREE_CM)


class Motors:
    """What the motors were commanded, over time."""

    def __init__(self, made: Sequence[Output]) -> None:
        pages = [(one.at_s, require_page(one.value, "motors")) for one in made if one.name == "motors"]
        self.commands = [
            (at_s, *(require_field(page, "motors", name, float) for name in ("a", "d"))) for at_s, page in pages
        ]

    def turn_at(self, time_s: float) -> bool:
        """Return whether a motor turns: the newest command is not too old, and not 0."""
        newest = next((one for one in reversed(self.commands) if one[0] <= time_s + 1e-9), None)
        return newest is not None and time_s - newest[0] <= FRESH_S and newest[1:] != (0.0, 0.0)

    def first_turn_s(self, from_s: float, until_s: float) -> float | None:
        """Return the first time in an interval at which a motor turns, or None."""
        return next((at_s for at_s in _times(from_s, until_s) if self.turn_at(at_s)), None)


def _times(from_s: float, until_s: float) -> Iterator[float]:
    for i in range(math.ceil((until_s - from_s) / 0.01 - 1e-6)):
        yield from_s + 0.01 * i


def run_timeline(student: Student, timeline: Timeline) -> tuple[Motors, float]:
    """Return what the motors did on a timeline, and how many blocks failed."""
    made = student.run_inputs(FILE, timeline.inputs, robot="dora")
    pages = [require_page(one.value, "dora") for one in made if one.kind == "store_page" and one.name == "dora"]
    return Motors(made), require_field(pages[-1], "dora", "problems", float) if pages else 0.0


def moments(*kinds: str) -> Any:
    """Return what draws a moment of each kind."""
    return lambda rng: [Moment(kind, round(rng.uniform(2.2, 3.2), 2)) for kind in kinds]


@check(
    points=15,
    visible=[Moment("driving", 2.5), Moment("turning", 2.5)],
    hidden=moments("driving", "turning", "touching"),
    needs=["is_program"],
)
def stops(student: Student, case: Moment) -> Verdict:
    """Event `stop` stops it at once in every state, whatever its sensors see, until event `go`."""
    timeline = Timeline().lead_to(case).press("stop")
    stop_s = timeline.now_s
    timeline.be(stop_s + 1.0).be(stop_s + 2.0, NEAR_CM).be(stop_s + 3.0, is_touching=True)
    timeline.be(stop_s + 4.0, None).be(stop_s + 5.0).press("go")
    go_s = timeline.now_s
    motors, _ = run_timeline(student, timeline.be(go_s + START_S + 0.5))
    if motors.first_turn_s(0.5, stop_s) is None:
        return failed("With half a metre and more before it, it should drive.", "motors turn", "they stand")
    wrong_s = motors.first_turn_s(stop_s + STOP_S, go_s)
    if wrong_s is not None:
        hint = "It must stop at the event `stop`, in whatever state it is: which transition is tried first?"
        if wrong_s > stop_s + 2 * STOP_S:
            hint = "It was stopped, and drove again without the event `go`: which transition has led out of the stop?"
        return failed(hint, "motors stand until `go`", f"they turn {wrong_s - stop_s:.1f} s after `stop`")
    if motors.first_turn_s(go_s, go_s + START_S) is None:
        return failed("After the event `go` it must drive on.", "motors turn", "they stand")
    return passed()


@check(
    points=10,
    visible=[Moment("driving", 2.5)],
    hidden=moments("driving", "turning"),
    needs=["is_program"],
)
def stands_without_readings(student: Student, case: Moment) -> Verdict:
    """Without readings it stands, with readings it drives on, and no block fails."""
    timeline = Timeline().lead_to(case)
    unseen_s = timeline.now_s
    seen_s = timeline.be(unseen_s + 3.0, None).now_s
    motors, problems = run_timeline(student, timeline.be(seen_s + START_S + 0.5))
    if motors.first_turn_s(0.5, unseen_s) is None:
        return failed("With half a metre and more before it, it should drive.", "motors turn", "they stand")
    if motors.first_turn_s(unseen_s + UNSEEN_S, seen_s) is not None:
        return failed(
            "It drives although the ultrasonic sensor has sent nothing for half a second: read() is None then.",
            "motors stand",
            "they turn",
        )
    if motors.first_turn_s(seen_s, seen_s + START_S) is None:
        return failed("The sensor sends again: it must drive on.", "motors turn", "they stand")
    if problems:
        return failed(FAILED_BLOCK, "no block fails", f"{problems:g} failures")
    return passed()


FAILED_BLOCK = "A block has failed: None cannot be compared. `snr run` and `snr machine why` name the line."


# -- rooms ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Place:
    """A room and a start."""

    room: str
    seed: int

    @property
    def label(self) -> str:
        """What reports call it."""
        return f"{self.room}, seed {self.seed}"


def places(*rooms: str) -> Any:
    """Return what draws another start in each of some rooms."""
    return lambda rng: [Place(room, rng.getrandbits(63)) for room in rooms]


def exploration(run: ScenarioRun) -> Verdict:
    """Return whether a run has explored its room, and no block failed."""
    hit_mps, share = run.metrics.get("hit_mps", 0.0), run.metrics.get("seen_share", 0.0)
    if run.outcome == "collided":
        hint = "It hit something: what does the cone of the sensor not see, and how fast may Dora be there?"
        return failed(hint, "at most 0.1 m/s", f"{hit_mps:.2f} m/s after {run.sim_time_s:.0f} s")
    if not run.success:
        hint = "It has seen too little of the room: is it caught somewhere, or too slow?"
        return failed(hint, "60 % of the floor", f"{100 * share:.0f} %")
    if any(note.startswith("Machine '") and " failed " in note for note in run.notes):
        return failed(FAILED_BLOCK, "no block fails", "a block failed")
    return passed()


@check(
    points=25,
    visible=[Place(TRAP_ROOM, TRAP_SEED)],  # a flight takes some seconds
    hidden=places("dora_room", "dora_corners", "dora_corners"),
    needs=["is_program"],
)
def explores(student: Student, case: Place) -> Verdict:
    """In five minutes it sees 60 % of the floor, and hits nothing faster than 0.1 m/s."""
    return exploration(student.run_scenario(case.room, seed=case.seed, controller=FILE))


@check(points=10, visible=[Place("dora_room", 0)], hidden=places("dora_corners"), needs=["is_program"])
def explores_late(student: Student, case: Place) -> Verdict:
    """It does so over a slow line as well (`--option wire=wifi`)."""
    verdict = exploration(student.run_scenario(case.room, seed=case.seed, controller=FILE, options={"wire": "wifi"}))
    if verdict.expected == "at most 0.1 m/s":
        hint = "Over a slow line it hit something: how far does it move in the 120 ms until it knows, and acts?"
        return failed(hint, verdict.expected, verdict.actual)
    return verdict


# -- the edited run ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class EditedRun:
    """What `snr machine edits` has written: the times of edits, their texts, and the digest of what followed."""

    at_s: list[float]
    texts: list[str]
    changes: str


def edited_run(student: Student) -> EditedRun:
    """Return the edited run that was handed in.

    Raises:
        SubmissionError: a file is missing, too long, or not as `snr machine edits` writes it.
    """
    table = student.parse(f"{EDITS}/{TABLE}", toml_in)
    room = (table.get("scenario"), table.get("seed"), table.get("options", {}))
    if room != (TRAP_ROOM, TRAP_SEED, {}):
        hint = "Hand in the edits of a run in dora_corners with seed 0, without options."
        raise SubmissionError(f"{TABLE} is of another run.", hint, f"{TRAP_ROOM}, seed {TRAP_SEED}", str(room)[:80])
    at_s, changes = table.get("at_s"), table.get("changes")
    if not isinstance(at_s, list) or not all(type(one) in (int, float) and 0.0 < one < RUN_S for one in at_s):
        raise SubmissionError(
            f"`at_s` in {TABLE} is not a list of times.", "Keep what `snr machine edits` has written."
        )
    if at_s != sorted(at_s) or not isinstance(changes, str):
        raise SubmissionError(f"{TABLE} has been changed.", "Keep what `snr machine edits` has written.")
    if len(at_s) > MAX_EDITS:
        raise SubmissionError(f"{TABLE} has {len(at_s)} edits.", f"At most {MAX_EDITS} edits in one run.")
    texts = [student.source(f"{EDITS}/{number}.lrp", MAX_TEXT_BYTES) for number in range(len(at_s) + 1)]
    return EditedRun([float(one) for one in at_s], texts, changes)


@check(points=10)
def edited_in_flight(student: Student) -> Verdict:
    """The run begins with trap.lrp, and was edited at least three times."""
    run = edited_run(student)
    first, *later = (text.split() for text in run.texts)
    if first != TRAP.read_text(encoding="utf-8").split():
        return failed(
            "Begin the run with a copy of trap.lrp as it is, and change it while Dora drives.", "trap.lrp", ""
        )
    different = {tuple(text) for text in later} - {tuple(first)}
    if len(different) < MIN_EDITS:
        return failed(
            "Go in small steps, and look what each one does before the next.",
            f"at least {MIN_EDITS} different programs",
            f"{len(different)}",
        )
    return passed()


@check(points=15, needs=["edited_in_flight"])
def replays(student: Student) -> Verdict:
    """Run again with these edits, each state changes as in your run, and the room is explored."""
    edited = edited_run(student)
    inputs = [
        Stimulus(at_s, task=("event", "dora.edit", [text]))
        for at_s, text in zip(edited.at_s, edited.texts[1:], strict=True)
    ]
    run = student.run_scenario(TRAP_ROOM, seed=TRAP_SEED, controller=f"{EDITS}/0.lrp", inputs=inputs)
    answers = [require_page(page, "dora.edited") for _, page in run.pages("dora.edited")]
    taken = {
        require_field(one, "dora.edited", "sha256", str)
        for one in answers
        if require_field(one, "dora.edited", "ok", bool)
    }
    if len(taken) < MIN_EDITS:
        hint = "A text with mistakes changes nothing, and after the end of a run nothing can be changed."
        return failed(hint, f"at least {MIN_EDITS} programs that the machine took", f"{len(taken)}")
    if digest_of_changes(run.trace.records) != edited.changes:
        return failed(
            "Run again with these edits, the states change differently: hand in the files that `snr machine edits` has "
            "written for your run, all of them, unchanged.",
            "identical",
            "another run",
        )
    explored = exploration(run)
    if explored.fraction < 1.0:
        return partial_credit(
            0.5, f"It replays, but has not explored. {explored.hint}", explored.expected, explored.actual
        )
    return passed()


lab = Lab(
    "Live programming",
    files=[FILE],
    checks=[
        is_program,
        has_no_dead_end,
        stops,
        stands_without_readings,
        explores,
        explores_late,
        edited_in_flight,
        replays,
    ],
)
