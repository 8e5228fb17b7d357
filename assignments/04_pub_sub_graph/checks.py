"""The grader's side of the lab "pub-sub graph": what pages come in, and which pages have to come out."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from snr_sim.grading import (
    Lab,
    Output,
    Stimulus,
    Student,
    SubmissionError,
    Verdict,
    check,
    failed,
    passed,
    require_field,
)
from snr_sim.recording import encode_value
from snr_sim.scenario import load_program

from .grader.shared_state import find_shared_state

laws: Any = load_program(str(Path(__file__).parent / "starter" / "laws.py"))  # the mathematics is given, so it is ours

TICK_S = 0.02
IMU_AGE_S = 0.013  # a page comes some time after it was measured: its stamp is not the time of now
DEPTH_PERIOD_S = 0.05
GENTLE_NM = 1.0
MODULES = ("heading.py", "depth.py", "mixer.py", "gentle.py")


# -- a dive made of pages ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Dive:
    """Numbers for a dive, drawn from this one."""

    number: int


@dataclass
class Script:
    """What goes in, and what has to come out at each page "imu"."""

    pages: list[Stimulus]
    turn: list[dict[str, float]]
    lift: list[dict[str, float]]


def controls(number: int, is_armed: bool, **asked: float) -> dict[str, Any]:
    """Return a page of the pilot's."""
    nothing = dict.fromkeys(("surge", "sway", "heave", "yaw"), 0.0)
    page = {"number": number, "mode": "heading_hold", "is_armed": is_armed, "is_stop": False, "clears_stop": False}
    return page | nothing | {"depth_m": None, "heading_rad": None} | asked


def script_of(dive: Dive) -> Script:
    """Return a dive in six parts; in each the pilot sends a request, once, between two pages "imu"."""
    rng = random.Random(dive.number)
    heading_1, heading_2, heading_3 = (rng.uniform(-math.pi, math.pi) for _ in range(3))
    depth_1, depth_2 = rng.uniform(1.0, 2.0), rng.uniform(2.0, 3.0)
    # What is sent, then what holds from there on; "here" is where the vehicle is at the next page "imu".
    parts: list[tuple[list[dict[str, Any]], bool, float | str, float | str]] = [
        ([], False, 0.0, 0.0),
        ([controls(1, False)], False, 0.0, 0.0),
        ([controls(2, True)], True, "here", "here"),
        ([controls(3, True, heading_rad=heading_1, depth_m=depth_1), controls(4, True)], True, heading_1, depth_1),
        ([controls(5, True, heading_rad=heading_2), controls(6, True)], True, heading_2, depth_1),
        ([controls(7, False, heading_rad=heading_3, depth_m=depth_2)], False, 0.0, 0.0),
        ([controls(8, True)], True, "here", "here"),
        ([controls(9, True, depth_m=depth_2), controls(10, True)], True, "as before", depth_2),
    ]
    return _build_script(parts, rng)


def _build_script(parts: Sequence[tuple[list[dict[str, Any]], bool, Any, Any]], rng: random.Random) -> Script:
    script, tick, rate = Script([], [], []), 0, laws.Rate()
    yaw, depth, depth_due_s, heading_held, depth_held = rng.uniform(2.0, 3.0), 1.5, 0.0, 0.0, 0.0
    page: dict[str, float] = {}
    rate_mps = 0.0
    for commands, is_armed, heading, target_m in parts:
        at_s = tick * TICK_S - 0.015
        for i, one in enumerate(commands):
            script.pages.append(Stimulus(at_s + 0.006 * i, "controls", one))
        is_first = True
        for _ in range(rng.randint(6, 12)):
            now_s = tick * TICK_S
            yaw, spin = laws.wrap_rad(yaw + rng.gauss(0.0, 0.05)), rng.gauss(0.0, 0.3)
            if now_s >= depth_due_s - 1e-9:
                depth += rng.gauss(0.0, 0.02)
                depth_due_s += DEPTH_PERIOD_S
                page = {"depth_m": depth, "stamp_s": now_s}
                script.pages.append(Stimulus(now_s, "depth", page, process=False))  # as the vehicle's sensor stores it
                rate_mps = rate.update(depth, now_s)
            stamp_s = now_s - IMU_AGE_S
            imu = {"roll_rad": 0.0, "pitch_rad": 0.0, "yaw_rad": yaw, "rate_radps": [0.0, 0.0, spin]}
            script.pages.append(Stimulus(now_s, "imu", imu | {"stamp_s": stamp_s}))
            if is_first:
                heading_held = yaw if heading == "here" else heading_held if heading == "as before" else heading
                depth_held = depth if target_m == "here" else target_m
            is_first = False
            moment = laws.turn_moment_nm(heading_held, yaw, spin) if is_armed else 0.0
            force = laws.lift_force_n(depth_held, depth, rate_mps) if is_armed else 0.0
            script.turn.append({"stamp_s": stamp_s, "moment_nm": moment})
            script.lift.append({"stamp_s": stamp_s, "force_n": force})
            tick += 1
    return script


