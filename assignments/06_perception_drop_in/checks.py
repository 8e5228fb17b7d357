"""Checks of the lab "perception drop-in": pictures that are rendered for each case, and runs."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from snr_sim.devices import Camera
from snr_sim.grading import Lab, Stimulus, Student, Verdict, check, failed, passed, require_field
from snr_sim.scenario import RobotInfo, library

HERE = Path(__file__).parent
HOVER = str(HERE / "hover.py")
FILES = ["perception.py", "steer.py"]
FIELDS = {"mode", "right_px", "down_px", "stamp_s"}
MODES = ("track", "stop", "search")
NEAR_PX, SHARE = 5.0, 0.8  # of pictures in which the plate must be found so near
STILL_S, SEARCH_S, BACK = 1.0, 3.0, 2  # lost: until then no search, from then on a search; found: in so many pictures
FLOOR_M = 4.0
PICTURES, PERIOD_S = 12, 0.4
GONE = (4, 16)  # pictures without the plate, of a scene in which it is lost
NOISE = 3  # grey levels either way
PLATE_M = 0.2  # half of its side
SHOWN = 18  # a scene in which the plate is well off the middle both ways, so that a wrong sign shows
YELLOW, HOSE, LEAF, BRICK, FISH = [250, 215, 20], [235, 190, 40], [230, 210, 40], [170, 70, 40], [70, 75, 80]


@dataclass(frozen=True)
class Scene:
    """Some pictures: of what kind, and from which seed."""

    kind: str
    seed: int

    @property
    def label(self) -> str:
        """What reports call it."""
        return f"{self.kind}, seed {self.seed}"


@dataclass(frozen=True)
class Shot:
    """A picture and where in it the plate is; None if it is not there."""

    rgb: Any
    off_px: tuple[float, float] | None


def shots(scene: Scene) -> Iterator[Shot]:
    """Yield the pictures of a scene: the vehicle goes slowly over the floor and turns."""
    rng, noise = random.Random(scene.seed), np.random.default_rng(scene.seed)
    murk = rng.uniform(0.5, 0.9) if scene.kind == "murky" else rng.uniform(0.05, 0.2)
    camera = Camera("down", backscatter_per_m=murk)
    height_m, yaw = rng.uniform(1.4, 2.0), rng.uniform(-math.pi, math.pi)
    reach_m = 0.25 * height_m  # from the middle: the plate stays in the picture as a whole
    direction = rng.uniform(-math.pi, math.pi)
    turn = rng.uniform(-0.1, 0.1)
    statics = {"floor": _floor(), **_things(scene.kind, rng)}
    is_lost = scene.kind.startswith("lost")
    count = GONE[1] + 4 if is_lost else PICTURES
    for i in range(count):
        along_m = reach_m * (2.0 * i / (count - 1) - 1.0)
        x, y = along_m * math.cos(direction), along_m * math.sin(direction)
        is_there = not (is_lost and GONE[0] <= i < GONE[1])
        seen = {**statics, "plate": _box(0.0, 0.0, PLATE_M, PLATE_M, 0.05, YELLOW)} if is_there else statics
        if scene.kind == "covered":
            aside_m = 1.4 * PLATE_M
            seen["fish"] = _box(
                aside_m * math.cos(direction), aside_m * math.sin(direction), PLATE_M, PLATE_M, 0.12, FISH
            )
        here = [x, y, height_m - FLOOR_M]
        angle = yaw + turn * i
        rgb = camera.picture(seen, here, [math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)])
        rgb = np.clip(rgb + noise.integers(-NOISE, NOISE + 1, rgb.shape), 0, 255).astype(np.uint8)
        ahead_m = -(math.cos(angle) * x + math.sin(angle) * y)
        left_m = -(-math.sin(angle) * x + math.cos(angle) * y)
        scale = 1.0 / ((height_m - 0.1) * camera.pixel)
        yield Shot(rgb, (-left_m * scale, -ahead_m * scale) if is_there else None)


def _things(kind: str, rng: random.Random) -> dict[str, Any]:
    """Return what else lies on the floor."""
    if kind not in ("cluttered", "lost among clutter"):
        return {}
    side = rng.choice((-1.0, 1.0)) * rng.uniform(0.46, 0.5)
    slant = rng.uniform(-0.4, 0.4)
    z = -FLOOR_M + 0.03
    points = [[-4.0, side - slant, z], [4.0, side + slant, z]]
    things: dict[str, Any] = {"hose": {"kind": "polyline", "points_m": points, "radius_m": 0.05, "rgb": HOSE}}
    for i in range(3):
        angle, away_m = rng.uniform(-math.pi, math.pi), rng.uniform(0.6, 1.0)  # from the plate
        things[f"leaf_{i}"] = _box(away_m * math.cos(angle), away_m * math.sin(angle), 0.04, 0.03, 0.01, LEAF)
    things["brick"] = _box(0.5, -1.2 * side, 0.12, 0.06, 0.04, BRICK)
    return things


def _floor() -> dict[str, Any]:
    corners = [[x, y, -FLOOR_M] for x, y in ((9.0, 9.0), (-9.0, 9.0), (-9.0, -9.0), (9.0, -9.0))]
    return {"kind": "mesh", "vertices_m": corners, "triangles": [[0, 1, 2], [0, 2, 3]], "rgb": [205, 220, 225]}


def _box(x: float, y: float, dx: float, dy: float, dz: float, rgb: list[int]) -> dict[str, Any]:
    return {"kind": "box", "center_m": [x, y, dz - FLOOR_M], "half_size_m": [dx, dy, dz], "rgb": rgb}


def few(*kinds: str, count: int) -> Callable[[random.Random], list[Scene]]:
    """Return what draws so many hidden scenes of each kind."""
    return lambda rng: [Scene(kind, rng.getrandbits(63)) for kind in kinds for _ in range(count)]


def targets(student: Student, given: Sequence[Shot]) -> list[list[Any]]:
    """Return the pages `target` that answer each picture."""
    pages = [
        Stimulus(
            i * PERIOD_S, "camera", {"rgb": shot.rgb, "field_of_view_rad": math.radians(80.0), "stamp_s": i * PERIOD_S}
        )
        for i, shot in enumerate(given)
    ]
    found: list[list[Any]] = [[] for _ in given]
    for one in student.run_inputs("perception.py", pages, robot=_robot()):
        if one.kind == "store_page" and one.name == "target" and one.after is not None:
            found[one.after].append(one.value)
    return found


def _robot() -> RobotInfo:
    library.load_robot(library.find("robots", "urov"))
    scenario = library.load_scenario(library.find("scenarios", HOVER))
    return RobotInfo("urov", "urov", "hover", "mujoco", scenario.parameters(0), {})


def tracked_position(pages: Sequence[Any]) -> tuple[float, float] | None:
    """Return the position of the plate in a picture's page, right and down; None if its mode is not "track"."""
    if mode_of(pages) != "track" or not is_page(pages[-1]):
        return None
    return float(pages[-1]["right_px"]), float(pages[-1]["down_px"])


