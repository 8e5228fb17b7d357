"""How "supervision" is graded. Hidden stories and moments are drawn from the instructor's secret, not from here.

What a plan must lead to is tried with the kit's own tree of supervisors, `snr_sim.supervision`, in virtual time: who is
started, ended and killed in a story, and when. The times are those of lab 15's page: no limit here is a measurement.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from snr_sim.grading import Lab, Stimulus, Student, Verdict, check, failed, passed, require_field

from .grader.bench import Bench

PLAN, DRIVE = "supervise.py", "drive.py"
PARTS = ("motors", "state_manager", "camera", "detector", "navigator", "page")
RESTARTS, WITHIN_S = 3, 30.0
CAMERA_S = 20.0  # which a camera needs to start
MOTORS_S = 0.5  # after which silent motors are ended
ROLLING_M, LEASE_S, CLOCK_S = 0.1255, 0.2, 0.02
TOGETHER = {part: {part} for part in PARTS} | {"camera": {"camera", "detector"}}
SOLVED = "it is this lab, solved"


@dataclass(frozen=True)
class Watched:
    """A story of a watchdog: parts with timeouts, and moments at which it is asked."""

    seed: int


@dataclass(frozen=True)
class Failures:
    """How many failures there were in a row."""

    count: int


@dataclass(frozen=True)
class Restarts:
    """When a part was started again, and now."""

    restarted_s: tuple[float, ...]
    now_s: float


@dataclass(frozen=True)
class Story:
    """What happens to a part, and when first."""

    what: str
    part: str
    at_s: float


@dataclass(frozen=True)
class Sticks:
    """How a drive begins, and how its stick moves."""

    what: str
    seed: int


def watched(rng: random.Random) -> list[Watched]:
    """Draw three stories."""
    return [Watched(rng.getrandbits(31)) for _ in range(3)]


def failures(rng: random.Random) -> list[Failures]:
    """Draw some numbers of failures, and a large one."""
    return [Failures(count) for count in (*rng.sample(range(2, 6), 2), rng.randrange(40, 5000))]


def restart_times(rng: random.Random) -> list[Restarts]:
    """Draw restarts of which some are too long ago, and one exactly so long."""
    cases = []
    for recent in (RESTARTS - 1, RESTARTS, RESTARTS - 1):
        now_s = float(rng.randrange(200, 900))
        times = [now_s - WITHIN_S, *(now_s - rng.uniform(0.1, WITHIN_S - 0.1) for _ in range(recent))]
        times += [now_s - rng.uniform(WITHIN_S + 1.0, 150.0) for _ in range(rng.randrange(1, 4))]
        cases.append(Restarts(tuple(sorted(times)), now_s))
    return cases


def failing_parts(rng: random.Random) -> list[Story]:
    """Draw a moment for each part."""
    return [Story("fails", part, round(rng.uniform(6.0, 40.0), 1)) for part in PARTS]


def stories(rng: random.Random) -> list[Story]:
    """Draw a moment for each story."""
    return [Story(what, part, round(rng.uniform(16.0, 40.0), 1)) for what, part in STORIES]


def sticks(rng: random.Random) -> list[Sticks]:
    """Draw two drives of each kind."""
    return [Sticks(what, rng.getrandbits(31)) for what in DRIVES for _ in range(2)]


@check(points=5, visible=[None])
def loads(student: Student, case: None) -> Verdict:
    """Has its functions, and a plan with the six parts of the rover."""
    student.call(PLAN, "delay_s", 0, returns=float)
    student.call(PLAN, "may_restart", [], 0.0, returns=bool)
    got = student.create_object(PLAN, Bench).ask("processes", returns=list[str])
    if sorted(got) != sorted(PARTS):
        hint = "plan() has one Child for each part of the rover, in any depth: step 5."
        return failed(hint, expected=", ".join(PARTS), actual=", ".join(got))
    return passed()


# -- watchdog, delays, budget -----------------------------------------------------------------------------------------


def watched_story(seed: int) -> tuple[list[list[object]], list[tuple[str, list[str]]]]:
    """Return a story, and for each question what it is about and the right answer."""
    rng = random.Random(seed)
    one, two, long = rng.sample(PARTS, 3)
    story: list[list[object]] = [["add", one, 1.0, 0.0], ["add", two, 2.0, 0.0], ["add", long, 50.0, 0.0]]
    answers: list[tuple[str, list[str]]] = []

    def ask(about: str, now_s: float, *names: str) -> None:
        story.append(["hanging", now_s])
        answers.append((about, sorted(names)))

    early = 0.25 * rng.randrange(1, 4)
    ask("A part that was added hangs only after its timeout.", early)
    ask("A part hangs once it has been silent for its whole timeout: >=, not > or ==.", 1.0, one)
    story.append(["pet", one, 1.5])
    ask("A part that reports works again.", 1.75)
    ask("Each part has its own timeout, counted from its own last report. Sort the names.", 3.0, one, two)
    story += [["pet", one, 3.0], ["pet", two, 3.0], ["pet", "unknown", 3.0]]
    ask("A part that was never added is not watched, also if it reports.", 40.0, one, two)
    story += [["pet", one, 45.0], ["extend", one, 4.0]]
    ask("extend changes the timeout, not the time of the last report; the silence may jump over it.", 49.5, one, two)
    story += [["pet", two, 49.5], ["extend", two, 0.5]]
    ask("A timeout may become shorter, too.", 50.25, one, two, long)
    return story, answers


@check(points=20, visible=[Watched(1)], hidden=watched, needs=["loads"])
def watchdog(student: Student, case: Watched) -> Verdict:
    """Knows which parts have been silent for too long."""
    story, answers = watched_story(case.seed)
    got = student.create_object(PLAN, Bench).ask("hanging", story, returns=list[list[str]])
    questions = [moment for moment in story if moment[0] == "hanging"]
    for (about, right), names, (_, now_s) in zip(answers, got, questions, strict=True):
        if names != right:
            hint = "It never finds one: step 2 begins in Watchdog." if not any(got) else about
            return failed(hint, f"{right} at {now_s} s", f"{names}")
    return passed()


@check(points=10, visible=[Failures(0), Failures(1)], hidden=failures, needs=["loads"])
def delays(student: Student, case: Failures) -> Verdict:
    """Waits longer after each failure, and 5 s at most."""
    right = min(0.1 * 2.0 ** min(case.count, 60), 5.0)
    got = float(student.call(PLAN, "delay_s", case.count, returns=float))
    if abs(got - right) <= 1e-9:
        return passed()
    hint = "0.1 s after no earlier failure, then twice as long after each, and never more than 5 s."
    if got == 0.0:
        hint = "It does not wait: step 3 begins in delay_s."
    elif abs(got - 0.1 * (case.count + 1)) <= 1e-9:
        hint = "It grows by 0.1 s each time. Twice as long each time: 0.1, 0.2, 0.4, 0.8."
    elif got > 5.0:
        hint = "It grows without an end: 5 s at most."
    return failed(hint, f"delay_s({case.count}) is {right:g} s", f"{got:g} s")


@check(
    points=10,
    visible=[Restarts((), 5.0), Restarts((1.0, 2.0, 3.0), 20.0)],
    hidden=restart_times,
    needs=["loads"],
)
def budget(student: Student, case: Restarts) -> Verdict:
    """Starts a part again at most three times in 30 s."""
    recent = [one for one in case.restarted_s if case.now_s - one < WITHIN_S]
    right = len(recent) < RESTARTS
    got = student.call(PLAN, "may_restart", list(case.restarted_s), case.now_s, returns=bool)
    if got == right:
        return passed()
    hint = "Only restarts of the last 30 s count; one exactly 30 s ago does not."
    if got and len(case.restarted_s) == RESTARTS:
        hint = "It always may: step 4 begins in may_restart. Three restarts in 30 s are all there are."
    elif got:
        hint = "Three restarts in 30 s are all there are: a fourth is refused."
    return failed(hint, f"{right} with {len(recent)} restarts in the last 30 s", f"{got}")


# -- the plan ---------------------------------------------------------------------------------------------------------

Orders = list[tuple[float, str, str]]


def orders_of(
    student: Student, events: Sequence[tuple[float, str, str]], until_s: float, camera_s: float = 0.0
) -> Orders:
    """Return what the plan leads to; a camera takes its time to start."""
    bench = student.create_object(PLAN, Bench)
    return list(bench.ask("orders", events, {"camera": camera_s}, until_s, returns=Orders, budget_s=5.0))


@check(points=15, visible=[Story("fails", "camera", 30.0)], hidden=failing_parts, needs=["loads"])
def restarts(student: Student, case: Story) -> Verdict:
    """Starts again what has failed, with all that is useless without it, and nothing else."""
    orders = orders_of(student, [(case.at_s, "fails", case.part)], case.at_s + 8.0)
    again = {part for at_s, what, part in orders if what == "start" and at_s >= case.at_s}
    right = TOGETHER[case.part]
    if again == right:
        return passed()
    missing, more = right - again, again - right
    hint = f"A failed '{case.part}' does not need {join(more)} started again: put what is independent apart."
    if case.part in missing:
        hint = f"A failed '{case.part}' is not started again: Child has restart='on_failure' for that."
    elif missing:
        hint = 'The detector is useless without its camera: a Supervisor of both, strategy="rest_for_one".'
    elif case.part == "detector":
        hint = "A failed 'detector' leaves the camera as it is: the camera comes first in their Supervisor."
    return failed(hint, f"started again: {join(right)}", join(again) or "nothing")


def join(parts: set[str]) -> str:
    """Return names as text."""
    return ", ".join(sorted(parts))


def starts_in_order(orders: Orders, case: Story) -> str:
    """Motors first; then the state manager, before all that send messages."""
    started = [part for at_s, what, part in orders if what == "start" and at_s == 0.0]
    if started[:1] != ["motors"]:
        return "The motors are started first, so that they brake whatever else begins."
    return "" if started[1:2] == ["state_manager"] else "The state manager is started before all that send messages."


def ends_in_order(orders: Orders, case: Story) -> str:
    """Motors last."""
    ended = [part for _, what, part in orders if what == "end"]
    return "" if ended[-1:] == ["motors"] else "The motors are ended last: they brake while all others end."


def page_alone(orders: Orders, case: Story) -> str:
    """A page that fails often costs no other part anything."""
    later = [(what, part) for at_s, what, part in orders if at_s >= case.at_s and part != "page"]
    if any(what == "safe stop" for what, _ in later):
        return "A page that failed five times stopped the rover. Give it a Supervisor of its own, with its own budget."
    return "" if not later else f"A page that failed five times took {join({part for _, part in later})} with it."


def camera_in_peace(orders: Orders, case: Story) -> str:
    """A camera that starts slowly is not taken for one that hangs."""
    was_ended = any(part == "camera" and what in ("end", "kill") for _, what, part in orders)
    return "A camera needs 20 s to start. Give it Timeouts(setup_s=...)." if was_ended else ""


def motors_at_once(orders: Orders, case: Story) -> str:
    """Motors that are silent for half a second are ended."""
    ended_s = next((at_s for at_s, what, part in orders if (what, part) == ("end", "motors")), None)
    if ended_s is None or ended_s > case.at_s + MOTORS_S + 0.25:
        return "Motors that are silent for 0.5 s hang: Timeouts(hang_s=...). The default is 5 s."
    again = any(at_s >= ended_s and (what, part) == ("start", "motors") for at_s, what, part in orders)
    return "" if again else "Motors that hung are started again."


def planner_in_peace(orders: Orders, case: Story) -> str:
    """A navigator that thinks for three seconds does not hang."""
    was_ended = any(part == "navigator" and what in ("end", "kill") for _, what, part in orders)
    return "A navigator may think for three seconds: only the motors have a short time-out." if was_ended else ""


def page_closed(orders: Orders, case: Story) -> str:
    """A page that a person closes stays closed."""
    again = any(at_s >= case.at_s and (what, part) == ("start", "page") for at_s, what, part in orders)
    return "A page that a person has closed is started again. restart='on_failure' leaves it closed." if again else ""


STORIES: dict[tuple[str, str], Callable[[Orders, Story], str]] = {
    ("begins", "motors"): starts_in_order,
    ("stops", "motors"): ends_in_order,
    ("fails five times", "page"): page_alone,
    ("starts slowly", "camera"): camera_in_peace,
    ("freezes", "motors"): motors_at_once,
    ("thinks", "navigator"): planner_in_peace,
    ("finishes", "page"): page_closed,
}


@check(
    points=20,
    visible=[Story(what, part, 30.0) for what, part in STORIES if what in ("begins", "starts slowly", "finishes")],
    hidden=stories,
    needs=["loads"],
)
def tree(student: Student, case: Story) -> Verdict:
    """The tree begins and ends in order, waits where it must, and ends silent motors soon."""
    events = {
        "stops": [(case.at_s, "stop", "")],
        "fails five times": [(case.at_s + 2.0 * i, "fails", "page") for i in range(5)],
        "freezes": [(case.at_s, "freezes", "motors")],
        "thinks": [(case.at_s, "freezes", "navigator")],
        "finishes": [(case.at_s, "finishes", "page")],
    }.get(case.what, [])
    until_s = case.at_s + {"thinks": 3.0, "fails five times": 20.0}.get(case.what, 8.0)
    orders = orders_of(student, events, until_s, CAMERA_S if case.what == "starts slowly" else 0.0)
    wrong = STORIES[case.what, case.part](orders, case)
    if not wrong:
        return passed()
    shown = "; ".join(f"{at_s:.1f} s: {what} {part}".rstrip() for at_s, what, part in orders if at_s > 0.0)
    return failed(wrong, "as the table of step 5 says", shown[:300] or "nothing happens after the start")


# -- the drive --------------------------------------------------------------------------------------------------------

DRIVES = ("steady", "silence", "old command", "overtaken")


def drive_pages(case: Sticks) -> tuple[list[Stimulus], list[float]]:
    """Return a drive's pages, and for each page "imu" the speed that is due [m/s]."""
    rng = random.Random(case.seed)
    begun_s, pages, due = round(rng.uniform(50.0, 80.0), 2), list[Stimulus](), list[float]()
    made: list[tuple[float, float, float]] = []  # when a stick arrives, when it was made, its speed
    first = begun_s + 0.203  # no page falls on the very end of a lease
    if case.what == "old command":  # which the state manager sends again; and one from before, that came late
        made += [(0.0, begun_s - rng.uniform(0.03, 0.15), 0.8), (0.05, begun_s - 0.02, 0.7)]
    for i in range(20):
        made_s = first + 0.05 * i
        if case.what == "silence" and 8 <= i < 16:
            continue
        made.append((made_s - begun_s + 0.01, made_s, round(rng.uniform(0.1, 0.9), 2)))
    if case.what == "overtaken":
        for i in range(4, 20, 4):
            _, made_s, speed = made[i]
            made[i] = (made[i + 1][0] + 0.005, made_s, speed)
    newest: tuple[float, float] | None = None
    arrivals = sorted(made)
    for i in range(round(1.6 / CLOCK_S)):
        now_s = i * CLOCK_S
        stamp_s = begun_s + now_s
        while arrivals and arrivals[0][0] <= now_s:
            _, made_s, speed = arrivals.pop(0)
            pages.append(Stimulus(now_s, "stick", {"made_s": made_s, "speed_mps": speed}))
            if made_s > begun_s and (newest is None or made_s > newest[0]):
                newest = made_s, speed
        pages.append(Stimulus(now_s, "imu", {"stamp_s": stamp_s}))
        is_fresh = newest is not None and stamp_s - newest[0] <= LEASE_S
        due.append(newest[1] if newest is not None and is_fresh else 0.0)
    return pages, due


