"""The grader's side of the lab "two nodes": a link that is bad in five ways, and what either end makes of it."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from snr_sim import Page
from snr_sim.grading import Lab, Output, ScenarioRun, Stimulus, Student, Verdict, check, failed, passed, require_field
from snr_sim.recording import PageRecord, decode_value
from snr_sim.scenario import load_program

thrusters: Any = load_program(str(Path(__file__).parent / "starter" / "thrusters.py"))  # that is given, so it is ours

KINDS = ("loss", "late", "cut", "narrow", "gone")  # of scenarios/urov_bad_link.py: what is wrong with seed 0, 1, 2, ...
COUNTS_S, OLD_S = 0.45, 0.5
ROUNDING_S, TICK_S = 1e-6, 0.02  # a command may count for one tick more or less
IMU_S, STICKS_S = 0.02, 0.05


@dataclass(frozen=True)
class Link:
    """A flight over a bad link; what is wrong with it follows from the seed."""

    seed: int

    @property
    def label(self) -> str:
        """What is wrong."""
        return KINDS[self.seed % len(KINDS)]


def other(*kinds: str) -> Callable[[random.Random], list[Link]]:
    """Return what draws a link of each of these kinds."""
    return lambda rng: [Link(len(KINDS) * rng.getrandbits(60) + KINDS.index(kind)) for kind in kinds]


def one_of(kind: str) -> list[Link]:
    """Return a link of this kind, for all to see."""
    return [Link(KINDS.index(kind))]


# -- the vehicle: which command counts at each moment -----------------------------------------------------------------


@dataclass(frozen=True)
class Command:
    """A page "controls" at the vehicle."""

    received_s: float
    made_s: float
    data: dict[str, Any]

    @property
    def pulses(self) -> list[float]:
        """Pulses of this command."""
        pulses: list[float] = thrusters.pulses_us(self.data["surge"], self.data["yaw"])
        return pulses


HINTS = {
    "old": (
        "It applied a command that was created more than 0.45 s before. The time since a page arrived does not "
        "include its time in transit: use get_age_s."
    ),
    "overtaken": (
        "It applied a command although it had received a newer one: pages overtake each other on this link, and the "
        "last one to arrive is not always the newest."
    ),
    "careful": "The pulses are neutral although a fresh enough command had arrived.",
    "disarmed": "It pushed although the newest command has is_armed False.",
    "other": "The pulses match no command: pass surge and yaw of the command to pulses_us.",
    "field": "'is_armed' of the page 'pwm' must be that of the newest command, even if the command is too old.",
}


def command_verdict(
    commands: Sequence[Command], pulses: Sequence[tuple[float, Any]], imu_s: Sequence[float]
) -> Verdict:
    """Return whether at each page "imu" the right command was applied, or none."""
    if not pulses:
        return failed("The vehicle stores no page 'pwm'.", "pages 'pwm'", "none")
    if len(pulses) != len(imu_s):
        return failed(
            "Store one page 'pwm' for each page 'imu': outputs without new pages disarm themselves.",
            f"{len(imu_s)} pages",
            f"{len(pulses)} pages",
        )
    for now_s, page in pulses:
        found = require_field(page, "pwm", "pulses_us", list[float])
        right = [_expected_pulses(commands, now_s, *margins) for margins in product((-1.0, 1.0), repeat=2)]
        if not any(_near(found, one) for one, _ in right):
            what = _mistake(commands, now_s, found)
            return failed(HINTS[what], f"{right[0][0][:4]} at {now_s:.2f} s", f"{found[:4]}")
        is_armed = require_field(page, "pwm", "is_armed", bool)
        if is_armed not in [armed for _, armed in right]:
            return failed(HINTS["field"], f"is_armed: {right[0][1]} at {now_s:.2f} s", str(is_armed))
    return passed()


def _expected_pulses(
    commands: Sequence[Command], now_s: float, receive_sign: float, age_sign: float
) -> tuple[list[float], bool]:
    """Return pulses and whether armed; a command that arrives or ages just now may count or not: -1 or 1."""
    here = [one for one in commands if one.received_s <= now_s + receive_sign * ROUNDING_S]
    if not here:
        return thrusters.neutral_us(), False
    newest = max(here, key=lambda one: one.made_s)
    counts = newest.data["is_armed"] and now_s - newest.made_s <= COUNTS_S + age_sign * TICK_S
    return (newest.pulses if counts else thrusters.neutral_us()), newest.data["is_armed"]


def _mistake(commands: Sequence[Command], now_s: float, found: Sequence[float]) -> str:
    if _near(found, thrusters.neutral_us()):
        return "careful"
    same = [one for one in commands if one.received_s <= now_s + ROUNDING_S and _near(found, one.pulses)]
    if not same:
        return "other"
    newest = max(same, key=lambda one: one.made_s)
    if not newest.data["is_armed"]:
        return "disarmed"
    return "old" if now_s - newest.made_s > COUNTS_S else "overtaken"


def _near(found: Sequence[float], expected: Sequence[float]) -> bool:
    return len(found) == len(expected) and all(abs(a - b) < 1e-6 for a, b in zip(found, expected, strict=True))


def pages_at(run: ScenarioRun, role: str, key: str) -> list[tuple[float, Page]]:
    """Return when pages of a key were stored at one end, and the pages."""
    return [
        (record.t, decode_value(bytes(record.values), {"page": Page})[0])
        for record in run.trace.records
        if isinstance(record, PageRecord) and record.name == key and record.node == f"{role}_node"
    ]


def asked(page: Any) -> dict[str, Any]:
    """Return the command in a page "controls" that arrived at the vehicle."""
    sticks = {name: require_field(page, "controls", name, float) for name in ("surge", "yaw")}
    return {**sticks, "is_armed": require_field(page, "controls", "is_armed", bool)}


def run_and_check(student: Student, case: Link) -> tuple[ScenarioRun, Verdict]:
    """Return a run, and the verdict on the commands that the vehicle applied."""
    run = student.run_scenario("urov_bad_link", case.seed, "two_nodes.py")
    commands = [Command(t, page.created_at_s, asked(page.data)) for t, page in pages_at(run, "urov", "controls")]
    if not commands:
        return run, failed("No page 'controls' arrived at the vehicle.", "20 a second", "none")
    pulses = [(t, page.data) for t, page in pages_at(run, "urov", "pwm")]
    imu_s = [t for t, _ in pages_at(run, "urov", "imu")]
    if len(pulses) == len(imu_s) - 1:
        imu_s = imu_s[:-1]  # the run ended in between
    return run, command_verdict(commands, pulses, imu_s)


def run_verdict(student: Student, case: Link) -> Verdict:
    """Return the verdict on a run: the commands applied, then the scenario's limits."""
    run, verdict = run_and_check(student, case)
    if verdict.fraction == 1.0 and not run.success:
        return failed("The thrusters exceeded the scenario's limits.", "held", "; ".join(run.notes))
    return verdict


