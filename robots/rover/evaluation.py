"""Judge of a drive: the record of where the rover truly was, and conclusions from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

from snr_sim.plants import Rover, Rover2D

Body = Rover if TYPE_CHECKING else object

SAMPLE_S = 0.1
TIPPED_RAD = math.radians(60.0)
RING_SIDES, RING_M, RING_UP_M, RING_RGB = 24, 0.05, 0.3, [235, 196, 80]


class Sample(NamedTuple):
    """The true state at a moment."""

    time_s: float
    position_m: tuple[float, float, float]
    speed_mps: float
    tilt_rad: float  # of the chassis, from upright


class Mark(NamedTuple):
    """A place to reach, and how near."""

    x_m: float
    y_m: float
    radius_m: float


class Tracked(Body):
    """A rover whose course is recorded; which rover is the other base of a subclass."""

    course: list[Sample]
    sample_s: float = SAMPLE_S  # between two samples
    marks: Sequence[Mark] = ()  # shown on the ground

    def scene(self) -> dict[str, Any]:
        """Return the rover's scene with the marks."""
        scene = super().scene()
        scene["statics"].update((f"mark_{i + 1}", self._ring(mark)) for i, mark in enumerate(self.marks))
        return scene

    def _ring(self, mark: Mark) -> dict[str, Any]:
        around = [2.0 * math.pi * i / RING_SIDES for i in range(RING_SIDES + 1)]
        places = [(mark.x_m + mark.radius_m * math.cos(a), mark.y_m + mark.radius_m * math.sin(a)) for a in around]
        points = [[x, y, self.ground.at(x, y)[0] + RING_UP_M] for x, y in places]
        return {"kind": "polyline", "points_m": points, "radius_m": RING_M, "rgb": RING_RGB}

    def reset(self, seed: int) -> None:
        """Reset, with an empty course."""
        self.course = []
        super().reset(seed)

    def step(self, dt_s: float) -> None:
        """Advance, and record a sample when it is due."""
        super().step(dt_s)
        if self.time_s >= len(self.course) * self.sample_s - 1e-9:
            pose = self.read("pose")
            x, y, z = pose.position_m
            _, qx, qy, _ = pose.attitude
            tilt_rad = math.acos(max(-1.0, 1.0 - 2.0 * (qx * qx + qy * qy)))
            self.course.append(Sample(self.time_s, (x, y, z), self.speed_mps, tilt_rad))

    def restore(self, snapshot: Any) -> None:
        """Restore the rover, and drop the samples recorded since."""
        super().restore(snapshot)
        self.course = [sample for sample in self.course if sample.time_s <= self.time_s]

    @property
    def has_tipped_over(self) -> bool:
        """Whether it lay on its side or back."""
        return bool(self.course) and self.course[-1].tilt_rad > TIPPED_RAD


class TrackedRover(Tracked, Rover):
    """In space, under MuJoCo."""


class TrackedRover2D(Tracked, Rover2D):
    """Seen from above, under pymunk."""


BODIES: dict[str, type[Tracked]] = {"mujoco": TrackedRover, "pymunk": TrackedRover2D}  # the first is the default


def way_m(course: list[Sample]) -> float:
    """Return the length of a course over the ground."""
    places = [sample.position_m for sample in course]
    return math.fsum(math.dist(one, other) for one, other in pairwise(places))


def nearest_m(course: Sequence[Sample], points: Sequence[tuple[float, float]], within_m: float) -> list[float]:
    """Return how near a course came to each point, after it had been within a distance of those before."""
    nearest, rest = [], list(course)
    for point in points if course else ():
        gaps = [math.dist(sample.position_m[:2], point) for sample in rest]
        nearest.append(min(gaps))
        rest = rest[next((i for i, gap in enumerate(gaps) if gap <= within_m), 0) :]
    return nearest
