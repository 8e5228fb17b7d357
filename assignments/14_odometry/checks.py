"""How "odometry" is graded. Hidden ways, turns and squares are drawn from the instructor's secret, not from here.

The limit of a drive is that of the scenario `rover_square`: within 0.5 m of each corner. Measured with one solution
over 20 seeds: the farthest corner was missed by 0.20 +- 0.03 m. `tests/assignments/test_odometry.py` measures it again.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass

from snr_sim.grading import Lab, Stimulus, Student, Verdict, check, failed, passed, require_field
from snr_sim.scenario import Request, prepare

FILE = "where.py"
ROLLING_M, RADIUS_M, STANDS_S = 0.1255, 0.13, 2.0
MOTORS = ("motor_LF", "motor_LM", "motor_LB", "motor_RF", "motor_RM", "motor_RB")
NEAR = 1e-6


@dataclass(frozen=True)
class Turned:
    """How far six wheels had turned before, and have now [rad]."""

    before: tuple[float, ...]
    now: tuple[float, ...]


@dataclass(frozen=True)
class Short:
    """A short way: where it began, how far the rover turned in it, and how far it rolled."""

    x_m: float
    y_m: float
    heading_rad: float
    turn_rad: float
    way_m: float


@dataclass(frozen=True)
class Sight:
    """A rover and a point."""

    x_m: float
    y_m: float
    heading_rad: float
    point_m: tuple[float, float]


@dataclass(frozen=True)
class Rates:
    """What a gyroscope read, and when: the rover stands, then turns."""

    bias_radps: float
    turns_radps: tuple[float, ...]
    noise: int = 0

    def readings(self) -> tuple[list[float], list[float]]:
        """Return rates and their times: 120 while it stands, not at equal distances, as over a real wire."""
        rng = random.Random(self.noise)
        rates, stamps, now_s = [], [], 0.0
        while now_s < STANDS_S - 0.03:
            rates.append(self.bias_radps + rng.gauss(0.0, 0.002))
            stamps.append(now_s)
            now_s += rng.choice((0.01, 0.02))
        now_s = STANDS_S
        for turn in self.turns_radps:
            rates.append(self.bias_radps + turn)
            stamps.append(now_s)
            now_s += rng.choice((0.01, 0.02, 0.04))
        return rates, stamps


def right_headings(rates: Sequence[float], stamps: Sequence[float]) -> list[float]:
    """Return the heading after each rate: the mean at rest is taken from the rates after it."""
    at_rest = [rate for rate, stamp in zip(rates, stamps, strict=True) if stamp < STANDS_S]
    bias, heading, found = math.fsum(at_rest) / len(at_rest), 0.0, []
    for i, (rate, stamp) in enumerate(zip(rates, stamps, strict=True)):
        if stamp >= STANDS_S:
            heading += (rate - bias) * (stamp - stamps[i - 1])
        found.append(heading)
    return found


def turned(rng: random.Random) -> list[tuple[Turned, ...]]:
    """Draw six ways, ahead and astern, with wheels that differ."""
    cases = []
    for sign in (1.0, -1.0) * 3:
        before = tuple(rng.uniform(-50.0, 50.0) for _ in range(6))
        way = sign * rng.uniform(0.1, 2.0)
        cases.append(Turned(before, tuple(one + way + rng.gauss(0.0, 0.3) for one in before)))
    return [tuple(cases)]


def short_ways(rng: random.Random) -> list[tuple[Short, ...]]:
    """Draw eight short ways in all directions."""
    return [
        tuple(
            Short(
                rng.uniform(-5.0, 5.0),
                rng.uniform(-5.0, 5.0),
                rng.uniform(-3.0, 3.0),
                sign * rng.uniform(0.05, 0.2),
                rng.uniform(0.02, 0.2) * rng.choice((1.0, -1.0)),
            )
            for sign in (1.0, -1.0) * 4
        )
    ]


def sights(rng: random.Random) -> list[tuple[Sight, ...]]:
    """Draw points all around."""
    return [
        tuple(
            Sight(
                x := rng.uniform(-5.0, 5.0),
                y := rng.uniform(-5.0, 5.0),
                rng.uniform(-9.0, 9.0),
                (x + 3.0 * math.cos(angle), y + 3.0 * math.sin(angle)),
            )
            for angle in (rng.uniform(-math.pi, math.pi) for _ in range(12))
        )
    ]


def turns(rng: random.Random) -> list[Rates]:
    """Draw two gyroscopes."""
    return [
        Rates(rng.uniform(0.02, 0.04) * sign, tuple(rng.uniform(-0.6, 0.6) for _ in range(100)), rng.getrandbits(31))
        for sign in (1.0, -1.0)
    ]


def circles(rng: random.Random) -> list[float]:
    """Draw how fast a rover turns that drives in a circle."""
    return [rng.uniform(0.2, 0.6) * rng.choice((1.0, -1.0))]


def seeds(rng: random.Random) -> list[int]:
    """Draw four squares."""
    return [rng.getrandbits(63) for _ in range(4)]


def near(got: float, right: float) -> bool:
    """Return whether two numbers are the same, but for rounding."""
    return abs(got - right) <= NEAR * max(1.0, abs(right))


def way_of(student: Student, case: Turned) -> float:
    """Return the result of `way_m`."""
    return float(student.call(FILE, "way_m", list(case.before), list(case.now), returns=float))


def moved_of(student: Student, case: Short) -> list[float]:
    """Return the result of `moved`."""
    numbers = case.x_m, case.y_m, case.heading_rad, case.turn_rad, case.way_m
    return list(student.call(FILE, "moved", *numbers, returns=list[float]))


def off_of(student: Student, case: Sight) -> float:
    """Return the result of `off_rad`."""
    return float(student.call(FILE, "off_rad", case.x_m, case.y_m, case.heading_rad, list(case.point_m), returns=float))


def headings_of(student: Student, rates: list[float], stamps: list[float]) -> list[float]:
    """Return the result of `headings`."""
    return list(student.call(FILE, "headings", rates, stamps, returns=list[float]))


@check(points=5, visible=[Short(1.0, 2.0, 0.0, 0.0, 0.5)])
def loads(student: Student, case: Short) -> Verdict:
    """Has its functions, and they answer with numbers."""
    way_of(student, Turned((0.0,) * 6, (1.0,) * 6))
    if len(got := moved_of(student, case)) != 2:
        return failed("moved returns two numbers, x and y.", expected="two numbers", actual=str(got))
    off_of(student, Sight(0.0, 0.0, 0.0, (1.0, 1.0)))
    return passed()


@check(points=15, visible=[(Turned((1.0,) * 6, (3.0, 3.0, 3.0, 1.0, 1.0, 1.0)),)], hidden=turned, needs=["loads"])
def way(student: Student, case: tuple[Turned, ...]) -> Verdict:
    """Gives the way that six wheels have rolled."""
    for one in case:
        got = way_of(student, one)
        turns = [now - before for before, now in zip(one.before, one.now, strict=True)]
        mean = math.fsum(turns) / 6.0
        if near(got, ROLLING_M * mean):
            continue
        known = {
            "It is 0: step 2 begins in way_m.": 0.0,
            "That is how far the wheels turned, in radians: a wheel rolls ROLLING_M for each.": mean,
            "The rolling radius is ROLLING_M, less than the wheel's 0.13 m: the tyre is pressed in.": RADIUS_M * mean,
            "That is the way of all wheels together: take their mean.": ROLLING_M * math.fsum(turns),
            "That is the way since the start: take how far each has turned since before.": ROLLING_M
            * math.fsum(one.now)
            / 6.0,
            "A wheel that rolls back has a negative way: without abs.": abs(ROLLING_M * mean),
            "The way ahead is now less before, not the other way round.": -ROLLING_M * mean,
        }
        known |= {
            f"It takes the wheel {MOTORS[i]} alone. One may slip: take the mean of six.": ROLLING_M * turns[i]
            for i in range(6)
        }
        hint = next((text for text, wrong in known.items() if near(got, wrong)), "The mean of six turns, x ROLLING_M.")
        return failed(hint, expected=f"{ROLLING_M * mean:.4f} m", actual=f"{got:.4f} m")
    return passed()


@check(
    points=20,
    visible=[(Short(1.0, 2.0, 0.0, 0.0, 0.5), Short(0.0, 0.0, 1.0, 0.2, 0.1))],
    hidden=short_ways,
    needs=["loads"],
)
def move(student: Student, case: tuple[Short, ...]) -> Verdict:
    """Moves along the heading in the middle of a turn."""
    for one in case:
        got, middle = moved_of(student, one), one.heading_rad + 0.5 * one.turn_rad
        right = [one.x_m + one.way_m * math.cos(middle), one.y_m + one.way_m * math.sin(middle)]
        if math.dist(got, right) <= 0.003 * abs(one.way_m):  # the chord of an arc is that much shorter
            continue

        def at(heading_rad: float, one: Short = one) -> list[float]:
            return [one.x_m + one.way_m * math.cos(heading_rad), one.y_m + one.way_m * math.sin(heading_rad)]

        known = {
            "It has not moved: step 3 begins in moved.": [one.x_m, one.y_m],
            "It moves along the heading before the turn; it has that only at the begin of the way.": at(
                one.heading_rad
            ),
            "It moves along the heading after the turn; it has that only at the end of the way.": at(
                one.heading_rad + one.turn_rad
            ),
            "Half of the turn belongs to it, with its sign: the middle is heading_rad + turn_rad / 2.": at(
                one.heading_rad - 0.5 * one.turn_rad
            ),
            "x goes with the cosine of the heading, and y with its sine: heading 0 is ahead, along x.": [
                one.x_m + one.way_m * math.sin(middle),
                one.y_m + one.way_m * math.cos(middle),
            ],
            "y is positive to the left, as angles are: no minus.": [right[0], 2.0 * one.y_m - right[1]],
            "It begins at 0 again each time: add to x_m and y_m.": [right[0] - one.x_m, right[1] - one.y_m],
            "math.cos and math.sin take radians, and so is the heading: without math.radians.": at(
                math.radians(middle)
            ),
        }
        hint = next(
            (text for text, wrong in known.items() if math.dist(got, wrong) <= 1e-6),
            "x grows by way_m x cos, y by way_m x sin, of the heading in the middle of the turn.",
        )
        return failed(hint, expected=f"x {right[0]:.4f}, y {right[1]:.4f}", actual=f"x {got[0]:.4f}, y {got[1]:.4f}")
    return passed()


@check(
    points=15,
    visible=[(Sight(0.0, 0.0, 0.0, (1.0, 1.0)), Sight(0.0, 0.0, 3.0, (-1.0, -0.5)))],
    hidden=sights,
    needs=["loads"],
)
def bearing(student: Student, case: tuple[Sight, ...]) -> Verdict:
    """Says on which side a point is, and by how much, between -pi and pi."""
    for one in case:
        got, dx, dy = off_of(student, one), one.point_m[0] - one.x_m, one.point_m[1] - one.y_m
        direction = math.atan2(dy, dx)
        plain = direction - one.heading_rad
        right = math.remainder(plain, 2.0 * math.pi)
        if near(got, right):
            continue
        known = {
            "It is 0: step 4 begins in off_rad.": 0.0,
            "A turn of more than half a circle is shorter the other way round: bring the angle into -pi to pi.": plain,
            "That is the direction on the map: where the rover looks must be taken off.": direction,
            "The point is on the other side: it is the direction to the point, less the heading.": -right,
            "math.atan does not know whether a point is ahead or behind: use math.atan2(dy, dx).": math.remainder(
                math.atan(dy / dx) - one.heading_rad, 2.0 * math.pi
            ),
            "The first argument of math.atan2 is y.": math.remainder(
                math.atan2(dx, dy) - one.heading_rad, 2.0 * math.pi
            ),
            "The direction begins at the rover: take x_m and y_m off the point.": math.remainder(
                math.atan2(one.point_m[1], one.point_m[0]) - one.heading_rad, 2.0 * math.pi
            ),
            "All angles here are in radians.": math.degrees(right),
        }
        hint = next(
            (text for text, wrong in known.items() if near(got, wrong)),
            "It is the direction from the rover to the point, less the heading, in -pi to pi.",
        )
        return failed(hint, expected=f"{right:.4f} rad", actual=f"{got:.4f} rad")
    return passed()


@check(points=15, visible=[Rates(0.03, (0.3,) * 50, 7)], hidden=turns, needs=["loads"])
def gyro(student: Student, case: Rates) -> Verdict:
    """Adds up the rates of turning, less what the gyroscope reads at rest."""
    rates, stamps = case.readings()
    got, right = headings_of(student, rates, stamps), right_headings(rates, stamps)
    if len(got) != len(right):
        return failed("headings returns a heading for each rate.", f"{len(right)} numbers", f"{len(got)}")
    first = next(i for i, stamp in enumerate(stamps) if stamp >= STANDS_S)
    # What a reading at the change from rest to turning counts for is a matter of taste.
    if all(abs(a - b) <= 0.02 for a, b in zip(got, right, strict=True)) and abs(got[-1] - right[-1]) <= 0.02:
        return passed()
    steps = [stamps[i] - stamps[i - 1] for i in range(first, len(stamps))]
    raw = math.fsum(rate * step for rate, step in zip(rates[first:], steps, strict=True))
    hint = "While stamp_s < STANDS_S take the mean of the rates; then add (rate - mean) x the time since the last one."
    if all(one == got[0] for one in got):
        hint = "The heading stays the same: step 5 begins in Gyro.update."
    elif abs(got[first - 1]) > 0.005:
        hint = "It turns while the rover stands: what the gyroscope reads then is its bias, not a turn."
    elif abs(got[-1] - raw) <= 1e-3:
        hint = "It adds up the bias too: what it reads at rest has to be taken off each rate."
    elif abs(got[-1] - 0.02 * math.fsum(rate - case.bias_radps for rate in rates[first:])) <= 0.02:
        hint = "Readings do not come at equal distances: take the time since the last one, from stamp_s."
    elif abs(got[-1] - math.fsum(rate - case.bias_radps for rate in rates[first:])) <= 0.5:
        hint = "A rate is an angle for each second: multiply it by the time since the last one."
    return failed(hint, expected=f"{right[-1]:.4f} rad at the end", actual=f"{got[-1]:.4f} rad")


@check(points=10, visible=[0.4], hidden=circles, needs=["loads"])
def in_the_node(student: Student, case: float) -> Verdict:
    """Answers each round of the motors with one page 'place': where the rover is on a circle."""
    pages: list[Stimulus] = []
    rounds, speed_radps = 60, 4.0
    for i in range(rounds):
        now_s = 0.05 * (i + 1)
        driven_s = max(0.0, now_s - STANDS_S)
        rates = [0.0, 0.0, case if driven_s > 0.0 else 0.0]
        pages.append(Stimulus(now_s - 0.02, "imu", {"rate_radps": rates, "yaw_rad": 0.0, "stamp_s": now_s}))
        turned = 100.0 + speed_radps * driven_s  # the wheels have turned before this run
        pages += [Stimulus(now_s, name, {"turned_rad": turned, "stamp_s": now_s}) for name in MOTORS]
    parameters = prepare(Request("rover_square")).scenario.parameters(0)
    places: list[tuple[float, float, float]] = []
    for produced in student.run_inputs(FILE, pages, robot="rover", parameters=parameters):
        if produced.kind == "store_page" and produced.name == "place":
            fields = (require_field(produced.value, "place", name, float) for name in ("x_m", "y_m", "heading_rad"))
            places.append(tuple(fields))  # type: ignore[arg-type]
    if len(places) != rounds:
        hint = "Each page 'motor_RB' must be followed by one page 'place'. Does on_motors return it?"
        return failed(hint, expected=f"{rounds} pages", actual=f"{len(places)}")
    x, y, _ = places[-1]
    driven_s = 0.05 * rounds - STANDS_S
    radius_m, angle = speed_radps * ROLLING_M / case, case * driven_s
    right = radius_m * math.sin(angle), radius_m * (1.0 - math.cos(angle))
    if math.dist((x, y), right) <= 0.02:
        return passed()
    hint = "way_m and moved are right, but the node puts them together in another way: step 6 is in on_motors."
    if (x, y) == (0.0, 0.0):
        hint = "The rover stays at the start. Step 6 begins in on_motors."
    elif math.hypot(x, y) > 5.0:
        hint = "It jumps at the first page: the wheels have turned before, so the first reading alone is no way."
    elif abs(y) < 0.02:
        hint = "It drives straight on in a curve: the turn is the gyro's heading less that of the last time."
    return failed(hint, f"x {right[0]:.2f}, y {right[1]:.2f} on a circle", f"x {x:.2f}, y {y:.2f}")


@check(points=20, visible=[0, 1], hidden=seeds, needs=["loads"])
def square(student: Student, seed: int) -> Verdict:
    """Drives around a square and back to the start."""
    run = student.run_scenario("rover_square", seed, FILE)
    if run.success:
        return passed(metrics={"energy_j": run.metrics["energy_j"]})
    gaps = ", ".join(f"{gap:.2f} m" for gap in run.metrics["nearest_m"])
    actual = f"{gaps} from the corners; in your folder: snr run rover_square --controller {FILE} --seed {seed}"
    hint = "Which corner does it miss first? Compare page 'place' with where the rover is in a picture of the run."
    return failed(hint, "within 0.5 m of each corner, in their order", actual)


lab = Lab("Odometry", files=[FILE, "pilot.py"], checks=[loads, way, move, bearing, gyro, in_the_node, square])
