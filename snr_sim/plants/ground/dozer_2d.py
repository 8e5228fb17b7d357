"""A tracked vehicle with a blade, seen from above, in a yard with a heap of stones and a pit.

    command --> write --> tracks (drive_lag.py) --> tracks.py --> speeds --> pose
                `-----> blade ---------------------> soil.py -----^ force     wall_contacts.py

A step is a kick, then a drift: tracks, soil and walls change the speeds, then the body moves with them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from snr_sim.plants.ground.dozer import Dozer, Heap
from snr_sim.plants.ground.drive_lag import DriveLag
from snr_sim.plants.ground.explorer import DriveStart
from snr_sim.plants.ground.ground_shapes import dozer_shapes, pit_shapes, room_shapes, stone_shapes
from snr_sim.plants.ground.room import Point, Room
from snr_sim.plants.ground.room_space import RoomSpace
from snr_sim.plants.ground.soil import Push, Soil
from snr_sim.plants.ground.tracks import Tracks
from snr_sim.plants.ground.wall_contacts import WallContacts
from snr_sim.plants.parameter_limits import LIMITS, check_number, check_valid
from snr_sim.plants.pymunk_engine import pymunk_module
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownNameError, suggest
from snr_sim.prelude.signals import Ball, DozerCommand, PoseReading, ViewReading

STEP_S = 0.005
SOIL_STEPS = 4  # stones are moved in every fourth step: by 6 mm at full speed, a fifth of a stone's radius
PIT_M = 0.2  # depth of the pit, in pictures
BLADE_DOWN = 0.9  # of the way down: from here on it moves stones


class DozerState(NamedTuple):
    """Full state. Defaults: a start."""

    position_m: Point
    heading_rad: float
    stones_m: tuple[Point, ...]
    speeds: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the centre of mass, world frame, and of turning
    tracks_mps: tuple[float, float] = (0.0, 0.0)  # left and right
    goals_mps: tuple[float, float] = (0.0, 0.0)
    blade: float = 0.0  # 0 up, 1 down
    blade_goal: float = 0.0
    push: Push = Push()
    hit_mps: float = 0.0
    way_m: float = 0.0
    steps: int = 0


class Dozer2D:
    """The vehicle and the soil. Implements `Plant`.

    Args:
        dozer: its numbers.
        start_of: returns the start, the yard and the heap of a seed.
        seed: of the first run.
        step_s: of integration.

    Raises:
        ParameterError: a number is out of range, or a start is not on the floor or touches something.

    Attributes:
        hit_mps: the largest speed at which it met a wall or furniture: of the parts that met, not of the centre.
        way_m: how far its centre has moved.
    """

    inputs: tuple[str, ...] = ("dozer",)
    outputs: tuple[str, ...] = ("pose", "view")

    def __init__(
        self,
        dozer: Dozer,
        start_of: Callable[[int], tuple[DriveStart, Room, Heap]],
        seed: int = 0,
        step_s: float = STEP_S,
    ) -> None:
        check_number("The dozer's step_s", step_s, LIMITS["flight_step_s"])
        self.dozer: Dozer = dozer
        self.start_of: Callable[[int], tuple[DriveStart, Room, Heap]] = start_of
        self.step_s: float = step_s
        self.engine: str = f"pymunk {pymunk_module().version}"
        self._lag = DriveLag(dozer.lag_s, step_s)
        self._tracks = Tracks(dozer, step_s)
        fastest_mps = 2.0 * dozer.full_speed_mps
        self._contacts = WallContacts(dozer.mass_kg, dozer.inertia_kgm2, dozer.wall_friction, fastest_mps, step_s)
        self._blade_step = step_s / dozer.blade_s if dozer.blade_s > 0.0 else 1.0
        self.room: Room
        self.heap: Heap
        self.reset(seed)

    # -- start, and being put back ------------------------------------------------------------------------------------

    def reset(self, seed: int) -> None:
        """Put the vehicle and the stones where this seed has them, at rest."""
        given = self.start_of(seed)
        is_start = isinstance(given, tuple) and tuple(map(type, given)) == (DriveStart, Room, Heap)
        check_valid(is_start, f"The start of seed {seed}", given, "return a DriveStart, a Room and a Heap.")
        start, self.room, self.heap = given
        if self.room.walkers:
            raise ParameterError(f"The yard of seed {seed} has people in it.", fix="leave out its walkers.")
        self._space = RoomSpace(self.room, self.dozer.size_m)
        self._soil = Soil(self.heap, self.dozer.size_m[1])
        x, y = start.position_m
        self.restore(DozerState((x, y), start.heading_rad, tuple((float(a), float(b)) for a, b in self.heap.places_m)))
        self._space.put_body(x, y, self.heading_rad)
        if not self.room.is_floor(x, y) or self._space.contacts():
            raise ParameterError(
                f"The start of seed {seed} is at ({x:g}, {y:g}) m, where the dozer has no room.",
                fix="start it farther from walls and furniture.",
            )

    def snapshot(self) -> DozerState:
        """Return the full state; the returned object is immutable."""
        return DozerState(**{name: getattr(self, name) for name in DozerState._fields})

    def restore(self, snapshot: DozerState) -> None:
        """Put back what `snapshot` returned, in the yard of the last reset."""
        for name, value in zip(DozerState._fields, snapshot, strict=True):
            setattr(self, name, value)
        self._contacts.restart()

    position_m: Point
    heading_rad: float
    stones_m: tuple[Point, ...]
    speeds: tuple[float, float, float]
    tracks_mps: tuple[float, float]
    goals_mps: tuple[float, float]
    blade: float
    blade_goal: float
    push: Push
    hit_mps: float
    way_m: float
    steps: int

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset: a count, so that nothing adds up."""
        return self.steps * self.step_s

    @property
    def cleared_share(self) -> float:
        """Share of the stones that are in the pit."""
        return sum(map(self._soil.is_in_pit, self.stones_m)) / len(self.stones_m)  # exact: integers

    # -- moving -------------------------------------------------------------------------------------------------------

    def write(self, name: str, command: DozerCommand) -> None:
        """Set the speeds of both tracks, clamped to full speed, and the goal of the blade."""
        if name != "dozer":
            raise UnknownNameError(f"This plant has no input '{name}'.", fix=suggest(name, self.inputs))
        if not math.isfinite(command.left_mps + command.right_mps + command.blade):
            raise PlantError(
                f"At {self.time_s:g} s the command of the dozer is not finite: {command}.", fix="send finite numbers."
            )
        full = self.dozer.full_speed_mps
        left, right = (min(full, max(-full, one)) for one in (command.left_mps, command.right_mps))
        self.goals_mps = left, right
        self.blade_goal = min(1.0, max(0.0, command.blade))

    def step(self, dt_s: float) -> None:
        """Advance by one step."""
        step_s = self.step_s
        if dt_s != step_s and not abs(dt_s - step_s) <= 1e-9:  # also NaN
            raise ParameterError(f"This plant moves in steps of {step_s} s, not {dt_s} s.", fix="use plant.step_s.")
        self.steps += 1
        self.tracks_mps, (left, right) = self._lag.advance(self.tracks_mps, self.goals_mps)
        if self.blade != self.blade_goal:
            largest = self._blade_step
            self.blade += min(largest, max(-largest, self.blade_goal - self.blade))
        x, y = self.position_m
        heading = self.heading_rad
        if self.steps % SOIL_STEPS == 0:
            self.push = self._push()
        middle = heading + 0.5 * step_s * self.speeds[2]
        speeds = self._tracks.drive(middle, self.speeds, left, right, *self.push)
        if self._contacts.is_due():
            if not all(map(math.isfinite, (x, y, heading, *speeds))):
                raise PlantError(
                    f"At {self.time_s:g} s the state is no longer finite.", fix="look at the last commands."
                )
            self._space.put_body(x, y, heading)
            speeds, hit_mps = self._contacts.resolve(self._space, speeds)
            self.hit_mps = max(self.hit_mps, hit_mps)
        vx, vy, turn = self.speeds = speeds
        self.position_m = x + step_s * vx, y + step_s * vy
        self.heading_rad = heading + step_s * turn
        self.way_m += step_s * math.sqrt(vx * vx + vy * vy)

    def _push(self) -> Push:
        """Move the stones that are in the way of the lowered blade; return what it feels."""
        if self.blade < BLADE_DOWN:
            return Push()
        (x, y), cos, sin = self.position_m, math.cos(self.heading_rad), math.sin(self.heading_rad)
        front = 0.5 * self.dozer.size_m[0]
        self.stones_m, push = self._soil.push(self.stones_m, (x + front * cos, y + front * sin), self.heading_rad)
        return push

    # -- being measured -----------------------------------------------------------------------------------------------

    def read(self, name: str) -> PoseReading | ViewReading:
        """Return the reading of a sensor without errors; "view" is what cameras need, and no sensor of its own."""
        x, y = self.position_m
        if name == "pose":
            return PoseReading([x, y], self.heading_rad, self.time_s)
        if name == "view":
            half = 0.5 * self.heading_rad
            balls = [
                Ball(place, self.heap.radius_m, rgb)
                for place, rgb in zip(self._stone_places(), self.heap.rgbs, strict=True)
                if place[2] > 0.0
            ]
            return ViewReading([x, y, 0.0], [math.cos(half), 0.0, 0.0, math.sin(half)], balls, self.time_s)
        raise UnknownNameError(f"This plant has no output '{name}'.", fix=suggest(name, self.outputs))

    def _stone_places(self) -> list[tuple[float, float, float]]:
        """Return x, y and z of the middle of each stone; those in the pit lie lower."""
        radius = self.heap.radius_m
        return [(x, y, radius - PIT_M if self._soil.is_in_pit((x, y)) else radius) for x, y in self.stones_m]

    # -- being shown --------------------------------------------------------------------------------------------------

    def scene(self) -> dict[str, Any]:
        """Return the yard of this run, and the shapes of the vehicle and the stones."""
        stones = {f"stone_{i}": stone_shapes(self.heap.radius_m, rgb) for i, rgb in enumerate(self.heap.rgbs)}
        return {
            "statics": {**room_shapes(self.room), "pit": pit_shapes(self.room, self.heap.edge_m)},
            "bodies": {"dozer": dozer_shapes(self.dozer), **stones},
        }

    def truth(self) -> dict[str, Any]:
        """Return the true state for the recorder."""
        (x, y), (vx, vy, turn), half = self.position_m, self.speeds, 0.5 * self.heading_rad
        poses = {"dozer": [x, y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half)]}
        for i, place in enumerate(self._stone_places()):
            poses[f"stone_{i}"] = [*place, 0.0, 0.0, 0.0, 1.0]
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        front = 0.5 * self.dozer.size_m[0]
        values = {
            "speed_mps": cos * vx + sin * vy,
            "turn_radps": turn,
            "blade": self.blade,
            "push_n": self.push.force_n,
            "hit_mps": self.hit_mps,
            "way_m": self.way_m,
            "cleared_percent": 100.0 * self.cleared_share,
        }
        force = [
            x + front * cos,
            y + front * sin,
            self.heap.radius_m,
            *(-self.push.force_n * one for one in (cos, sin)),
            0.0,
        ]
        return {"poses": poses, "vectors": {"soil": force}, "values": values}
