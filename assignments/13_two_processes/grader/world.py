"""What Housecat's mono camera sees in a case, and the pages that a controller gets from it, over time."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from types import SimpleNamespace
from typing import Any

from snr_sim.grading import Stimulus
from snr_sim.scenario import Request, RobotInfo, prepare
from snr_sim.signals import Ball

ROBOT = "snr_sim_robot_housecat"
TICK_S, PICTURE_TICKS = 0.05, 4  # five images a second
STONE_M = 0.03
GROUP_M = 0.12  # the nearest stones: not so much farther than the nearest one
PLACE = (-1.0, 0.0, 0.0)  # x, y and heading of a vehicle that stands


@cache
def housecat() -> SimpleNamespace:
    """Return what the cases need of the robot: its camera, its states, and what is in its yard."""
    simulation = prepare(Request("housecat_clear"))  # loads the robot's modules
    parameters, states = (import_module(f"{ROBOT}.{name}") for name in ("parameters", "states"))
    return SimpleNamespace(mono=parameters.MONO, STATES=states.STATES, statics=simulation.plant().scene()["statics"])


def robot_info() -> RobotInfo:
    """Return the argument of `factories`; of the modules that are loaded now, as a run loads them again."""
    housecat()
    parameters = import_module(f"{ROBOT}.parameters").HousecatParameters()
    return RobotInfo("housecat", "housecat", "housecat_clear", "pymunk", parameters, {})


@dataclass(frozen=True)
class Picture:
    """An image, and between which bearings the nearest stones are; None if it shows none."""

    rgb: Any
    nearest_rad: tuple[float, float] | None


def picture(place: tuple[float, float, float], stones: Sequence[Ball] = ()) -> Picture:
    """Return what the camera of a vehicle at x, y and heading sees."""
    x, y, heading = place
    mono = housecat().mono
    attitude = [math.cos(0.5 * heading), 0.0, 0.0, math.sin(0.5 * heading)]
    rgb = mono.picture(housecat().statics, [x, y, 0.0], attitude, balls=stones)
    seen = sorted(_polar(place, stone) for stone in stones)
    near = [bearing for distance_m, bearing in seen if distance_m <= seen[0][0] + GROUP_M]
    return Picture(rgb, (min(near), max(near)) if near else None)


def _polar(place: tuple[float, float, float], stone: Ball) -> tuple[float, float]:
    """Return distance and bearing of a stone from the camera."""
    x, y, heading = place
    ahead = housecat().mono.mount_position_m[0]
    dx, dy = stone.center_m[0] - x - ahead * math.cos(heading), stone.center_m[1] - y - ahead * math.sin(heading)
    bearing = math.atan2(dy, dx) - heading
    return math.hypot(dx, dy), math.atan2(math.sin(bearing), math.cos(bearing))


def group(rng: random.Random, x: float, y: float, count: int = 9) -> list[Ball]:
    """Return some stones around a point, of many browns."""
    made = []
    for _ in range(count):
        bright, angle, away_m = rng.uniform(0.7, 1.6), rng.uniform(-math.pi, math.pi), rng.uniform(0.0, 0.09)
        rgb = (int(150 * bright), int(105 * bright), int(60 * bright))
        made.append(Ball((x + away_m * math.cos(angle), y + away_m * math.sin(angle), STONE_M), STONE_M, rgb))
    return made


def yard_pictures(kind: str, seed: int, count: int) -> list[Picture]:
    """Return images from places in the yard.

    Args:
        kind: "one group" of stones; "two groups", of which the farther one is larger; "some without" any stones.
        seed: of the places.
        count: of the images.
    """
    rng = random.Random(seed)
    found: list[Picture] = []
    while len(found) < count:
        place = rng.uniform(-1.8, -0.6), rng.uniform(-0.7, 0.7), rng.uniform(-0.6, 0.6)
        if kind == "some without" and len(found) % 2 == 0:
            found.append(picture(place))
            continue
        side = rng.choice((-1.0, 1.0))
        bearing, distance_m = side * rng.uniform(0.15, 0.45), rng.uniform(0.7, 1.3)
        stones = _group_at(rng, place, bearing, distance_m)
        if kind == "two groups":
            stones += _group_at(rng, place, -side * rng.uniform(0.1, 0.4), distance_m + 0.8, 40)
        if all(-2.0 < x < 1.1 and abs(y) < 1.6 for x, y, _ in (one.center_m for one in stones)):
            found.append(picture(place, stones))
    return found


def _group_at(
    rng: random.Random, place: tuple[float, float, float], bearing: float, distance_m: float, count: int = 9
) -> list[Ball]:
    """Return stones in a direction from the camera."""
    x, y, heading = place
    ahead = housecat().mono.mount_position_m[0]
    x += ahead * math.cos(heading) + distance_m * math.cos(heading + bearing)
    y += ahead * math.sin(heading) + distance_m * math.sin(heading + bearing)
    return group(rng, x, y, count)


@cache
def standing_pictures(seed: int) -> tuple[Picture, Picture]:
    """Return what a vehicle that stands sees without stones and with some."""
    rng = random.Random(seed)
    return picture(PLACE), picture(PLACE, group(rng, rng.uniform(0.2, 0.6), rng.uniform(-0.3, 0.3)))


@dataclass(frozen=True)
class ExpectedState:
    """A state that the reference machine must be in during a time, and the hint for any other."""

    from_s: float
    until_s: float
    state: str
    hint: str


class Timeline:
    """Pages and events that reach the controller, over time, and the states that are right.

    Args:
        seed: of the stones, and of the moment of the first image.
    """

    def __init__(self, seed: int) -> None:
        self.empty, self.stones = standing_pictures(seed)
        self.pages: list[Stimulus] = []
        self.expected: list[ExpectedState] = []
        self.ticks = 0
        self.offset = seed % PICTURE_TICKS
        self.state = "search"
        self.shows = False

    @property
    def now_s(self) -> float:
        """The time of the next pages."""
        return self.ticks * TICK_S

    def be(
        self,
        state: str,
        seconds: float,
        hint: str,
        *,
        shows: bool | None = None,
        event: str = "",
        slack_s: float = 0.15,
    ) -> Timeline:
        """Advance the time; the reference machine must be in a state, or at first still in the one before.

        Args:
            state: the one that is right.
            seconds: for how long.
            hint: for any other.
            shows: whether images show stones from now on; as before if not given.
            event: that another process sends now.
            slack_s: how long it may be in the state before; three calls of a control process.
        """
        self.shows = self.shows if shows is None else shows
        from_s = self.now_s + (slack_s if state != self.state else 0.0)
        if event:
            self.send(event)
        for _ in range(round(seconds / TICK_S)):
            self.tick()
        self.expected.append(ExpectedState(from_s, self.now_s, state, hint))
        self.state = state
        return self

    def send(self, event: str) -> None:
        """Add an event of another process."""
        self.pages.append(Stimulus(self.now_s, task=("event", event, [])))

    def go_past_picture(self) -> None:
        """Advance the time to just after an image."""
        while (self.ticks + self.offset) % PICTURE_TICKS != 1:
            self.tick()

    def tick(self) -> None:
        """Add the pages of one moment."""
        now_s = self.now_s
        pose = {"position_m": list(PLACE[:2]), "heading_rad": PLACE[2], "stamp_s": now_s}
        self.pages.append(Stimulus(now_s, "pose", pose))
        if (self.ticks + self.offset) % PICTURE_TICKS == 0:
            self.pages.append(mono_page(now_s, (self.stones if self.shows else self.empty).rgb))
        self.ticks += 1


def mono_page(now_s: float, rgb: Any) -> Stimulus:
    """Return the page of an image."""
    return Stimulus(
        now_s, "mono", {"rgb": rgb, "field_of_view_rad": housecat().mono.field_of_view_rad, "stamp_s": now_s}
    )
