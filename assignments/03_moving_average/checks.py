"""How "moving average" is graded. Hidden values and starts are drawn from the instructor's secret, not from here.

A landing's limit is that of the scenario `lander_noisy`: a touchdown of 3.05 m/s. Measured with one solution of length
60 over 40 seeds: 1.70 +- 0.24 m/s. `tests/assignments/test_moving_average.py` measures that again.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from snr_sim.grading import Lab, Stimulus, Student, Verdict, check, failed, partial_credit, passed, require_field

FILE, TESTS = "smooth.py", "my_tests.py"
NEAR = 1e-9
PERIOD_S = 0.05
LONGEST = 300
MAX_RUN_LENGTH = 150  # of a series of 200: so many have to have left the window that one can tell
NEEDED = 3  # of four wrong filters

Filter = Callable[[Sequence[float], int], list[float]]


@dataclass(frozen=True)
class Series:
    """Values, and the length of the moving average over them."""

    length: int
    values: tuple[float, ...]


def series(rng: random.Random) -> list[Series]:
    """Draw two series of 200 values, each with another length."""
    return [Series(rng.randrange(2, 40), tuple(rng.gauss(50.0, 20.0) for _ in range(200))) for _ in range(2)]


@dataclass(frozen=True)
class Fall:
    """A descent as the radar sees it."""

    noise: int

    def readings(self) -> tuple[list[float], list[float]]:
        """Return 200 heights and speeds."""
        rng = random.Random(self.noise)
        heights = [100.0 - 0.2 * i + rng.gauss(0.0, 4.0) for i in range(200)]
        return heights, [-4.0 + rng.gauss(0.0, 1.0) for _ in heights]


def falls(rng: random.Random) -> list[Fall]:
    """Draw a descent."""
    return [Fall(rng.getrandbits(63))]


def seeds(rng: random.Random) -> list[int]:
    """Draw six starts."""
    return [rng.getrandbits(63) for _ in range(6)]


def right(values: Sequence[float], length: int) -> list[float]:
    """Return the moving averages: each the mean of the last values, of fewer as long as fewer have come."""
    return [mean(values[max(0, i + 1 - length) : i + 1]) for i in range(len(values))]


def mean(values: Sequence[float]) -> float:
    """Return their mean."""
    return math.fsum(values) / len(values)


def mean_of_all(values: Sequence[float], length: int) -> list[float]:
    """Never forgets."""
    return right(values, len(values))


def cold(values: Sequence[float], length: int) -> list[float]:
    """Divides by the length from the first value on."""
    return [math.fsum(values[max(0, i + 1 - length) : i + 1]) / length for i in range(len(values))]


def one_more(values: Sequence[float], length: int) -> list[float]:
    """Keeps one value too many."""
    return right(values, length + 1)


def one_less(values: Sequence[float], length: int) -> list[float]:
    """Keeps one value too few."""
    return right(values, max(1, length - 1))


def raw_until_full(values: Sequence[float], length: int) -> list[float]:
    """Passes values on until there are enough."""
    return [*values[: length - 1], *right(values, length)[length - 1 :]]


def middle(values: Sequence[float], length: int) -> list[float]:
    """Take the middle one of the values in order of size, not their mean."""
    windows = [sorted(values[max(0, i + 1 - length) : i + 1]) for i in range(len(values))]
    return [(window[(len(window) - 1) // 2] + window[len(window) // 2]) / 2.0 for window in windows]


def late(values: Sequence[float], length: int) -> list[float]:
    """Answers with the mean before this one."""
    means = right(values, length)
    return [*means[:1], *means[:-1]]


def ahead(values: Sequence[float], length: int) -> list[float]:
    """Take values from both sides, also those that have not come yet."""
    half = length // 2
    return [mean(values[max(0, i - half) : i + length - half]) for i in range(len(values))]


def forgets_the_newest(values: Sequence[float], length: int) -> list[float]:
    """Never drops the first values."""
    return [mean(values[: min(i + 1, length)]) for i in range(len(values))]


def whole_numbers(values: Sequence[float], length: int) -> list[float]:
    """Divides without a remainder."""
    return [float(math.floor(one)) for one in right(values, length)]


SHOWN: dict[str, Filter] = {"mean_of_all": mean_of_all, "cold": cold}
OTHERS: dict[str, Filter] = {
    one.__name__: one
    for one in (one_more, one_less, raw_until_full, middle, late, ahead, forgets_the_newest, whole_numbers)
}


def wrong_filters(rng: random.Random) -> list[tuple[str, ...]]:
    """Draw four wrong filters, twice."""
    return [tuple(rng.sample(sorted(OTHERS), 4)) for _ in range(2)]


def smoothed(student: Student, case: Series) -> list[float]:
    """Return what the student's filter makes of a series."""
    return list(student.call(FILE, "smoothed", list(case.values), case.length, returns=list[float]))