def mode_of(pages: Sequence[Any]) -> str:
    """Return the mode in a picture's page."""
    return str(pages[-1].get("mode"))[:50] if pages and isinstance(pages[-1], dict) else "nothing"


def is_page(page: Any) -> bool:
    """Return whether a page has the numbers that it should have."""
    numbers = [page.get(name) for name in ("right_px", "down_px", "stamp_s")] if isinstance(page, dict) else [None]
    return all(type(one) in (int, float) and -1e12 < one < 1e12 for one in numbers)


def _off(a: tuple[float, float], b: tuple[float, float]) -> float:
    return math.hypot(a[0] - b[0], a[1] - b[1])


MISTAKES: list[tuple[str, Callable[[float, float], tuple[float, float]]]] = [
    (
        "right_px and down_px are exchanged: the first index of an array is its row, which counts downwards.",
        lambda r, d: (d, r),
    ),
    ("right_px has the wrong sign: right of the centre is positive.", lambda r, d: (-r, d)),
    ("down_px has the wrong sign: below the centre is positive.", lambda r, d: (r, -d)),
    ("Both have the wrong sign: right of the centre and below it are positive.", lambda r, d: (-r, -d)),
    ("The position is measured from the top left corner, not from the centre.", lambda r, d: (r + 31.5, d + 23.5)),
]
MISSED = {
    "clear": "Print a few pixels of the plate: water absorbs red first. Which colour remains of yellow?",
    "murky": "In murky water all colours approach the water's colour: compare with the rest of the picture, "
    "not with a fixed number.",
    "covered": "A part of the plate is covered: the visible part is smaller, and has another shape.",
    "cluttered": "Other objects are yellow or dark, too: which pixels are connected, and what shape do they form?",
}


def finds(student: Student, case: Scene) -> Verdict:
    """Judge how often, and how nearly, the plate was found in the pictures of a scene."""
    given = list(shots(case))
    true = [shot.off_px for shot in given if shot.off_px is not None]
    seen = [tracked_position(pages) for pages in targets(student, given)]
    errors = [math.inf if one is None else _off(one, off) for one, off in zip(seen, true, strict=True)]
    share = sum(error < NEAR_PX for error in errors) / len(errors)
    if share >= SHARE:
        return passed(metrics={"near_share": share})
    expected = f"within {NEAR_PX:g} px in {SHARE:.0%} of the pictures"
    for hint, turned in MISTAKES:
        off = [_off(one, turned(*right)) for one, right in zip(seen, true, strict=True) if one is not None]
        if len(off) >= SHARE * len(true) and sum(error < NEAR_PX for error in off) >= SHARE * len(off):
            return failed(hint, expected, f"{share:.0%}")
    missed = sum(one is None for one in seen)
    actual = f"{share:.0%}; not found in {missed} of {len(seen)}"
    return failed(MISSED[case.kind], expected, actual)


