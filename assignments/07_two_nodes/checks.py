"""The grader's side of the lab "two nodes": a link that is bad in five ways, and what either end makes of it."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from snr_sim.grading import Flown, Given, Lab, Produced, Student, Verdict, check, failed, field_of, passed
from snr_sim.prelude.page import Page
from snr_sim.prelude.values import decode_value
from snr_sim.recording.records import PageRecord
from snr_sim.scenario.library import load_program

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
    """Returns what draws a link of each of these kinds."""
    return lambda rng: [Link(len(KINDS) * rng.getrandbits(60) + KINDS.index(kind)) for kind in kinds]


def one_of(kind: str) -> list[Link]:
    """Returns a link of this kind, for all to see."""
    return [Link(KINDS.index(kind))]


# -- the vehicle: which command counts at each moment -----------------------------------------------------------------


@dataclass(frozen=True)
class Command:
    """A page "controls" at the vehicle."""

    came_s: float
    made_s: float
    data: dict[str, Any]

    @property
    def pulses(self) -> list[float]:
        """What it asks for."""
        pulses: list[float] = thrusters.pulses_us(self.data["surge"], self.data["yaw"])
        return pulses


HINTS = {
    "old": (
        "It obeyed a command that had been made more than 0.45 s before. How long a page has been here says nothing "
        "of how long it was under way: ask for its age."
    ),
    "overtaken": (
        "It obeyed a command although it had had one that was made later: pages overtake each other on this link, and "
        "the last one to come is not always the newest."
    ),
    "careful": "Nothing pushed although a command that was fresh enough had come.",
    "disarmed": "It pushed although the newest command says that it is not armed.",
    "other": "The pulses are those of no command at all: they are what pulses_us makes of its surge and yaw.",
    "field": "'is_armed' of the page 'pwm' is what the newest command says, also when that no longer counts.",
}


def obeyed(commands: Sequence[Command], pulses: Sequence[tuple[float, Any]], imu_s: Sequence[float]) -> Verdict:
    """Returns whether at each page "imu" the right command was obeyed, or none."""
    if not pulses:
        return failed("The vehicle stores no page 'pwm'.", "pages 'pwm'", "none")
    if len(pulses) != len(imu_s):
        return failed(
            "The vehicle stores one page 'pwm' for each page 'imu': outputs that hear nothing let go.",
            f"{len(imu_s)} pages",
            f"{len(pulses)} pages",
        )
    for now_s, page in pulses:
        found = field_of(page, "pwm", "pulses_us", list[float])
        right = [_wanted(commands, now_s, *margins) for margins in product((-1.0, 1.0), repeat=2)]
        if not any(_near(found, one) for one, _ in right):
            what = _mistake(commands, now_s, found)
            return failed(HINTS[what], f"{right[0][0][:4]} at {now_s:.2f} s", f"{found[:4]}")
        is_armed = field_of(page, "pwm", "is_armed", bool)
        if is_armed not in [said for _, said in right]:
            return failed(HINTS["field"], f"is_armed: {right[0][1]} at {now_s:.2f} s", str(is_armed))
    return passed()


def _wanted(commands: Sequence[Command], now_s: float, comes: float, counts_more: float) -> tuple[list[float], bool]:
    """Returns pulses and whether armed; a command that comes or ages just now may count or not: -1 or 1."""
    here = [one for one in commands if one.came_s <= now_s + comes * ROUNDING_S]
    if not here:
        return thrusters.neutral_us(), False
    newest = max(here, key=lambda one: one.made_s)
    counts = newest.data["is_armed"] and now_s - newest.made_s <= COUNTS_S + counts_more * TICK_S
    return (newest.pulses if counts else thrusters.neutral_us()), newest.data["is_armed"]


def _mistake(commands: Sequence[Command], now_s: float, found: Sequence[float]) -> str:
    if _near(found, thrusters.neutral_us()):
        return "careful"
    same = [one for one in commands if one.came_s <= now_s + ROUNDING_S and _near(found, one.pulses)]
    if not same:
        return "other"
    newest = max(same, key=lambda one: one.made_s)
    if not newest.data["is_armed"]:
        return "disarmed"
    return "old" if now_s - newest.made_s > COUNTS_S else "overtaken"


def _near(found: Sequence[float], wanted: Sequence[float]) -> bool:
    return len(found) == len(wanted) and all(abs(a - b) < 1e-6 for a, b in zip(found, wanted, strict=True))


def pages_at(flown: Flown, role: str, key: str) -> list[tuple[float, Page]]:
    """Returns when pages of a key were stored at one end, and the pages."""
    return [
        (record.t, decode_value(bytes(record.values), {"page": Page})[0])
        for record in flown.trace.records
        if isinstance(record, PageRecord) and record.name == key and record.node == f"{role}_node"
    ]


def asked(page: Any) -> dict[str, Any]:
    """Returns what a page "controls" asks for, as it came to the vehicle."""
    sticks = {name: field_of(page, "controls", name, float) for name in ("surge", "yaw")}
    return {**sticks, "is_armed": field_of(page, "controls", "is_armed", bool)}


def flew(student: Student, case: Link) -> tuple[Flown, Verdict]:
    """Returns a flight, and whether the vehicle obeyed as it should."""
    flown = student.fly("urov_bad_link", case.seed, "two_nodes.py")
    commands = [Command(t, page.created_at_s, asked(page.data)) for t, page in pages_at(flown, "urov", "controls")]
    if not commands:
        return flown, failed("No page 'controls' ever came to the vehicle.", "20 a second", "none")
    pulses = [(t, page.data) for t, page in pages_at(flown, "urov", "pwm")]
    imu_s = [t for t, _ in pages_at(flown, "urov", "imu")]
    if len(pulses) == len(imu_s) - 1:
        imu_s = imu_s[:-1]  # the run ended in between
    return flown, obeyed(commands, pulses, imu_s)


def well_flown(student: Student, case: Link) -> Verdict:
    """Returns whether the vehicle obeyed as it should, and pushed as the referee wants it."""
    flown, verdict = flew(student, case)
    if verdict.fraction == 1.0 and not flown.success:
        return failed("The referee is not content with what the thrusters did.", "held", "; ".join(flown.notes))
    return verdict


# -- each end by itself -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Hand:
    """A pilot's hand, drawn from this number."""

    number: int


