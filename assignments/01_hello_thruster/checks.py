"""How "hello thruster" is graded. Hidden sticks and starts are drawn from the instructor's secret, not from here."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

from snr_sim.grading import Lab, Stimulus, Student, Verdict, check, failed, passed

FILE = "hello_thruster.py"
STOP_US, FULL_US, REST = 1500.0, 400.0, 0.05
HEAVE = (0, 0, 0, 0, +1, -1, -1, +1)
SURGE = (+1, +1, -1, -1, 0, 0, 0, 0)
PERIOD_S = 0.05
NEAR_US = 1e-6


@dataclass(frozen=True)
class Sticks:
    """The pilot's sticks: one row for each page 'controls'."""

    is_armed: tuple[bool, ...]
    heave: tuple[float, ...]
    surge: tuple[float, ...]


def sticks(*rows: tuple[bool, float, float]) -> Sticks:
    """Return the sticks of these rows: armed, heave, surge."""
    is_armed, heave, surge = zip(*rows, strict=True)
    return Sticks(is_armed, heave, surge)


def beyond_rest(rng: random.Random, max_size: float = 1.0) -> float:
    """Return where a stick may be that is not at rest."""
    return round(rng.choice((-1.0, 1.0)) * rng.uniform(2.0 * REST, max_size), 3)


def heaves(rng: random.Random) -> list[Sticks]:
    """Draw two recordings of the heave stick."""
    return [sticks(*[(True, beyond_rest(rng), 0.0) for _ in range(60)]) for _ in range(2)]


def surges(rng: random.Random) -> list[Sticks]:
    """Draw two recordings of the surge stick."""
    return [sticks(*[(True, 0.0, beyond_rest(rng)) for _ in range(60)]) for _ in range(2)]


def rests(rng: random.Random) -> list[Sticks]:
    """Draw a recording of a hand that trembles."""
    near = 0.9 * REST
    return [sticks(*[(True, rng.uniform(-near, near), rng.uniform(-near, near)) for _ in range(60)])]


def too_far(rng: random.Random) -> list[Sticks]:
    """Draw a recording of a stick beyond its limit."""
    return [sticks(*[(True, rng.choice((-1.0, 1.0)) * rng.uniform(1.01, 1.5), 0.0) for _ in range(60)])]


def armings(rng: random.Random) -> list[Sticks]:
    """Draw a recording with sticks pushed while it is armed and disarmed again."""
    rows = [(rng.random() < 0.5, beyond_rest(rng), beyond_rest(rng)) for _ in range(60)]
    return [sticks(*rows, (False, 1.0, 1.0))]


def seeds(rng: random.Random) -> list[int]:
    """Draw two starts."""
    return [rng.getrandbits(63) for _ in range(2)]


def pulses_of(heave: float, surge: float) -> list[float]:
    """Return the eight pulses that belong to two sticks."""
    shares = [0.0 if abs(one) < REST else max(-1.0, min(1.0, one)) for one in (heave, surge)]
    return [STOP_US + FULL_US * (up * shares[0] + ahead * shares[1]) for up, ahead in zip(HEAVE, SURGE, strict=True)]


def answers(student: Student, case: Sticks) -> list[list[Any]]:
    """Return what the endpoint answered each page of controls with: (key, value) of pages, None for other tasks."""
    rows = zip(case.is_armed, case.heave, case.surge, strict=True)
    pages = [
        Stimulus(
            PERIOD_S * (number + 1),
            "controls",
            {"number": number + 1, "mode": "manual", "is_armed": is_armed, "heave": heave, "surge": surge},
        )
        for number, (is_armed, heave, surge) in enumerate(rows)
    ]
    answered: list[list[Any]] = [[] for _ in pages]
    for produced in student.run_inputs(FILE, pages, robot="urov", role="urov"):
        is_page = produced.kind == "store_page"
        if produced.after is None:
            continue  # it answers nothing
        answered[produced.after].append((produced.name, produced.value) if is_page else None)
    return answered


def pwm_of(answered: list[Any]) -> Any:
    """Return the last page "pwm" of an answer, or nothing."""
    found = [one[1] for one in answered if one is not None and one[0] == "pwm"]
    return found[-1] if found else None