@check(points=10)
def unchanged(student: Student) -> Verdict:
    """The controller steer.py is as it was."""
    was = (HERE / "starter" / "steer.py").read_text().split()
    if student.source("steer.py").split() == was:
        return passed()
    return failed(
        "steer.py differs from the starter's. Restore it: only the source of the page `target` may change.",
        expected="the starter's steer.py",
        actual="another one",
    )


@check(points=10)
def answers(student: Student) -> Verdict:
    """Answers each picture with one page `target` in the right form."""
    given = list(shots(Scene("clear", 1)))
    for i, pages in enumerate(targets(student, given)):
        if len(pages) != 1:
            return failed(
                "Store one page `target` for each picture, whether the plate is in it or not.",
                expected="1 page",
                actual=f"{len(pages)} after picture {i + 1}",
            )
        page = pages[0]
        for name in sorted(FIELDS - {"mode"}):
            require_field(page, "target", name, float)
        mode = require_field(page, "target", "mode", str)
        if set(page) != FIELDS:
            hint = "The page `target` has fields that the README does not list."
            return failed(hint, expected=", ".join(sorted(FIELDS)), actual=str(page)[:200])
        if mode not in MODES:
            return failed("'mode' is not valid.", expected=", ".join(MODES), actual=mode_of(pages))
        if abs(page["stamp_s"] - i * PERIOD_S) > 1e-6:
            hint = "stamp_s must be the stamp_s of the page `camera`."
            return failed(hint, f"{i * PERIOD_S:g}", f"{page['stamp_s']:g}")
    return passed()


@check(points=15, visible=[Scene("clear", SHOWN)], hidden=few("clear", count=2), needs=["answers"])
def clear(student: Student, case: Scene) -> Verdict:
    """Finds the plate in clear water."""
    return finds(student, case)


@check(points=15, visible=[Scene("murky", SHOWN)], hidden=few("murky", count=2), needs=["answers"])
def murky(student: Student, case: Scene) -> Verdict:
    """Finds the plate in murky water."""
    return finds(student, case)


@check(points=10, visible=[Scene("covered", SHOWN)], hidden=few("covered", count=2), needs=["answers"])
def covered(student: Student, case: Scene) -> Verdict:
    """Finds the plate where a part of it is covered."""
    return finds(student, case)


@check(points=15, visible=[Scene("cluttered", SHOWN)], hidden=few("cluttered", count=2), needs=["answers"])
def cluttered(student: Student, case: Scene) -> Verdict:
    """Finds the plate among other things."""
    return finds(student, case)


@check(
    points=15,
    visible=[Scene("lost", SHOWN), Scene("lost among clutter", SHOWN)],
    hidden=few("lost", "lost among clutter", count=1),
    needs=["answers"],
)
def lost(student: Student, case: Scene) -> Verdict:
    """Without the plate it stops at once, then searches; with it, it tracks again."""
    given = list(shots(case))
    modes = [mode_of(pages) for pages in targets(student, given)]
    first, end = GONE
    if "track" not in modes[:first]:
        return failed("The plate was not found before it left the picture.", "track", modes[first - 1])
    tracked = [i for i in range(first, end) if modes[i] == "track"]
    if tracked:
        after_s = (tracked[-1] - first) * PERIOD_S
        return failed(
            "It still tracks without a plate in the picture: the last position is no longer valid, and the most "
            "yellow pixels may belong to another object.",
            expected="stop, then search",
            actual=f"track, {after_s:.1f} s after the plate left the picture",
        )
    for i in range(first, end):
        gone_s = (i - first) * PERIOD_S
        if gone_s < STILL_S - PERIOD_S and modes[i] != "stop":
            return failed("Stop before searching: the plate may be missing in one picture only.", "stop", modes[i])
        if gone_s >= SEARCH_S and modes[i] != "search":
            return failed(
                "It stops and never searches: after a second or two without the plate it should search.",
                expected=f"search, from {SEARCH_S:g} s on",
                actual=f"{modes[i]}, after {gone_s:.1f} s",
            )
    if "track" not in modes[end : end + BACK]:
        return failed("The plate is visible again, but it is not tracked.", "track", modes[end + BACK - 1])
    return passed()


@check(
    points=10,
    visible=[0],
    hidden=lambda rng: [rng.getrandbits(63) for _ in range(2)],
    needs=["unchanged", "clear", "lost"],
)
def hovers(student: Student, case: int) -> Verdict:
    """Stays above the plate in a current, and through a cloud."""
    run = student.run_scenario(HOVER, seed=case, controller="perception.py")
    share = run.metrics["near_share"]
    expected = "the plate within 15 px of the centre, 80% of the time"
    if run.success:
        return passed(metrics={"flight_share": share})
    return failed(
        "It does not stay above the plate. Run it yourself and read the pages `target`: are they stored, and in time?",
        expected=expected,
        actual=f"{share:.0%}",
    )


lab = Lab(
    "Perception drop-in",
    files=FILES,
    checks=[unchanged, answers, clear, murky, covered, cluttered, lost, hovers],
)