# -- each end by itself -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class StickSequence:
    """A pilot's sticks, drawn from this number."""

    number: int


def draw_sequences(rng: random.Random) -> list[StickSequence]:
    """Draw two other sequences."""
    return [StickSequence(rng.getrandbits(63)) for _ in range(2)]


def sticks(number: int, rng: random.Random, is_armed: bool = True) -> dict[str, Any]:
    """Return a page of the pilot's."""
    page = {"number": number, "mode": "manual", "is_armed": is_armed, "is_stop": False, "clears_stop": False}
    moved = {"surge": rng.uniform(0.2, 0.8), "sway": 0.0, "heave": 0.0, "yaw": rng.uniform(-0.2, 0.2)}
    return {**page, **moved, "depth_m": None, "heading_rad": None}


@check(points=10, visible=[StickSequence(1)], hidden=draw_sequences)
def vehicle_alone(student: Student, sequence: StickSequence) -> Verdict:
    """The vehicle by itself: applies commands until 0.45 s after the last one was created"""
    rng = random.Random(sequence.number)
    imu = {"roll_rad": 0.0, "pitch_rad": 0.0, "yaw_rad": 0.0, "rate_radps": [0.0, 0.0, 0.0]}
    silent_s = rng.uniform(1.0, 1.3)
    pages: list[tuple[float, str, dict[str, Any]]] = []
    for i in range(round(4.0 / STICKS_S)):
        at_s = i * STICKS_S + 0.007
        if not silent_s <= at_s <= silent_s + 1.2:
            pages.append((at_s, "controls", sticks(i, rng, is_armed=0.3 < at_s < 3.2)))
    pages += [(i * IMU_S, "imu", {**imu, "stamp_s": i * IMU_S}) for i in range(round(4.0 / IMU_S))]
    pages.sort(key=lambda page: page[0])
    made = student.run_inputs("two_nodes.py", [Stimulus(*page) for page in pages], role="urov")
    commands = [Command(at_s, at_s, data) for at_s, key, data in pages if key == "controls"]
    return command_verdict(commands, outputs_of(made, "pwm"), [at_s for at_s, key, _ in pages if key == "imu"])


def outputs_of(made: Sequence[Output], key: str) -> list[tuple[float, Any]]:
    """Return the time and the data of each page of a key."""
    return [(one.at_s, one.value) for one in made if one.kind == "store_page" and one.name == key]