def format_error(page: Any) -> str:
    """Return what is wrong with the shape of a page "pwm"; nothing if it is right."""
    if not isinstance(page, dict) or "pulses_us" not in page:
        return "No page 'pwm' with pulses_us followed a page 'controls'. Does on_controls return it?"
    pulses = page["pulses_us"]
    if not isinstance(pulses, list):
        found = {type(None): "None", str: "a string", float: "one number"}.get(type(pulses), "not a list")
        return f"'pulses_us' of the page 'pwm' must be a list of eight pulses; it is {found}. Check pulses_us()."
    if len(pulses) > 8:
        return (
            f"There are {len(pulses)} pulses for eight thrusters. A list that is created outside the function, or as a "
            "default argument, is shared by all calls and grows. Create a new list in each call."
        )
    if len(pulses) < 8:
        return f"There are {len(pulses)} pulses for eight thrusters. Which channels did the loop leave out?"
    if not all(is_number(pulse) for pulse in pulses):
        return "Not every pulse is a number."
    return ""


def is_number(value: Any) -> bool:
    """Return whether it is a finite number of usable size."""
    return isinstance(value, int | float) and not isinstance(value, bool) and -1e6 < value < 1e6


def compared(pages: list[Any], expected: list[list[float]]) -> Verdict:
    """Compare pages "pwm" with the expected pulses, and find the mistake that explains them."""
    for page in pages:
        if problem := format_error(page):
            return failed(problem, expected="eight pulses", actual=str(page))
    pulses = [page["pulses_us"] for page in pages]
    for number, (got, right) in enumerate(zip(pulses, expected, strict=True)):
        if not near(got, right):
            return failed(explained(pulses, expected, number), expected=str(right), actual=str(got))
    return passed()


def near(got: list[float], right: list[float]) -> bool:
    """Return whether all pulses are as they should be."""
    return all(abs(one - other) <= NEAR_US for one, other in zip(got, right, strict=True))


def explained(pulses: list[list[float]], expected: list[list[float]], first: int) -> str:
    """Return the mistake that turns the expected pulses into those received."""

    def always(change: Any) -> bool:
        return all(near(got, change(right)) for got, right in zip(pulses, expected, strict=True))

    if all(near(got, [STOP_US] * 8) for got in pulses):
        return "All eight pulses are 1500 us for every stick position. Start with pulses_us."
    if always(lambda right: [2 * STOP_US - pulse for pulse in right]):
        return "Every thruster runs in the wrong direction: a sign is reversed."
    if always(lambda right: [STOP_US + abs(pulse - STOP_US) for pulse in right]) or always(
        lambda right: [right[4] if HEAVE[i] else right[0] if SURGE[i] else pulse for i, pulse in enumerate(right)]
    ):
        return (
            "Thrusters that are mounted in reverse run in the same direction as the others: use -1 of HEAVE and SURGE."
        )
    for far in (1, -1):
        if always(lambda right, far=far: right[-far:] + right[:-far]):
            return "The pulses are correct, but shifted by one channel: the first channel of a list has index 0."
    if first > 0 and near(pulses[first], expected[first - 1]):
        return "The pulses belong to the previous page 'controls'."
    if all(abs(one - other) < 1.0 for one, other in zip(pulses[first], expected[first], strict=True)):
        return "The pulses are rounded: int() drops the fraction."
    return "A pulse is 1500 + 400 x stick for a thruster with +1, and 1500 - 400 x stick for one with -1."


@check(points=5, visible=[sticks((True, 0.0, 0.0))])
def loads(student: Student, case: Sticks) -> Verdict:
    """Answers a page of controls with eight pulses."""
    problem = format_error(pwm_of(answers(student, case)[0]))
    return failed(problem) if problem else passed()


@check(
    points=20,
    visible=[sticks((True, 0.0, 0.0), (True, -0.6, 0.0), (True, -1.0, 0.0), (True, 0.5, 0.0))],
    hidden=heaves,
    needs=["loads"],
)
def heave(student: Student, case: Sticks) -> Verdict:
    """Turns the heave stick into pulses."""
    expected = [pulses_of(*one) for one in zip(case.heave, case.surge, strict=True)]
    return compared([pwm_of(one) for one in answers(student, case)], expected)


@check(
    points=15,
    visible=[sticks((True, 0.0, 0.0), (True, 0.0, 0.5), (True, 0.0, -0.25), (True, 0.0, 1.0))],
    hidden=surges,
    needs=["loads"],
)
def surge(student: Student, case: Sticks) -> Verdict:
    """Turns the surge stick into pulses."""
    expected = [pulses_of(*one) for one in zip(case.heave, case.surge, strict=True)]
    return compared([pwm_of(one) for one in answers(student, case)], expected)


