"""A tracked vehicle with a blade, seen from above, in a yard with a heap of stones and a pit.

command --> write --> tracks (lag) --> tracks.py --> speeds --> ground_vehicle.py: contacts, pose
            `-----> blade ------------> soil.py -----^ force
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from snr_sim.plants.ground.dozer import Dozer, Heap
from snr_sim.plants.ground.explorer import DriveStart
from snr_sim.plants.ground.ground_shapes import dozer_shapes, pit_shapes, room_shapes, stone_shapes
from snr_sim.plants.ground.ground_vehicle import STEP_S, GroundVehicle
from snr_sim.plants.ground.room import Point, Room
from snr_sim.plants.ground.soil import Push, Soil
from snr_sim.plants.ground.tracks import Tracks
from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest
from snr_sim.prelude.signals import Ball, DozerCommand, PoseReading, ViewReading

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


class Dozer2D(GroundVehicle[DozerState]):
    """The vehicle and the soil. Implements `Plant`; see `GroundVehicle`. `seed` is that of the first run."""

    inputs: tuple[str, ...] = ("dozer",)
    outputs: tuple[str, ...] = ("pose", "view")

    def __init__(
        self,
        dozer: Dozer,
        start_of: Callable[[int], tuple[DriveStart, Room, Heap]],
        seed: int = 0,
        step_s: float = STEP_S,
    ) -> None:
        self.dozer: Dozer = dozer
        self._tracks = Tracks(dozer, step_s)
        self._blade_step = step_s / dozer.blade_s if dozer.blade_s > 0.0 else 1.0
        super().__init__(dozer, start_of, step_s)
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Put the vehicle and the stones where this seed has them, at rest."""
        start, room, self.heap = self._start(seed, DriveStart, Room, Heap)
        if room.walkers:
            raise ParameterError(f"The yard of seed {seed} has people in it.", fix="leave out its walkers.")
        self._soil = Soil(self.heap, self.dozer.size_m[1])
        stones = tuple((float(x), float(y)) for x, y in self.heap.places_m)
        self._begin(seed, room, DozerState(tuple(start.position_m), start.heading_rad, stones))

    heap: Heap
    stones_m: tuple[Point, ...]
    tracks_mps: tuple[float, float]
    blade: float
    blade_goal: float
    push: Push

    @property
    def cleared_share(self) -> float:
        """Share of the stones that are in the pit."""
        return self._soil.count_in_pit(self.stones_m) / len(self.stones_m)

    def write(self, name: str, command: DozerCommand) -> None:
        """Set the speeds of both tracks, clamped to full speed, and the goal of the blade."""
        self._check_command(name, command, command.left_mps, command.right_mps, command.blade)
        self._set_goals(command.left_mps, command.right_mps)
        self.blade_goal = min(1.0, max(0.0, command.blade))

    def step(self, dt_s: float) -> None:
        """Advance by one step."""
        self._count_step(dt_s)
        self.tracks_mps, (left, right) = self._lag.advance(self.tracks_mps, self.goals_mps)
        if self.blade != self.blade_goal:
            largest = self._blade_step
            self.blade += min(largest, max(-largest, self.blade_goal - self.blade))
        if self.steps % SOIL_STEPS == 0:
            self.push = self._push()
        middle = self.heading_rad + 0.5 * self.step_s * self.speeds[2]
        self._move(self._tracks.drive(middle, self.speeds, left, right, *self.push))

    def _push(self) -> Push:
        """Move the stones that are in the way of the lowered blade; return what it feels."""
        if self.blade < BLADE_DOWN:
            return Push()
        (x, y), cos, sin = self.position_m, math.cos(self.heading_rad), math.sin(self.heading_rad)
        front = 0.5 * self.dozer.size_m[0]
        self.stones_m, push = self._soil.push(self.stones_m, (x + front * cos, y + front * sin), self.heading_rad)
        return push

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