def same(one: Sequence[Any], other: Sequence[float]) -> bool:
    """Return whether two lists hold the same numbers."""
    if len(one) != len(other):
        return False
    return all(is_number(a) and abs(a - b) <= NEAR * max(1.0, abs(b)) for a, b in zip(one, other, strict=True))


def is_number(value: Any) -> bool:
    """Return whether it is a finite number of usable size."""
    return isinstance(value, int | float) and not isinstance(value, bool) and -1e15 < value < 1e15


HINTS = {
    "mean_of_all": "It never forgets: it is the mean of all values, not the last ones. What has to leave the window?",
    "cold": "At the start it divides by the length, though it has fewer values: divide by the number of values.",
    "one_more": "Its window is one value too long. Count: how many values are in it after the first one has left?",
    "one_less": "Its window is one value too short. Count: how many values are in it when the first one leaves?",
    "raw_until_full": "At the start it returns values unchanged: return the mean of the values so far.",
    "middle": "That is the middle value (the median), not the mean.",
    "late": "It returns the previous mean: add the new value first, then compute the mean.",
    "ahead": "It uses later values. In flight the next readings are unknown: use the last ones.",
    "forgets_the_newest": "It drops the newest value of the window: drop the oldest.",
    "whole_numbers": "The division drops the fraction: use /, not //.",
}


def hint_for(values: Sequence[float], length: int, got: list[float], from_: int, to: int) -> str:
    """Return the mistake that would have given this, between two places of the series."""
    if len(got) != len(values):
        return f"There are {len(got)} means for {len(values)} values: one for each, also for the first ones."
    if got == list(values) and length > 1:
        return "Values come out as they went in. Step 2 begins in MovingAverage.update."
    for name, wrong in {**SHOWN, **OTHERS}.items():
        if same(got[from_:to], wrong(values, length)[from_:to]):
            return HINTS[name]
    return "A mean is the sum of the values in the window, divided by how many are in it."


@check(points=5, visible=[Series(1, (5.0, 7.0))])
def loads(student: Student, case: Series) -> Verdict:
    """Answers each value with a number."""
    got = smoothed(student, case)
    if len(got) == len(case.values):
        return passed()
    return failed("smoothed returns a list: one number for each value.", expected="two numbers", actual=str(got))


@check(points=20, visible=[Series(3, (6.0, 0.0, 3.0, 9.0, 9.0, 0.0))], hidden=series, needs=["loads"])
def exact(student: Student, case: Series) -> Verdict:
    """Is the mean of the last values, once there are enough."""
    got, expected_means = smoothed(student, case), right(case.values, case.length)
    if same(got[case.length - 1 :], expected_means[case.length - 1 :]) and len(got) == len(expected_means):
        return passed()
    hint = hint_for(case.values, case.length, got, case.length - 1, len(expected_means))
    return failed(hint, *first_difference(got, expected_means, case, case.length - 1))