def draw_hands(rng: random.Random) -> list[Hand]:
    """Two other hands."""
    return [Hand(rng.getrandbits(63)) for _ in range(2)]


def sticks(number: int, rng: random.Random, is_armed: bool = True) -> dict[str, Any]:
    """Returns a page of the pilot's."""
    says = {"number": number, "mode": "manual", "is_armed": is_armed, "is_stop": False, "clears_stop": False}
    moved = {"surge": rng.uniform(0.2, 0.8), "sway": 0.0, "heave": 0.0, "yaw": rng.uniform(-0.2, 0.2)}
    return {**says, **moved, "depth_m": None, "heading_rad": None}


@check(points=10, visible=[Hand(1)], hidden=draw_hands)
def vehicle_alone(student: Student, hand: Hand) -> Verdict:
    """The vehicle by itself: obeys while commands come, and not for longer than 0.45 s after the last one was made"""
    rng = random.Random(hand.number)
    imu = {"roll_rad": 0.0, "pitch_rad": 0.0, "yaw_rad": 0.0, "rate_radps": [0.0, 0.0, 0.0]}
    silent_s = rng.uniform(1.0, 1.3)
    pages: list[tuple[float, str, dict[str, Any]]] = []
    for i in range(round(4.0 / STICKS_S)):
        at_s = i * STICKS_S + 0.007
        if not silent_s <= at_s <= silent_s + 1.2:
            pages.append((at_s, "controls", sticks(i, rng, is_armed=0.3 < at_s < 3.2)))
    pages += [(i * IMU_S, "imu", {**imu, "stamp_s": i * IMU_S}) for i in range(round(4.0 / IMU_S))]
    pages.sort(key=lambda page: page[0])
    made = student.feed("two_nodes.py", [Given(*page) for page in pages], role="urov")
    commands = [Command(at_s, at_s, data) for at_s, key, data in pages if key == "controls"]
    return obeyed(commands, told(made, "pwm"), [at_s for at_s, key, _ in pages if key == "imu"])


def told(made: Sequence[Produced], key: str) -> list[tuple[float, Any]]:
    """Returns when pages of a key came, and what they said."""
    return [(one.at_s, one.value) for one in made if one.kind == "store_page" and one.name == key]


