"""How "depth hold" is graded. Hidden depths and starts are drawn from the instructor's secret, not from here.

Limits of a flight are those of the scenario `urov_tank`. Measured with one solution of 80 N/m over 60 seeds: settled
after 2.7 +- 0.5 s (limit 6.5), overshot by 0.05 +- 0.02 of the way (0.2), ended 0.02 +- 0.01 m off (0.1): each limit
is more than six standard deviations away. `tests/assignments/test_depth_hold.py` measures that again.
"""

from __future__ import annotations

import random
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from snr_sim.grading import Lab, Stimulus, Student, Verdict, check, failed, partial_credit, passed, require_field

FILE = "depth_hold.py"
STOP_US, MIN_PULSE_US, MAX_PULSE_US = 1500.0, 1100.0, 1900.0
MAX_FORCE_N = 80.0
NEWTONS_PER_KGF = 9.80665
VERTICAL = {4: +1, 5: -1, 6: -1, 7: +1}
SETTLING_S, OVERSHOOT, STEADY_M = 6.5, 0.20, 0.10
HERE_M = 2.0
USUAL_NPM = (10.0, 600.0)


@dataclass(frozen=True, repr=False)
class Depths:
    """Where the vehicle is, and where it should be."""

    depth_m: float
    goal_m: float

    def __repr__(self) -> str:
        return f"{self.depth_m:g} m deep, goal {self.goal_m:g} m"


@dataclass(frozen=True)
class PilotInputs:
    """The pilot's commands, page by page: armed, and a goal or None. The vehicle is at HERE_M."""

    is_armed: tuple[bool, ...]
    goal_m: tuple[float | None, ...]


def depths(rng: random.Random) -> list[tuple[Depths, ...]]:
    """Draw depths with a small error, so that no clamp plays a part."""
    goals_m = [rng.uniform(0.5, 9.0) for _ in range(12)]
    errors_m = [sign * rng.uniform(0.02, 0.06) for sign in (-1.0, 1.0) * 6]
    return [tuple(Depths(goal_m + error_m, goal_m) for goal_m, error_m in zip(goals_m, errors_m, strict=True))]


def far_depths(rng: random.Random) -> list[tuple[Depths, ...]]:
    """Draw depths with a large error."""
    return [(Depths(rng.uniform(40.0, 60.0), rng.uniform(0.5, 2.0)), Depths(0.5, rng.uniform(40.0, 60.0)))]


def forces(rng: random.Random) -> list[tuple[float, ...]]:
    """Draw forces that four thrusters can give."""
    return [tuple(sign * rng.uniform(2.0, MAX_FORCE_N) for sign in (-1.0, 1.0) * 6)]


def goals(rng: random.Random) -> list[PilotInputs]:
    """Draw a pilot's commands: a goal now and then."""
    inputs = [rng.uniform(2.5, 6.0), None, None, rng.uniform(0.5, 1.5), None, None, rng.uniform(2.5, 6.0), None]
    return [PilotInputs((True,) * len(inputs), tuple(inputs))]


def armings(rng: random.Random) -> list[PilotInputs]:
    """Draw the commands of a pilot who arms late, and disarms."""
    goal_m = rng.uniform(3.0, 6.0)
    return [PilotInputs((False, False, True, False), (goal_m, None, None, None))]


def seeds(rng: random.Random) -> list[int]:
    """Draw eight dives."""
    return [rng.getrandbits(63) for _ in range(8)]


def force_n(student: Student, depth_m: float, goal_m: float) -> float:
    """Return the result of `up_force_n`."""
    return float(student.call(FILE, "up_force_n", depth_m, goal_m, returns=float))


def pulses_us(student: Student, up_n: float) -> list[float]:
    """Return the result of `pulses_us`."""
    return list(student.call(FILE, "pulses_us", up_n, returns=list[float]))


