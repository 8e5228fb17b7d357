"""What the grader tries a submission of this lab on; only it reads this. Plant, board and pages are in its process."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from snr_sim.grading import Lab, ScenarioRun, Stimulus, Student, Verdict, check, failed, passed, require_field
from snr_sim.grading.remote.parsers import MAX_PARSED_BYTES
from snr_sim.plants.urov.t200 import MAX_PULSE_US, MIN_PULSE_US, STOP_US

SCENARIO, FILE = "urov_depth_hold", "depth_hold.py"
CONTROLS_HZ, DEPTH_HZ, IMU_HZ = 20, 20, 50
LATE_S = 0.35  # after the last page: 0.3 s are asked for, and control ticks every 20 ms
SOON_S = 0.6  # in which it must push, once it may
JUMP_US = 60.0  # from neutral, for one who holds where he is: 30 us of these do not turn anything
HERE_M, GOAL_M = 1.0, 3.0

CONTROLS: dict[str, Any] = {
    "number": 0,
    "mode": "heading_hold",
    "is_armed": False,
    "is_stop": False,
    "clears_stop": False,
    "surge": 0.0,
    "sway": 0.0,
    "heave": 0.0,
    "yaw": 0.0,
    "depth_m": None,
    "heading_rad": None,
}
IMU = {"roll_rad": 0.0, "pitch_rad": 0.0, "yaw_rad": 0.0, "rate_radps": [0.0, 0.0, 0.0]}

At = Callable[[float], Any]
Pulses = list[tuple[float, list[float]]]


@dataclass(frozen=True)
class Moment:
    """Something that happens to the pages at a moment."""

    what: str
    at_s: float

    @property
    def label(self) -> str:
        """What reports call it."""
        return f"{self.what}, at {self.at_s:.1f} s"


def moments(*whats: str) -> Callable[[random.Random], list[Moment]]:
    """Return what draws one hidden moment for each."""
    return lambda rng: [Moment(what, round(rng.uniform(2.0, 4.0), 2)) for what in whats]


def seeds(count: int) -> Callable[[random.Random], list[int]]:
    """Return what draws so many seeds."""
    return lambda rng: [rng.getrandbits(63) for _ in range(count)]


def armed(time_s: float) -> dict[str, Any]:
    """Return controls as a pilot sends them who wants to go down to GOAL_M."""
    return {**CONTROLS, "is_armed": True, "depth_m": GOAL_M}


def here(time_s: float) -> float:
    """Return the depth of a vehicle that stays where it is."""
    return HERE_M


def pulses(
    student: Student, until_s: float, controls_at: At, depth_at: At = here, more: list[Stimulus] | None = None
) -> Pulses | Verdict:
    """Return the times and pulses of each page `pwm`, or what is wrong with one of them.

    Args:
        student: whose components get the pages.
        until_s: for how long they come.
        controls_at, depth_at: what is in them at a time; None: store no page.
        more: further pages.
    """
    given = list(more or [])
    for i in range(round(until_s * CONTROLS_HZ)):
        controls = controls_at(i / CONTROLS_HZ)
        if controls is not None:
            given.append(Stimulus(i / CONTROLS_HZ, "controls", controls))
    for i in range(round(until_s * DEPTH_HZ)):
        depth_m = depth_at(i / DEPTH_HZ)
        if depth_m is not None:
            given.append(Stimulus(i / DEPTH_HZ, "depth", {"depth_m": depth_m, "stamp_s": i / DEPTH_HZ}, process=False))
    given.extend(Stimulus(i / IMU_HZ, "imu", {**IMU, "stamp_s": i / IMU_HZ}) for i in range(round(until_s * IMU_HZ)))
    given.sort(key=lambda one: one.at_s)
    for number, one in enumerate(given):
        if one.key == "controls":
            given[number] = Stimulus(one.at_s, "controls", {**one.value, "number": number})
    found = []
    for one in student.run_inputs(FILE, given):
        if one.kind == "store_page" and one.name == "pwm":
            values = require_field(one.value, "pwm", "pulses_us", list[float], count=8)
            wild = [value for value in values if not MIN_PULSE_US <= value <= MAX_PULSE_US]
            if wild:
                return failed(
                    f"Clamp the pulses to {MIN_PULSE_US:g} to {MAX_PULSE_US:g} us, for every input.",
                    expected="eight such numbers",
                    actual=f"{wild[0]:g} at {one.at_s:.2f} s",
                )
            found.append((one.at_s, values))
    if not found:
        return failed("It stores no page `pwm` although controls, depth and imu arrive.", "a page for each imu", "none")
    return found


def pushed(found: Pulses, from_s: float = 0.0, until_s: float = math.inf) -> list[float]:
    """Return when, between two moments, not all pulses were neutral."""
    return [t for t, values in found if from_s - 1e-9 <= t < until_s - 1e-9 and any(one != STOP_US for one in values)]


def neutral_error(found: Pulses, at_s: float, hint: str, until_s: float = math.inf) -> Verdict | None:
    """Return what is wrong with pulses that should be neutral from LATE_S after a moment on, having pushed before."""
    if not pushed(found, at_s - 0.5, at_s):
        return failed("It does not push, though it is armed, and has a goal and a depth.", "pulses", "1500")
    late = pushed(found, at_s + LATE_S, until_s)
    if late:
        return failed(hint, f"1500 from {at_s + LATE_S:.2f} s on", f"it pushes at {late[0]:.2f} s")
    return None


@check(points=5, visible=[20.0, -20.0])
def limits(student: Student, off_m: float) -> Verdict:
    """However far away the goal is, pulses are eight numbers within the limits."""
    found = pulses(student, 2.0, armed, lambda t: GOAL_M + off_m)
    return found if isinstance(found, Verdict) else passed()


@check(points=5, visible=[Moment("disarmed", 2.5)], hidden=moments("disarmed"))
def disarmed(student: Student, case: Moment) -> Verdict:
    """Pushes while it is armed, and only then."""
    found = pulses(student, case.at_s + 1.5, lambda t: armed(t) if 1.0 <= t < case.at_s else CONTROLS)
    if isinstance(found, Verdict):
        return found
    if pushed(found, 0.0, 1.0):
        return failed("It pushes before it is armed.", "1500 until it is armed", "another pulse")
    return neutral_error(found, case.at_s, "It still pushes after the controls disarmed it.") or passed()


@check(
    points=10,
    visible=[Moment("controls end", 2.5), Moment("depth ends", 2.5)],
    hidden=moments("controls end", "depth ends"),
)
def stale(student: Student, case: Moment) -> Verdict:
    """Nothing pushes once the newest controls, or the newest depth, are too old."""
    is_controls = case.what == "controls end"
    found = pulses(
        student,
        case.at_s + 1.5,
        lambda t: armed(t) if not is_controls or t < case.at_s else None,
        lambda t: HERE_M if is_controls or t < case.at_s else None,
    )
    if isinstance(found, Verdict):
        return found
    page = "controls" if is_controls else "depth"
    hint = f"It still pushes after the last page `{page}`: check the age of the page with get_age_s."
    return neutral_error(found, case.at_s, hint) or passed()


STOPS = ("a stop", "a stop in one page", "a stop, then cleared while armed")


@check(points=10, visible=[Moment(what, 2.5) for what in STOPS], hidden=moments(*STOPS))
def stop(student: Student, case: Moment) -> Verdict:
    """After a stop nothing pushes until it is cleared, disarmed; then it pushes again."""
    at_s = round(case.at_s * CONTROLS_HZ) / CONTROLS_HZ
    is_brief, clears_armed = case.what == STOPS[1], case.what == STOPS[2]
    cleared_s = at_s + 1.5  # properly

    def controls_at(t: float) -> dict[str, Any]:
        if at_s <= t < at_s + 0.1 and not is_brief:
            return {**armed(t), "is_stop": True}
        if clears_armed and at_s + 0.6 <= t < at_s + 0.8:
            return {**armed(t), "clears_stop": True}
        return {**CONTROLS, "clears_stop": True} if cleared_s <= t < cleared_s + 0.2 else armed(t)

    # One page alone, overtaken by the next before the imu comes.
    brief = [Stimulus(at_s + 0.001, "controls", {**armed(at_s), "is_stop": True})]
    brief.append(Stimulus(at_s + 0.002, "controls", armed(at_s)))
    found = pulses(student, cleared_s + 1.0, controls_at, more=brief if is_brief else None)
    if isinstance(found, Verdict):
        return found
    hint = "After a stop it pushes again before the stop is cleared: keep it in `self.is_stopped`."
    if is_brief:
        hint = "A stop that was sent in one page only was missed: handle every page `controls`, not only the newest."
    elif clears_armed:
        hint = "A page that clears a stop counts only if it is disarmed: otherwise the vehicle moves at once."
    wrong = neutral_error(found, at_s, hint, cleared_s)
    if wrong:
        return wrong
    if not pushed(found, cleared_s + 0.2, cleared_s + 0.2 + SOON_S):
        return failed("The stop was cleared while disarmed, then it was armed; it does not push.", "pulses", "1500")
    return passed()


@check(
    points=5,
    visible=[Moment("armed again", 2.5), Moment("controls resume", 2.5)],
    hidden=moments("armed again", "controls resume"),
)
def no_jump(student: Student, case: Moment) -> Verdict:
    """An old goal, or an integral from before, does not push when the outputs are enabled again."""
    again_s = case.at_s + (1.0 if case.what == "armed again" else 6.0)

    def controls_at(t: float) -> dict[str, Any] | None:
        if t >= again_s:
            return {**armed(t), "depth_m": None if case.what == "armed again" else depth_at(t)}
        if case.what == "armed again":
            return armed(t) if t < case.at_s else CONTROLS
        return {**armed(t), "depth_m": HERE_M} if t < case.at_s else None

    def depth_at(t: float) -> float:
        drift = 0.0 if case.what == "armed again" else min(0.5, max(0.0, 0.1 * (t - case.at_s)))
        return HERE_M + drift

    found = pulses(student, again_s + 0.6, controls_at, depth_at)
    if isinstance(found, Verdict):
        return found
    off_us = max((max(abs(one - STOP_US) for one in values) for t, values in found if t >= again_s), default=0.0)
    if off_us <= JUMP_US:
        return passed()
    hint = "Armed again without a goal, it goes to the old goal: reset the goal while the outputs are neutral."
    if case.what == "controls resume":
        hint = "It pushes hard although it is at its goal: reset the integral while the outputs are neutral."
    return failed(hint, f"within {JUMP_US:g} us of 1500", f"{off_us:.0f} us off")


def dive_verdict(run: ScenarioRun) -> Verdict:
    """Return the verdict over a dive."""
    metrics = run.metrics
    if run.success:
        return passed(metrics={"settling_s": metrics["settling_s"], "steady_error_m": metrics["steady_error_m"]})
    actual = next((note for note in run.notes if note.startswith(run.outcome)), run.outcome)
    if metrics["steady_error_m"] > 0.5:
        hint = "It does not approach its goal: are the pulses beyond the dead band, and in the right direction?"
    elif metrics["overshoot_m"] > 0.2:
        hint = "It overshoots its goal: do not let the integral grow on the way, and brake in proportion to the speed."
    elif "steady-state error" in actual:
        hint = "A steady-state error remains: which term sums the error over time?"
    else:
        hint = "It reaches its goal too slowly, or does not come to rest."
    return failed(hint, "held, by the scenario's limits", actual)


@check(points=35, visible=[0], hidden=seeds(4))
def holds(student: Student, seed: int) -> Verdict:
    """Holds its depth in simulation."""
    return dive_verdict(student.run_scenario(SCENARIO, seed=seed, controller=FILE))


@check(points=20, visible=[0], hidden=seeds(1), needs=["limits", "disarmed", "stale", "stop", "no_jump", "holds"])
def holds_on_the_board(student: Student, seed: int) -> Verdict:
    """Holds its depth with its thrusters at the pins of the emulated board: the same file, once it is safe."""
    return dive_verdict(student.run_scenario(SCENARIO, seed=seed, controller=FILE, io="emulated"))


UNITS = "ms|s|us|mm|cm|m|mV|V|steps|%|bits?|seconds?|times"


@check(points=10, visible=[1, 2, 3, 4, 5])
def answered(student: Student, number: int) -> Verdict:
    """answers.md answers each question, with a number."""
    parts = re.split(r"^## *(\d)\b.*$", student.source("answers.md", MAX_PARSED_BYTES), flags=re.MULTILINE)
    texts = dict(zip(parts[1::2], parts[2::2], strict=True))
    words = texts.get(str(number), "").split()
    same = [other for other, text in texts.items() if other != str(number) and text.split() == words]
    has_number = re.search(rf"\d *({UNITS})(?!\w)", " ".join(words)) is not None
    if len(words) >= 8 and has_number and not same:
        return passed(note=" ".join(words)[:300])
    return failed(
        f"Answer question {number} below its heading `## {number}`, in a sentence or two of its own, with a number "
        "that you have read from your runs, and its unit.",
        expected="8 words or more, a number with its unit, and no answer twice",
        actual=f"{len(words)} words" + (f", the same as at {', '.join(same)}" if same else ""),
    )


lab = Lab(
    "Sim to Pi",
    files=["depth_hold.py", "telling.py", "answers.md"],
    checks=[limits, disarmed, stale, stop, no_jump, holds, holds_on_the_board, answered],
)