@check(points=20, visible=[Sticks("steady", 1), Sticks("old command", 2)], hidden=sticks)
def drives(student: Student, case: Sticks) -> Verdict:
    """Follows the stick, brakes in silence, and after a restart waits for a new command."""
    pages, due = drive_pages(case)
    found: list[float] = []
    for output in student.run_inputs(DRIVE, pages, robot="rover"):
        if output.kind == "store_page" and output.name == "drive":
            mode = require_field(output.value, "drive", "mode", str)
            values = require_field(output.value, "drive", "values", list)
            found.append(float(values[0]) * ROLLING_M if mode == "speed" and values else 0.0)
    if len(found) != len(due):
        return failed("Each page 'imu' is answered by one page 'drive'.", f"{len(due)} pages", f"{len(found)}")
    wrong = [i for i, (got, right) in enumerate(zip(found, due, strict=True)) if abs(got - right) > 1e-6]
    if not wrong:
        return passed()
    i = wrong[0]
    hint = "It does not drive as the newest stick says."
    if found[i] and not any(due[: i + 1]):
        hint = "It moves by a stick from before its begin: after a restart it waits for one made later. Step 6."
    elif found[i] and not due[i]:
        hint = "The stick is silent, and it drives on: a command counts for LEASE_S. Step 7."
    elif case.what == "overtaken":
        hint = "A stick that was overtaken replaces a newer one: compare made_s with that of the last. Step 6."
    actual = f"{found[i]:.2f} m/s, {i * CLOCK_S:.2f} s after its begin"
    return failed(hint, f"{due[i]:.2f} m/s", actual)


lab = Lab(
    "Supervision",
    files=[PLAN, DRIVE],
    checks=[loads, watchdog, delays, budget, restarts, tree, drives],
    refused={f"snr_sim.supervision.{module}": SOLVED for module in ("watch", "tree", "members")},
)