def first_failure(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the first that lost points, or the last."""
    last = passed()
    for last in verdicts:
        if last.fraction < 1.0:
            return last
    return last


def answered(student: Student, inputs: PilotInputs) -> list[list[float]] | None:
    """Return the pulses after each of the pilot's pages; nothing if there were none once."""
    level = {"roll_rad": 0.0, "pitch_rad": 0.0, "yaw_rad": 0.0}
    pages = [Stimulus(0.01, "depth", {"depth_m": HERE_M, "stamp_s": 0.01}, process=False)]
    for number, (is_armed, goal_m) in enumerate(zip(inputs.is_armed, inputs.goal_m, strict=True), start=1):
        controls = {"number": number, "mode": "depth_hold", "is_armed": is_armed, "depth_m": goal_m}
        pages += [Stimulus(0.05 * number, "controls", controls), Stimulus(0.05 * number + 0.01, "imu", level)]
    found: dict[Any, Any] = {}
    for produced in student.run_inputs(FILE, pages, robot="urov", role="urov"):
        if produced.kind == "store_page" and produced.name == "pwm":
            found[produced.after] = require_field(produced.value, "pwm", "pulses_us", list[float], count=8)
    pulses = [found.get(2 * number + 2) for number in range(len(inputs.is_armed))]
    return None if None in pulses else pulses  # type: ignore[return-value]


NO_PULSES = "Each page 'imu' must be followed by a page 'pwm' with eight pulses. Does on_tick return it?"


def is_still(pulses: list[float]) -> bool:
    """Return whether all thrusters are stopped."""
    return all(pulse == STOP_US for pulse in pulses)


@check(points=5, visible=[Depths(3.5, 3.0)])
def loads(student: Student, case: Depths) -> Verdict:
    """Has its two functions, and they answer with numbers."""
    force_n(student, case.depth_m, case.goal_m)
    if len(got := pulses_us(student, 10.0)) != 8:
        return failed("pulses_us returns a list of eight pulses.", expected="eight numbers", actual=str(got))
    return passed()


@check(points=10, visible=[(Depths(3.05, 3.0), Depths(1.95, 2.0))], hidden=depths, needs=["loads"])
def direction(student: Student, case: tuple[Depths, ...]) -> Verdict:
    """Pushes up when it is too deep, and down when it is not deep enough."""
    return first_failure(directed(student, one) for one in case)


def directed(student: Student, case: Depths) -> Verdict:
    """Judge the force at one depth."""
    force = force_n(student, case.depth_m, case.goal_m)
    error_m = case.depth_m - case.goal_m
    where = f"{case.depth_m:.2f} m deep, goal {case.goal_m:.2f} m"
    if force == 0.0:
        return failed("It does not push at all. Start with up_force_n.", f"a force, {where}", "0 N")
    if force * error_m < 0.0:
        hint = "It pushes in the wrong direction. Depth is positive down, force is positive up: too deep needs a plus."
        if force_n(student, case.goal_m + 30.0, case.goal_m) > 0.0 > force_n(student, -30.0, case.goal_m):
            hint = "It goes to a depth other than the goal: the goal is the second argument of up_force_n."
        return failed(hint, "up" if error_m > 0.0 else "down", f"{force:.1f} N, {where}")
    return passed()


@check(points=10, visible=[(Depths(3.05, 3.0), Depths(1.95, 2.0))], hidden=depths, needs=["loads"])
def proportional(student: Student, case: tuple[Depths, ...]) -> Verdict:
    """Pushes twice as hard for twice the error."""
    return first_failure(proportioned(student, one) for one in case)


def proportioned(student: Student, case: Depths) -> Verdict:
    """Judge the forces round one depth."""
    error_m = case.depth_m - case.goal_m
    once = force_n(student, case.depth_m, case.goal_m)
    again = force_n(student, case.depth_m, case.goal_m)
    if once != again:
        hint = "The same depth and goal gave two forces: something is summed from call to call. P keeps no state."
        return failed(hint, expected=f"{once!r} N twice", actual=f"{once!r} N and {again!r} N")
    twice = force_n(student, case.depth_m + error_m, case.goal_m)
    elsewhere = force_n(student, case.depth_m + 1.0, case.goal_m + 1.0)
    gain_npm = abs(once / error_m)
    measured = f"{once:.2f} N at an error of {error_m:.3f} m, {twice:.2f} N at twice that"
    if abs(elsewhere - once) > 1e-6 * max(1.0, abs(once)):
        hint = "One metre deeper, with the goal one metre deeper too, is the same error. Does the goal enter the error?"
        return failed(hint, expected=f"{once:.2f} N", actual=f"{elsewhere:.2f} N")
    if gain_npm > USUAL_NPM[1]:
        hint = f"That is at least {gain_npm:.0f} N per metre: is the error in centimetres? All depths are in metres."
        return failed(hint, expected="20 to 400 N for each metre", actual=measured)
    if gain_npm < USUAL_NPM[0]:
        hint = f"That is {gain_npm:.1f} N per metre: too little for its weight and the current."
        return failed(hint, expected="20 to 400 N for each metre", actual=measured)
    if abs(twice - 2.0 * once) > 1e-6 * max(1.0, abs(once)):
        hint = "Proportional is a number times the error: twice the error, twice the force, up to MAX_FORCE_N."
        return failed(hint, expected=f"{2.0 * once:.2f} N", actual=measured)
    return passed(metrics={"gain_npm": gain_npm})


@check(points=10, visible=[(Depths(50.0, 1.0), Depths(1.0, 50.0))], hidden=far_depths, needs=["loads"])
def clamp(student: Student, case: tuple[Depths, ...]) -> Verdict:
    """Never asks for more than 80 N, up or down."""
    return first_failure(clamped(student, one) for one in case)


def clamped(student: Student, case: Depths) -> Verdict:
    """Judge the force far from a goal."""
    force = force_n(student, case.depth_m, case.goal_m)
    where = f"{force:.1f} N at an error of {case.depth_m - case.goal_m:.1f} m"
    if abs(force) > MAX_FORCE_N + 1e-6:
        hint = "Clamp the force to -MAX_FORCE_N to MAX_FORCE_N, on both sides, with min and max."
        return failed(hint, expected="-80 to 80 N", actual=where)
    if abs(force) < MAX_FORCE_N - 1e-6:
        return failed("Far from its goal it should push with the maximum force.", expected="80 N", actual=where)
    return passed()


@check(points=20, visible=[(40.0, -12.0)], hidden=forces, needs=["loads"])
def pulses(student: Student, case: tuple[float, ...]) -> Verdict:
    """Turns a force into the pulses that give it."""
    return first_failure(pulsed(student, one) for one in case)


def pulsed(student: Student, case: float) -> Verdict:
    """Judge the pulses for one force."""
    got = pulses_us(student, case)

    def made(total_kgf: float, signs: dict[int, int] = VERTICAL) -> list[float]:
        shares = [signs.get(channel, 0) * total_kgf for channel in range(8)]
        return [curve_us(share) for share in shares]

    kgf = case / 4.0 / NEWTONS_PER_KGF
    right = made(kgf)
    if near(got, right):
        return passed()
    known = {
        "The manufacturer's curve takes kilogram-force, and gets newtons: 1 kgf is 9.80665 N.": made(case / 4.0),
        "Each of the four thrusters gives the full force: divide it by four.": made(case / NEWTONS_PER_KGF),
        "It divides the force among eight thrusters, but only four of them push up.": made(kgf / 2.0),
        "To convert newtons to kilogram-force, divide; do not multiply.": made(case / 4.0 * NEWTONS_PER_KGF),
        "Every thruster runs in the wrong direction: +1 in VERTICAL pushes up when it runs ahead.": made(-kgf),
        "Thrusters 5 and 6 are mounted in reverse: use their -1 of VERTICAL.": made(kgf, dict.fromkeys(VERTICAL, 1)),
        "All eight pulses are 1500 us. Start with pulses_us.": [STOP_US] * 8,
    }
    for hint, wrong in known.items():
        if near(got, wrong):
            return failed(hint, expected=str(rounded(right)), actual=str(rounded(got)))
    hint = "Channels 4 to 7 share the force, each with its sign, by thruster.pulse_us; channels 0 to 3 stay at 1500 us."
    return failed(hint, expected=str(rounded(right)), actual=str(rounded(got)))


def curve_us(force_kgf: float) -> float:
    """Return the pulse for a force, as `thruster.py` does, which a student may have changed."""
    if abs(force_kgf) < 0.002:
        return STOP_US
    width_us = 30.0 + 370.0 * (abs(force_kgf) / 4.8) ** 0.55
    return STOP_US + width_us if force_kgf > 0.0 else STOP_US - width_us


def near(got: list[float], right: list[float]) -> bool:
    """Return whether these are the pulses, to a thousandth of a microsecond."""
    return len(got) == len(right) and all(abs(one - other) <= 1e-3 for one, other in zip(got, right, strict=True))


def rounded(pulses: list[float]) -> list[float]:
    """Return pulses rounded for display."""
    return [round(pulse, 1) for pulse in pulses]


@check(points=10, visible=[PilotInputs((True,) * 4, (3.0, None, None, None))], hidden=goals, needs=["loads"])
def keeps_goal(student: Student, case: PilotInputs) -> Verdict:
    """Keeps a goal that the pilot sends in one page only."""
    pages = answered(student, case)
    if pages is None:
        return failed(NO_PULSES)
    goal_m: float | None = None
    deeper_us: float | None = None  # how far from its stop a thruster was when the goal was below
    for number, (got, new_goal_m) in enumerate(zip(pages, case.goal_m, strict=True), start=1):
        goal_m = goal_m if new_goal_m is None else new_goal_m
        if goal_m is None:
            continue
        what, from_stop_us = f"a push to {goal_m:.1f} m in page {number}", got[4] - STOP_US
        if is_still(got):
            hint = "It has a goal and a depth, it is armed, and it does not push."
            if new_goal_m is None:
                hint = "It lost its goal: the pilot sends it in one page, and None in the next means 'as before'."
            return failed(hint, expected=what, actual="all still")
        if goal_m > HERE_M:
            deeper_us = deeper_us or from_stop_us
        elif deeper_us is not None and from_stop_us * deeper_us > 0.0:
            return failed("The pilot has sent a new goal, and it still goes to the old one.", what, str(got))
    return passed()


@check(points=5, visible=[PilotInputs((False, True, False), (3.0, None, None))], hidden=armings, needs=["loads"])
def disarmed(student: Student, case: PilotInputs) -> Verdict:
    """Stands still while the pilot has not armed it, and before it has a goal."""
    pages, aimless = answered(student, case), answered(student, PilotInputs((True, True), (None, None)))
    if pages is None or aimless is None:
        return failed(NO_PULSES)
    for got, is_armed in zip(pages, case.is_armed, strict=True):
        if not is_armed and not is_still(got):
            hint = "The vehicle is not armed: all eight pulses must be 1500 us."
            return failed(hint, expected="1500 us", actual=str(got))
    if not is_still(aimless[-1]):
        return failed("It pushes before it has a goal: all eight pulses must be 1500 us.", "1500 us", str(aimless[-1]))
    return passed()


@check(points=30, visible=[0, 1], hidden=seeds, needs=["loads"])
def holds(student: Student, seed: int) -> Verdict:
    """Goes to the depth and stays there: 12 points to settle, 9 not to overshoot, 9 to end near it."""
    run = student.run_scenario("urov_tank", seed, FILE)
    sent = [require_field(page, "pwm", "pulses_us", list[float]) for _, page in run.pages("pwm")]
    if wild := [pulse for pulses in sent for pulse in pulses if not in_range(pulse)]:
        hint = "It sends a pulse outside the thruster's range. Which force did it command, and in which unit?"
        return failed(hint, expected="1100 to 1900 us", actual=f"{wild[0]:.0f} us")
    found = run.metrics
    settling_s, way = found["settling_s"], f"from {found['start_m']:.1f} m to {found['goal_m']:.1f} m"
    hints, fraction = [], 0.0
    if settling_s is not None and settling_s <= SETTLING_S:
        fraction += 0.4
    else:
        when = "did not settle within 15 cm" if settling_s is None else f"settled within 15 cm after {settling_s:.1f} s"
        hints.append(f"It {when} (limit {SETTLING_S:g} s): is the force too small, or too large?")
    if found["overshoot"] <= OVERSHOOT and settling_s is not None:
        fraction += 0.3
    elif settling_s is not None:
        hints.append(f"It overshot by {found['overshoot']:.0%} of the depth change (limit {OVERSHOOT:.0%}).")
    if found["steady_error_m"] <= STEADY_M:
        fraction += 0.3
    else:
        hints.append(
            f"Its steady-state error was {found['steady_error_m']:.2f} m (limit {STEADY_M:g} m): which constant force "
            "acts on it, and at which error is your force as large?"
        )
    metrics = {"energy_j": found["energy_j"], "steady_error_m": found["steady_error_m"]}
    if not hints:
        return passed(f"{way}: settled after {settling_s:.1f} s", metrics=metrics)
    actual = f"{way}; in your folder: snr run urov_tank --controller {FILE} --seed {seed}"
    return partial_credit(fraction, " ".join(hints), expected="the depth held", actual=actual, metrics=metrics)


def in_range(pulse: float) -> bool:
    """Return whether a thruster may be sent this."""
    return MIN_PULSE_US - 1e-6 <= pulse <= MAX_PULSE_US + 1e-6


lab = Lab(
    "Depth hold",
    files=[FILE, "thruster.py", "telling.py"],
    checks=[loads, direction, proportional, clamp, pulses, keeps_goal, disarmed, holds],
)