@check(points=10, visible=[Series(3, (6.0, 0.0, 3.0, 9.0, 9.0, 0.0))], hidden=series, needs=["loads"])
def warm_up(student: Student, case: Series) -> Verdict:
    """Is the mean of the values so far, while the window is not full."""
    got, expected_means = smoothed(student, case), right(case.values, case.length)
    if same(got[: case.length], expected_means[: case.length]):
        return passed()
    return failed(
        hint_for(case.values, case.length, got, 0, case.length), *first_difference(got, expected_means, case, 0)
    )


def first_difference(got: list[Any], expected_means: list[float], case: Series, from_: int) -> tuple[str, str]:
    """Return what was expected and what came, where they first differ."""
    for i in range(from_, len(expected_means)):
        if i >= len(got) or not same([got[i]], [expected_means[i]]):
            came = repr(got[i]) if i < len(got) else "nothing"
            return f"{expected_means[i]:.6g} at value {i + 1}, length {case.length}", came
    return f"{len(expected_means)} means", f"{len(got)} means"


@check(points=10, visible=[Series(2, (1.0, 2.0, 4.0))], hidden=lambda rng: series(rng)[:1], needs=["loads"])
def fresh(student: Student, case: Series) -> Verdict:
    """Begins with an empty window, also if another filter was used before."""
    first, second = smoothed(student, case), smoothed(student, case)
    if same(second, first):
        return passed()
    hint = (
        "A second filter contains values of the first: they share one list. A list that is defined in the class, in a "
        "default argument or outside is shared by all; create it in __init__."
    )
    return failed(hint, expected=f"{first} again", actual=str(second))


@check(points=20, visible=[Fall(1)], hidden=falls, needs=["loads"])
def in_the_node(student: Student, case: Fall) -> Verdict:
    """Answers each page 'radar' with one page 'smooth': the mean height and the mean speed."""
    heights, speeds = case.readings()
    pages = [
        Stimulus(
            PERIOD_S * (i + 1), "radar", {"altitude_m": height, "velocity_mps": speed, "stamp_s": PERIOD_S * (i + 1)}
        )
        for i, (height, speed) in enumerate(zip(heights, speeds, strict=True))
    ]
    produced = [one for one in student.run_inputs(FILE, pages, robot="lander", role="lander") if one.name == "smooth"]
    if [one.after for one in produced] != list(range(len(pages))):
        hint = "Store one page 'smooth' for each page 'radar', also for the first ones."
        return failed(hint, expected=f"{len(pages)} pages 'smooth'", actual=f"{len(produced)}")
    lengths = []
    for name, values in (("altitude_m", heights), ("velocity_mps", speeds)):
        got = [require_field(one.value, "smooth", name, float) for one in produced]
        fitting = [length for length in range(1, MAX_RUN_LENGTH + 1) if same(got, right(values, length))]
        if not fitting:
            hint = f"'{name}' of page 'smooth' is not a moving average of '{name}' of page 'radar'. "
            mixed = "Do height and speed each have a filter, created once, in __init__, and updated once for each page?"
            return failed(hint + mixed, expected="a moving average", actual=f"begins with {got[:4]}")
        lengths.append(fitting)
    if lengths[0][0] == 1:
        return failed(
            "Page 'smooth' is a copy of page 'radar'. Step 3 begins in on_radar. Is LENGTH greater than 1? A filter "
            "that is created in on_radar is new for each page and remembers nothing: create it in __init__."
        )
    return passed(f"length {lengths[0][0]}", metrics={"length": lengths[0][0]})