@check(points=8, visible=[StickSequence(1)], hidden=draw_sequences)
def surface_alone(student: Student, sequence: StickSequence) -> Verdict:
    """The surface by itself: passes each page "sticks" on as "controls", also while nothing arrives from the vehicle"""
    rng = random.Random(sequence.number)
    given = [Stimulus(i * STICKS_S, "sticks", sticks(i, rng)) for i in range(60)]
    up = {"up": True, "has_left": False, "age_s": 0.0}
    given.insert(10, Stimulus(given[9].at_s + 0.01, "link_tether", up))
    given.insert(40, Stimulus(given[39].at_s + 0.01, "link_tether", {**up, "up": False, "age_s": None}))
    made = student.run_inputs("two_nodes.py", given, role="topside")
    expected = [(one.at_s, one.value) for one in given if one.key == "sticks"]
    found = outputs_of(made, "controls")
    if len(found) != len(expected):
        return failed(
            "Store one page 'controls' for each page 'sticks', also while the vehicle is silent: after a cut the "
            "vehicle needs a fresh command.",
            f"{len(expected)} pages",
            f"{len(found)} pages",
        )
    for (_, page), (_, right) in zip(found, expected, strict=True):
        if page != right:
            return failed("'controls' must contain the data of 'sticks'.", str(right), str(page))
    return passed()


# -- over the link ----------------------------------------------------------------------------------------------------


@check(points=14, visible=one_of("loss"), hidden=other("loss"))
def lost_and_overtaken(student: Student, case: Link) -> Verdict:
    """One page in five is lost and some overtake others: it continues, and never returns to an earlier command"""
    return run_verdict(student, case)


@check(points=10, visible=one_of("late"), hidden=other("late"))
def late(student: Student, case: Link) -> Verdict:
    """All pages take 0.3 s: that is late, but not too late"""
    return run_verdict(student, case)


@check(points=18, visible=one_of("cut"), hidden=other("cut", "cut"))
def cut(student: Student, case: Link) -> Verdict:
    """The link is cut for two seconds: neutral within half a second, then the first fresh command is applied"""
    return run_verdict(student, case)


@check(points=14, visible=one_of("narrow"), hidden=other("narrow"))
def narrow(student: Student, case: Link) -> Verdict:
    """The bandwidth is too low, so pages arrive later and later: no old command is applied"""
    return run_verdict(student, case)


@check(points=10, visible=one_of("gone"), hidden=other("gone"))
def gone(student: Student, case: Link) -> Verdict:
    """The surface stops sending: neutral within half a second, and from then on"""
    return run_verdict(student, case)


@check(points=16, visible=one_of("cut"), hidden=other("late", "cut", "gone", "narrow"))
def watches(student: Student, case: Link) -> Verdict:
    """The surface reports the state of the link: page "alarm" is ok, old or lost, twenty times a second"""
    run = student.run_scenario("urov_bad_link", case.seed, "two_nodes.py")
    alarms = pages_at(run, "topside", "alarm")
    expected = len(pages_at(run, "topside", "sticks"))
    if len(alarms) < expected - 1:
        return failed("One page 'alarm' for each page 'sticks'.", f"{expected} pages", f"{len(alarms)} pages")
    links, statuses = pages_at(run, "topside", "link_tether"), pages_at(run, "topside", "vehicle")
    for now_s, page in alarms:
        found = require_field(page.data, "alarm", "state", str)
        right = {_alarm(links, statuses, now_s, margin_s) for margin_s in (-ROUNDING_S, ROUNDING_S)}
        if found not in right:
            return failed(ALARMS[sorted(right)[0]], f"{' or '.join(sorted(right))} at {now_s:.2f} s", str(found))
    return passed()


ALARMS = {
    "lost": "'lost' as soon as 'up' of the page 'link_tether' is False, or while there is no such page.",
    "old": "'old' while the link is up and the newest page 'vehicle' is older than 0.5 s, or there is none.",
    "ok": "'ok' while the link is up and the newest page 'vehicle' is at most 0.5 s old.",
}


def _alarm(
    links: Sequence[tuple[float, Page]], statuses: Sequence[tuple[float, Page]], now_s: float, margin_s: float
) -> str:
    """Return the right state; what comes or ages just now may count or not, by the margin."""
    link = next((page.data for t, page in reversed(links) if t <= now_s + margin_s), None)
    if link is None or not link["up"]:
        return "lost"
    page = next((page for t, page in reversed(statuses) if t <= now_s + margin_s), None)
    return "ok" if page is not None and now_s - page.created_at_s <= OLD_S - margin_s else "old"


lab = Lab(
    "Two nodes",
    files=["two_nodes.py", "vehicle.py", "topside.py"],
    checks=[vehicle_alone, surface_alone, lost_and_overtaken, late, cut, narrow, gone, watches],
)