def draw_dives(rng: random.Random) -> list[Dive]:
    """Two more dives."""
    return [Dive(rng.getrandbits(63)) for _ in range(2)]


# -- verdicts on pages ------------------------------------------------------------------------------------------------


def pages_of(made: Sequence[Output], key: str) -> list[Any]:
    """Return the data of all pages of a key, in order."""
    return [one.value for one in made if one.kind == "store_page" and one.name == key]


def moment_nm(page: Any) -> float:
    """Return the size of the moment that a page "turn" requests."""
    return abs(require_field(page, "turn", "moment_nm", float))


def same(found: Any, expected: dict[str, Any]) -> bool:
    """Return whether a page holds these fields, numbers to a billionth."""
    if not isinstance(found, dict) or set(found) != set(expected):
        return False
    return all(_near(found[name], expected[name]) for name in expected)


def _near(found: Any, expected: Any) -> bool:
    if isinstance(expected, list):
        return isinstance(found, list) and len(found) == len(expected) and all(map(_near, found, expected))
    if isinstance(expected, bool) or not isinstance(expected, float):
        return bool(found == expected)
    if not isinstance(found, (int, float)) or isinstance(found, bool):
        return False
    return expected - 1e-9 <= found <= expected + 1e-9


def pages_verdict(made: Sequence[Output], key: str, expected: Sequence[dict[str, Any]], file: str) -> Verdict:
    """Return the verdict on the pages that one module stored by itself."""
    others = sorted({one.name for one in made if one.kind == "store_page" and one.name != key})
    if others:
        return failed(
            f"{file} stores the page '{others[0]}', which is not its own. It must store only '{key}'.",
            expected=key,
            actual=", ".join(others),
        )
    found = pages_of(made, key)
    if not found:
        return failed(
            f"{file} by itself stores no page '{key}'. It must publish its result as a page, and in no other way.",
            expected=f"{len(expected)} pages",
            actual="none",
        )
    if len(found) != len(expected):
        return failed(
            f"{file} does not store one page '{key}' for each page 'imu'.",
            expected=f"{len(expected)} pages",
            actual=f"{len(found)} pages",
        )
    for number, (one, right) in enumerate(zip(found, expected, strict=True)):
        if not same(one, right):
            return _differs(file, key, number, one, right)
    return passed()


def check_fields(found: Any, key: str, right: dict[str, Any]) -> None:
    """Check that a page has the fields of a right one, each of its kind.

    Raises:
        SubmissionError: it has not.
    """
    for name, value in right.items():
        if isinstance(value, list):
            require_field(found, key, name, list[float], count=len(value))
        else:
            require_field(found, key, name, bool if isinstance(value, bool) else float)


def _differs(file: str, key: str, number: int, found: Any, right: dict[str, Any]) -> Verdict:
    check_fields(found, key, right)
    name = "moment_nm" if key == "turn" else "force_n"
    if set(found) != set(right):
        hint = f"The page '{key}' of {file} does not have the fields of the README."
    elif found["stamp_s"] != right["stamp_s"]:
        hint = f"The stamp of '{key}' is not that of the page 'imu' that it answers."
    elif right[name] == 0.0:
        hint = f"{file}: '{name}' must be 0 while the vehicle is disarmed."
    else:
        hint = (
            f"{file}: '{name}' is not what laws.py computes from the pilot's request. The pilot sends a request in one "
            "page, and the next page may arrive before 'imu': handle every page 'controls'. "
            "Drop requests from before the vehicle was disarmed. And which argument of the law comes first?"
        )
    return failed(hint, expected=f"page {number}: {right}", actual=str(found))


# -- checks -----------------------------------------------------------------------------------------------------------


@check(points=12, visible=[Dive(1)], hidden=draw_dives)
def heading_alone(student: Student, dive: Dive) -> Verdict:
    """heading.py by itself: one page "turn" for each page "imu", with the right numbers"""
    script = script_of(dive)
    return pages_verdict(student.run_inputs("heading.py", script.pages), "turn", script.turn, "heading.py")


@check(points=12, visible=[Dive(1)], hidden=draw_dives)
def depth_alone(student: Student, dive: Dive) -> Verdict:
    """depth.py by itself: one page "lift" for each page "imu", with the right numbers"""
    script = script_of(dive)
    verdict = pages_verdict(student.run_inputs("depth.py", script.pages), "lift", script.lift, "depth.py")
    if verdict.fraction == 1.0:
        return verdict
    pages = [replace(page, process=True) for page in script.pages]
    if pages_verdict(student.run_inputs("depth.py", pages), "lift", script.lift, "depth.py").fraction < 1.0:
        return verdict
    return failed(
        "depth.py handles process_data 'depth', but this handler is never called: the sensor stores its page without a "
        "task. Read the page when 'imu' arrives, and pass it to your Rate there.",
        verdict.expected,
        verdict.actual,
    )