@check(points=15, visible=[0, 1], hidden=seeds, needs=["loads"])
def lands(student: Student, seed: int) -> Verdict:
    """Lands by its own page 'smooth'."""
    run = student.run_scenario("lander_noisy", seed, FILE)
    if run.success:
        return passed(metrics={"fuel_kg": run.metrics["fuel_kg"]})
    speed_mps = (run.metrics.get("touchdown") or {}).get("vertical_mps")
    actual = run.outcome if speed_mps is None else f"{speed_mps:.2f} m/s"
    hint = (
        "With too few readings, a bad one shuts the engine off too high. With too many, the mean lags behind the "
        "height. Choose a LENGTH in between."
    )
    actual += f"; in your folder: snr run lander_noisy --controller {FILE} --seed {seed}"
    return failed(hint, expected="a touchdown below 3.05 m/s", actual=actual)


def cases_of(student: Student) -> tuple[list[Series], list[list[float]], str]:
    """Return the student's cases, their means, and what is wrong with their form; nothing if it is right."""
    found = student.call(TESTS, "cases", finite=False)
    if not isinstance(found, list) or not 1 <= len(found) <= 100:
        return [], [], "cases() must return a list of at most 100 cases."
    read, means = [], []
    for number, case in enumerate(found, start=1):
        if not isinstance(case, dict) or not {"length", "values", "means"} <= set(case):
            return [], [], f"Case {number} is not a dict with 'length', 'values' and 'means'."
        length, values, expected_means = case["length"], case["values"], case["means"]
        if not isinstance(length, int) or isinstance(length, bool) or not 1 <= length <= LONGEST:
            return [], [], f"Case {number}: its length is not a whole number from 1 to {LONGEST}."
        if not all(
            isinstance(one, list) and len(one) <= 1000 and all(map(is_number, one)) for one in (values, expected_means)
        ):
            return [], [], f"Case {number}: its values and its means are lists of numbers, 1000 at most."
        if not values or len(values) != len(expected_means):
            return (
                [],
                [],
                f"Case {number}: {len(values)} values and {len(expected_means)} means; one mean for each value.",
            )
        read.append(Series(length, tuple(values)))
        means.append(expected_means)
    return read, means, ""


@check(points=5, visible=[4])
def own_tests(student: Student, min_cases: int) -> Verdict:
    """Has at least four cases of its own, which a right filter passes."""
    read, means, problem = cases_of(student)
    if problem:
        return failed(problem)
    for number, (one, expected_means) in enumerate(zip(read, means, strict=True), start=1):
        if not same(expected_means, right(one.values, one.length)):
            expected, actual = first_difference(list(expected_means), right(one.values, one.length), one, 0)
            return failed(f"Case {number} fails a correct filter. Compute it again by hand.", expected, actual)
    if len(read) < min_cases:
        hint = f"Write {min_cases} cases, each for a different mistake."
        return failed(hint, expected=f"{min_cases} cases", actual=f"{len(read)}")
    return passed()


@check(points=15, visible=[tuple(SHOWN)], hidden=wrong_filters, needs=["own_tests"])
def catches(student: Student, case: tuple[str, ...]) -> Verdict:
    """Has cases that wrong filters fail."""
    read, means, problem = cases_of(student)
    if problem:
        return failed(problem)
    filters = {**SHOWN, **OTHERS}
    missed = [
        name
        for name in case
        if all(
            same(expected_means, filters[name](one.values, one.length))
            for one, expected_means in zip(read, means, strict=True)
        )
    ]
    caught, needed = len(case) - len(missed), min(NEEDED, len(case))
    if caught >= needed:
        return passed(f"caught {caught} of {len(case)} wrong filters")
    hint = (
        f"{len(missed)} of {len(case)} wrong filters pass all your cases. Let values differ and leave the window, "
        "and check the mean of the first ones, too: a filter that is wrong there must give another number."
    )
    kinds = "; ".join(str(filters[name].__doc__) for name in missed)
    return partial_credit(caught / needed, hint, f"{needed} of {len(case)} caught", f"passed: {kinds}")


lab = Lab(
    "Moving average",
    files=[FILE, TESTS, "pilot.py"],
    checks=[loads, exact, warm_up, fresh, in_the_node, lands, own_tests, catches],
)