@check(points=10, visible=[sticks((True, 0.02, 0.0), (True, -0.04, 0.03))], hidden=rests, needs=["loads"])
def rest(student: Student, case: Sticks) -> Verdict:
    """Stands still while the sticks are at rest."""
    for page, one in zip([pwm_of(one) for one in answers(student, case)], case.heave, strict=True):
        if problem := format_error(page):
            return failed(problem)
        if not near(page["pulses_us"], [STOP_US] * 8):
            hint = f"A stick closer to 0 than {REST:g}, on either side, is at rest and counts as 0."
            return failed(hint, expected=f"1500 us at heave {one:.3f}", actual=str(page["pulses_us"]))
    return passed()


@check(points=10, visible=[sticks((True, 1.2, 0.0), (True, -1.1, 0.0))], hidden=too_far, needs=["loads"])
def limits(student: Student, case: Sticks) -> Verdict:
    """Never sends more than full thrust."""
    for page, one in zip([pwm_of(one) for one in answers(student, case)], case.heave, strict=True):
        if problem := format_error(page):
            return failed(problem)
        furthest = max(abs(pulse - STOP_US) for pulse in page["pulses_us"])
        if furthest > FULL_US + NEAR_US:
            hint = "A worn stick can read more than 1. Clamp it to full thrust: 1100 to 1900 us."
            return failed(hint, expected="1100 to 1900 us", actual=f"{page['pulses_us']} at heave {one:.3f}")
        if furthest < FULL_US - NEAR_US:
            hint = "A stick beyond 1 counts as 1: full thrust, not less."
            return failed(hint, expected="1100 and 1900 us", actual=f"{page['pulses_us']} at heave {one:.3f}")
    return passed()


@check(
    points=15,
    visible=[sticks((False, 0.5, 0.0), (True, 0.5, 0.0), (False, -1.0, 1.0))],
    hidden=armings,
    needs=["loads"],
)
def disarmed(student: Student, case: Sticks) -> Verdict:
    """Stands still while the pilot has not armed it."""
    for page, is_armed in zip([pwm_of(one) for one in answers(student, case)], case.is_armed, strict=True):
        if problem := format_error(page):
            return failed(problem)
        if page.get("is_armed") is not is_armed:
            hint = "Copy is_armed from the page 'controls' to the page 'pwm': True or False."
            return failed(hint, expected=str(is_armed), actual=str(page.get("is_armed")))
        if not is_armed and not near(page["pulses_us"], [STOP_US] * 8):
            hint = "The vehicle is not armed: all eight pulses must be 1500 us, whatever the sticks command."
            return failed(hint, expected="1500 us", actual=str(page["pulses_us"]))
    return passed()


@check(
    points=10,
    visible=[sticks((False, 0.0, 0.0), (True, -0.5, 0.0), (True, 0.0, 0.2))],
    hidden=lambda rng: heaves(rng)[:1],
    needs=["loads"],
)
def one_page(student: Student, case: Sticks) -> Verdict:
    """Answers each page of controls with one page, and with nothing else."""
    for answered in answers(student, case):
        names = ["another task" if one is None else f"page '{one[0]}'" for one in answered]
        if names.count("page 'pwm'") > 1:
            hint = "There are two pages 'pwm' for one page 'controls'. Store only one."
            return failed(hint, expected="one page 'pwm'", actual=", ".join(names))
        if names != ["page 'pwm'"]:
            hint = "Every extra page is work for each component that handles it: return only the page 'pwm'."
            return failed(hint, expected="one page 'pwm'", actual=", ".join(names) or "nothing")
    return passed()


@check(points=15, visible=[0], hidden=seeds, needs=["loads"])
def dives(student: Student, seed: int) -> Verdict:
    """Follows the pilot's sticks in the water."""
    run = student.run_scenario("urov_sticks", seed, FILE)
    moved = ", ".join(f"{name} {run.metrics[name]:.2f} m" for name in ("down_m", "ahead_m", "up_m"))
    if run.success:
        return passed(moved)
    return failed(
        f"The vehicle did not follow. Read the notes of: snr run urov_sticks --controller {FILE} (in your folder).",
        expected="1 m down, then 0.4 m ahead, then 0.4 m up",
        actual=moved.replace("_m ", " "),
    )


lab = Lab(
    "Hello thruster",
    files=[FILE, "wiring.py"],
    checks=[loads, heave, surge, rest, limits, disarmed, one_page, dives],
)