@check(points=20, visible=[Dive(1)], hidden=draw_dives)
def mixer_alone(student: Student, dive: Dive) -> Verdict:
    """mixer.py with pages "turn" and "lift" from other modules: one page "pwm" for each pair"""
    pages, expected = _pairs(dive)
    made = student.run_inputs("mixer.py", pages)
    found = [(one.after, one.value) for one in made if one.kind == "store_page" and one.name == "pwm"]
    if not found:
        return failed(
            "mixer.py by itself stores no page 'pwm' when 'turn' and 'lift' arrive. Does it read them from elsewhere?",
            expected=f"{len(expected)} pages",
            actual="none",
        )
    for (after, page), (due, right, reason) in zip(found, expected, strict=False):
        if after != due:
            return failed(reason, expected=f"a page 'pwm' at input {due}", actual=f"one at input {after}")
        if not same(page, right):
            check_fields(page, "pwm", right)
            hint = "The pulses are not those of this 'turn' and this 'lift'; while disarmed they are all 1500."
            return failed(hint, expected=str(right), actual=str(page))
    if len(found) != len(expected):
        return failed(
            "Store one page 'pwm' for each pair with the same stamp, when its second page arrives: not for each page.",
            expected=f"{len(expected)} pages 'pwm'",
            actual=f"{len(found)}",
        )
    return passed()


def _pairs(dive: Dive) -> tuple[list[Stimulus], list[tuple[int, dict[str, Any], str]]]:
    """Return pages for the mixer, and at which of them which pulses are due."""
    rng = random.Random(dive.number)
    pages: list[Stimulus] = []
    due: list[tuple[int, dict[str, Any], str]] = []
    first = "The first page of a pair has no partner yet; the previous page has another stamp."

    def bring(at_s: float, *names: str, is_due: bool = True, is_armed: bool = True, reason: str = first) -> None:
        moment, force = rng.uniform(-8.0, 8.0), rng.uniform(-60.0, 60.0)
        values = {"turn": {"stamp_s": at_s, "moment_nm": moment}, "lift": {"stamp_s": at_s, "force_n": force}}
        pages.extend(Stimulus(at_s + 0.001 * i, name, values[name]) for i, name in enumerate(names))
        if is_due:
            pulses = laws.pulses_us(moment, force) if is_armed else [laws.STOP_US] * 8
            due.append((len(pages) - 1, {"pulses_us": pulses, "is_armed": is_armed}, reason))

    steps = [("turn", "lift"), ("lift", "turn")]
    pages.append(Stimulus(0.0, "controls", controls(1, False)))
    at_s = 0.02
    for _ in range(3):
        bring(at_s, *rng.choice(steps), is_armed=False)
        at_s += 0.02
    pages.append(Stimulus(at_s - 0.01, "controls", controls(2, True)))
    lonely = "A page whose partner never arrived must be dropped: do not combine pages with different stamps."
    for _ in range(6):
        bring(at_s, *rng.choice(steps))
        bring(at_s + 0.02, rng.choice(("turn", "lift")), is_due=False)
        bring(at_s + 0.04, *steps[0], reason=lonely)
        bring(at_s + 0.06, *steps[1], reason=lonely)
        at_s += 0.08
    return pages, due


@dataclass(frozen=True)
class Order:
    """Another order of the four components."""

    order: tuple[int, ...]
    dive: int


def draw_orders(rng: random.Random) -> list[Order]:
    """Three more orders."""
    orders = []
    for _ in range(3):
        order = [0, 1, 2, 3]
        while order == sorted(order):
            rng.shuffle(order)
        orders.append(Order(tuple(order), rng.getrandbits(63)))
    return orders


@check(points=20, visible=[Order((3, 2, 1, 0), 1), Order((1, 2, 0, 3), 1)], hidden=draw_orders)
def in_any_order(student: Student, case: Order) -> Verdict:
    """graph.py with its components in another order: the same pages"""
    script = script_of(Dive(case.dive))
    usual = student.run_inputs("graph.py", script.pages)
    other = student.run_inputs("graph.py", script.pages, order=case.order)
    for key in ("turn", "lift", "pwm", "vehicle"):
        before, after = pages_of(usual, key), pages_of(other, key)
        if not before:
            return failed(f"The graph stores no page '{key}' at all.", expected="pages", actual="none")
        if list(map(encode_value, before)) != list(map(encode_value, after)):
            return failed(
                f"The pages '{key}' depend on the order of the components: one component reads a page of another "
                "before or after its update. When a result needs two pages with the same stamp, wait for both.",
                expected=f"{len(before)} pages '{key}', the same ones",
                actual=f"{len(after)} pages",
            )
    if len(pages_of(usual, "pwm")) == 2 * len(script.turn):
        return failed(
            "There are two pages 'pwm' for each page 'imu'. When 'turn' and 'lift' are both stored before either is "
            "handled, each handler finds the pair complete. Remember which pair was answered already.",
            expected=str(len(script.turn)),
            actual=str(len(pages_of(usual, "pwm"))),
        )
    if len(pages_of(usual, "pwm")) != len(script.turn):
        return failed(
            "There must be one page 'pwm' for each page 'imu'. A mixer that handles 'imu' mixes the previous pages "
            "'turn' and 'lift': the current ones arrive later.",
            expected=str(len(script.turn)),
            actual=str(len(pages_of(usual, "pwm"))),
        )
    return passed()