@check(points=8, visible=[Hand(1)], hidden=draw_hands)
def surface_alone(student: Student, hand: Hand) -> Verdict:
    """The surface by itself: passes each page "sticks" on as "controls", also when the vehicle is not heard"""
    rng = random.Random(hand.number)
    given = [Given(i * STICKS_S, "sticks", sticks(i, rng)) for i in range(60)]
    up = {"up": True, "left": False, "age_s": 0.0}
    given.insert(10, Given(given[9].at_s + 0.01, "link_tether", up))
    given.insert(40, Given(given[39].at_s + 0.01, "link_tether", {**up, "up": False, "age_s": None}))
    made = student.feed("two_nodes.py", given, role="topside")
    wanted = [(one.at_s, one.value) for one in given if one.key == "sticks"]
    found = told(made, "controls")
    if len(found) != len(wanted):
        return failed(
            "One page 'controls' for each page 'sticks', whatever is heard of the vehicle: after a cut it wants a "
            "command that is fresh.",
            f"{len(wanted)} pages",
            f"{len(found)} pages",
        )
    for (_, page), (_, right) in zip(found, wanted, strict=True):
        if page != right:
            return failed("'controls' holds what 'sticks' held.", str(right), str(page))
    return passed()


# -- over the link ----------------------------------------------------------------------------------------------------


@check(points=14, visible=one_of("loss"), hidden=other("loss"))
def lost_and_overtaken(student: Student, case: Link) -> Verdict:
    """One page in five is lost and some overtake others: it goes on, and never back to an earlier command"""
    return well_flown(student, case)


@check(points=10, visible=one_of("late"), hidden=other("late"))
def late(student: Student, case: Link) -> Verdict:
    """All pages take 0.3 s: that is late, but not too late"""
    return well_flown(student, case)


@check(points=18, visible=one_of("cut"), hidden=other("cut", "cut"))
def cut(student: Student, case: Link) -> Verdict:
    """The link is cut for two seconds: neutral within half a second, and on with the first command that is fresh"""
    return well_flown(student, case)


@check(points=14, visible=one_of("narrow"), hidden=other("narrow"))
def narrow(student: Student, case: Link) -> Verdict:
    """The link is too narrow, so pages come later and later: no old command is obeyed"""
    return well_flown(student, case)


@check(points=10, visible=one_of("gone"), hidden=other("gone"))
def gone(student: Student, case: Link) -> Verdict:
    """The surface falls silent for ever: neutral within half a second, and from then on"""
    return well_flown(student, case)


@check(points=16, visible=one_of("cut"), hidden=other("late", "cut", "gone", "narrow"))
def watches(student: Student, case: Link) -> Verdict:
    """The surface says what it knows of the vehicle: page "alarm" is ok, old or lost, twenty times a second"""
    flown = student.fly("urov_bad_link", case.seed, "two_nodes.py")
    alarms = pages_at(flown, "topside", "alarm")
    wanted = len(pages_at(flown, "topside", "sticks"))
    if len(alarms) < wanted - 1:
        return failed("One page 'alarm' for each page 'sticks'.", f"{wanted} pages", f"{len(alarms)} pages")
    links, heard = pages_at(flown, "topside", "link_tether"), pages_at(flown, "topside", "vehicle")
    for now_s, page in alarms:
        found = field_of(page.data, "alarm", "state", str)
        right = {_alarm(links, heard, now_s, margin_s) for margin_s in (-ROUNDING_S, ROUNDING_S)}
        if found not in right:
            return failed(ALARMS[sorted(right)[0]], f"{' or '.join(sorted(right))} at {now_s:.2f} s", str(found))
    return passed()


ALARMS = {
    "lost": "'lost' as soon as the page 'link_tether' says that the link is not up, or while there is no such page.",
    "old": "'old' while the link is up and the newest page 'vehicle' was made more than 0.5 s ago, or there is none.",
    "ok": "'ok' while the link is up and the newest page 'vehicle' was made at most 0.5 s ago.",
}


def _alarm(
    links: Sequence[tuple[float, Page]], heard: Sequence[tuple[float, Page]], now_s: float, margin_s: float
) -> str:
    """Returns the right state; what comes or ages just now may count or not, by the margin."""
    link = next((page.data for t, page in reversed(links) if t <= now_s + margin_s), None)
    if link is None or not link["up"]:
        return "lost"
    page = next((page for t, page in reversed(heard) if t <= now_s + margin_s), None)
    return "ok" if page is not None and now_s - page.created_at_s <= OLD_S - margin_s else "old"


lab = Lab(
    "Two nodes",
    files=["two_nodes.py", "vehicle.py", "topside.py"],
    checks=[vehicle_alone, surface_alone, lost_and_overtaken, late, cut, narrow, gone, watches],
)
