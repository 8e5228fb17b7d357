"""Where the rover is on the map, and how it drives along a route of way points.

odometry --> move --.
fixes ------> fix --+--> Place: position and heading --> RouteFollower --> speed and rate of turning

Odometry is right within a second and drifts over minutes; a receiver's fixes wander within a minute and are right in
the mean. So the place follows odometry, and is drawn to the fixes slowly: a filter of first order for the position, and
one for the error of the compass, learned from the course while the rover drives straight.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from snr_sim.scenario import wrap_rad

POSITION_S = 200.0  # in which fixes pull the position: longer than they wander, shorter than odometry is good for
OFFSET_S = 8.0  # in which courses pull the heading: one is off by some degrees, and iron turns the compass on each leg
STRAIGHT_RADPS, STRAIGHT_MPS = 0.1, 0.5  # a course says where the rover looks only while it drives like this
REACHED_M = 0.3  # of the way to a point
LOOKAHEAD_M = 2.0  # on the line through the next point
SPEED_MPS = 1.2
# Its motors hardly turn it faster while it drives: they would slow it down, and odometry misses how far it then slides.
TURN_RADPS = 0.2
SPIN_FROM_RAD, SPIN_TO_RAD = 0.4, math.radians(5.0)  # further off than this it first turns on the spot
SPIN_RADPS, SPIN_PER_S = 0.6, 1.5  # and for each radian that is missing
STANDS_MPS = 0.05

Point = tuple[float, float]


class Place:
    """Position [m] on the plane of the map and heading [rad], from a known start."""

    def __init__(self, position_m: Point = (0.0, 0.0)) -> None:
        self.position_m = position_m
        self.offset_rad = 0.0  # of the true heading from the compass'
        self._yaw_rad = 0.0
        self._before: tuple[Point, float] | None = None  # position by odometry, and when
        self._turn_radps = self._speed_mps = 0.0

    @property
    def heading_rad(self) -> float:
        """Where the rover looks."""
        return wrap_rad(self._yaw_rad + self.offset_rad)

    def move(self, position_m: Point, yaw_rad: float, speed_mps: float, stamp_s: float) -> None:
        """Take where odometry says the rover is, from where it began to count."""
        before, self._before = self._before, (position_m, stamp_s)
        turn, self._yaw_rad, self._speed_mps = wrap_rad(yaw_rad - self._yaw_rad), yaw_rad, speed_mps
        if before is None or stamp_s <= before[1]:
            return
        self._turn_radps = turn / (stamp_s - before[1])
        dx, dy = position_m[0] - before[0][0], position_m[1] - before[0][1]
        cos, sin = math.cos(self.offset_rad), math.sin(self.offset_rad)
        x, y = self.position_m
        self.position_m = x + cos * dx - sin * dy, y + sin * dx + cos * dy

    def fix(self, position_m: Point, course_rad: float | None, dt_s: float) -> None:
        """Take a fix of a receiver, `dt_s` after the one before; a course of None counts for nothing."""
        share = dt_s / POSITION_S
        x, y = self.position_m
        self.position_m = x + share * (position_m[0] - x), y + share * (position_m[1] - y)
        is_straight = self._speed_mps > STRAIGHT_MPS and abs(self._turn_radps) < STRAIGHT_RADPS
        if course_rad is not None and is_straight:
            self.offset_rad += dt_s / OFFSET_S * wrap_rad(course_rad - self.heading_rad)


class DeadReckoning:
    """Position [m] and heading [rad] from the start, x ahead. The gyroscope's bias is measured while the rover stands.

    Args:
        stands_s: how long it stands first.
    """

    def __init__(self, stands_s: float) -> None:
        self.position_m: Point = (0.0, 0.0)
        self.heading_rad = 0.0
        self._stands_s = stands_s
        self._bias_radps, self._count = 0.0, 0
        self._turned_s: float | None = None
        self._moved_s: float | None = None

    def turn(self, rate_radps: float, stamp_s: float) -> None:
        """Take a rate of turning to the left."""
        before_s, self._turned_s = self._turned_s, stamp_s
        if stamp_s < self._stands_s:
            self._count += 1
            self._bias_radps += (rate_radps - self._bias_radps) / self._count
        elif before_s is not None:
            self.heading_rad = wrap_rad(self.heading_rad + (stamp_s - before_s) * (rate_radps - self._bias_radps))

    def move(self, speed_mps: float, stamp_s: float) -> bool:
        """Take a speed ahead; return whether it has stood for long enough to begin."""
        before_s, self._moved_s = self._moved_s, stamp_s
        if before_s is None or stamp_s < self._stands_s:
            return False
        way_m, (x, y) = (stamp_s - before_s) * speed_mps, self.position_m
        self.position_m = x + way_m * math.cos(self.heading_rad), y + way_m * math.sin(self.heading_rad)
        return True


class Steering:
    """Pure pursuit of a point.

    Source: Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01 (1992).

    Args:
        drives_mps: its speed while it drives.
    """

    def __init__(self, drives_mps: float = SPEED_MPS) -> None:
        self._drives_mps = drives_mps
        self._spins = self._stands = False

    def steer(self, off_rad: float, way_m: float, speed_mps: float) -> tuple[float, float]:
        """Return speed ahead [m/s] and rate of turning to the left [rad/s].

        A rover that still drives is stopped before it turns on the spot: with both sides at the limit of their motors,
        one ahead and one astern, it would roll on for seconds.

        Args:
            off_rad: bearing of the point, to the left.
            way_m: how far it is.
            speed_mps: of the rover.
        """
        self._spins = abs(off_rad) > (SPIN_TO_RAD if self._spins else SPIN_FROM_RAD)
        self._stands = self._spins and (self._stands or abs(speed_mps) < STANDS_MPS)
        if self._spins and not self._stands:
            return 0.0, 0.0
        if self._spins:
            return 0.0, min(SPIN_RADPS, max(-SPIN_RADPS, SPIN_PER_S * off_rad))
        turn = 2.0 * self._drives_mps * math.sin(off_rad) / way_m
        return self._drives_mps, min(TURN_RADPS, max(-TURN_RADPS, turn))


class RouteFollower:
    """Drives to a point that runs ahead on the lines between the points of a route."""

    def __init__(self, route: Sequence[Point], start_m: Point = (0.0, 0.0)) -> None:
        self._points = [start_m, *route]
        self.reached = 0  # points of the route that it has been at
        self._steering = Steering()

    @property
    def has_arrived(self) -> bool:
        """Whether it has been at all of them."""
        return self.reached == len(self._points) - 1

    def left_m(self, position_m: Point) -> float:
        """Return the way along the line to the next point; 0 if there is none."""
        if self.has_arrived:
            return 0.0
        return math.dist(*self._line) - self._along_m(position_m)

    def steer(self, position_m: Point, heading_rad: float, speed_mps: float) -> tuple[float, float]:
        """Return speed ahead [m/s] and rate of turning to the left [rad/s]; (0, 0) at the end."""
        while not self.has_arrived and self.left_m(position_m) < REACHED_M:
            self.reached += 1
        if self.has_arrived:
            return 0.0, 0.0
        x, y = self._target(position_m)
        off = wrap_rad(math.atan2(y - position_m[1], x - position_m[0]) - heading_rad)
        return self._steering.steer(off, math.dist((x, y), position_m), speed_mps)

    @property
    def _line(self) -> tuple[Point, Point]:
        return self._points[self.reached], self._points[self.reached + 1]

    def _along_m(self, position_m: Point) -> float:
        """Return the way along the line, from its beginning."""
        (ax, ay), (bx, by) = self._line
        dx, dy = bx - ax, by - ay
        length_m = math.hypot(dx, dy)
        if length_m == 0.0:
            return 0.0  # the point is the same as the one before, and is reached with it
        return ((position_m[0] - ax) * dx + (position_m[1] - ay) * dy) / length_m

    def _target(self, position_m: Point) -> Point:
        """Return the point to drive to, ahead on the line, which continues beyond the next point of the route."""
        (ax, ay), (bx, by) = self._line
        share = (self._along_m(position_m) + LOOKAHEAD_M) / math.dist((ax, ay), (bx, by))
        return ax + share * (bx - ax), ay + share * (by - ay)