@check(points=12, visible=MODULES)
def apart(student: Student, file: str) -> Verdict:
    """Modules share pages only: no shared objects, no access to components of another module"""
    found = student.parse(file, find_shared_state)
    if "error" in found:
        where = file if found["line"] is None else f"{file}, line {found['line']}"
        hint = f"{file} could not be parsed: run it with Python, and correct the line that it names."
        raise SubmissionError(f"{where}: {found['error']}", hint)
    may = {"laws", "heading"} if file == "gentle.py" else {"laws"}
    beside = {path.stem for path in student.folder.glob("*.py")} - may
    for line, kind, name in found["shares"]:
        if kind != "import" or name.partition(".")[0] in beside:
            return failed(f"{file}, line {line}: {SHARES[kind].format(name)}", expected="pages", actual="shared state")
    if found["keeps"]:
        line, name = found["keeps"]
        return failed(
            f"{file}, line {line}: '{name}' is defined outside of every object and is changed: two vehicles in one "
            "program would share it. Keep it in self.",
            expected="self." + name.lower(),
            actual=name,
        )
    return passed()


SHARES = {
    "import": "it imports {}. Then this module cannot be used without that one.",
    "component": "it accesses another component. Publish a page instead: every component can handle it.",
    "global": "'global' shares a value between all objects. Keep it in self.",
}


@check(points=12, visible=[Dive(1)], hidden=draw_dives)
def dropped_in(student: Student, dive: Dive) -> Verdict:
    """gentle.py takes heading's place: the same pages, and never more than 1 N m"""
    script = script_of(dive)
    made = student.run_inputs("gentle.py", script.pages)
    max_moment_nm = max((moment_nm(page) for page in pages_of(made, "turn")), default=0.0)
    if max_moment_nm > GENTLE_NM + 1e-9:
        return failed("gentle.py turns harder than 1 N m.", expected="at most 1 N m", actual=f"{max_moment_nm:.2f} N m")
    expected = [{**page, "moment_nm": laws.limited(page["moment_nm"], GENTLE_NM)} for page in script.turn]
    return pages_verdict(made, "turn", expected, "gentle.py")


@dataclass(frozen=True)
class Turn:
    """A quarter turn under water."""

    seed: int
    heading: str


def draw_turns(rng: random.Random) -> list[Turn]:
    """One more of each kind."""
    return [Turn(rng.getrandbits(63), heading) for heading in ("plain", "gentle")]


@check(points=12, visible=[Turn(1, "plain"), Turn(2, "gentle")], hidden=draw_turns)
def holds_heading(student: Student, case: Turn) -> Verdict:
    """The vehicle turns and keeps its depth (urov_heading_hold), with heading.py and with gentle.py in its place"""
    run = student.run_scenario("urov_heading_hold", case.seed, "graph.py", options={"heading": case.heading})
    moments = [moment_nm(page) for _, page in run.pages("turn")]
    if not moments:
        return failed(
            f"With --option heading={case.heading} no component in graph.py stores a page 'turn'.",
            expected="pages 'turn' in the run",
            actual="none",
        )
    max_moment_nm = max(moments)
    if case.heading == "gentle" and max_moment_nm > GENTLE_NM + 1e-9:
        return failed(
            "With --option heading=gentle it turns harder than 1 N m: does graph.py put gentle.py in heading's place?",
            expected="at most 1 N m",
            actual=f"{max_moment_nm:.2f} N m",
        )
    if not run.success:
        return failed("The vehicle exceeded the scenario's limits.", expected="held", actual="; ".join(run.notes))
    return passed(metrics={"settling_s": run.metrics["settling_s"], "energy_j": run.metrics["energy_j"]})


lab = Lab(
    "Pub-sub graph",
    files=["graph.py", "heading.py", "depth.py", "mixer.py", "gentle.py", "laws.py", "telling.py"],
    checks=[heading_alone, depth_alone, mixer_alone, in_any_order, apart, dropped_in, holds_heading],
)
