"""A vehicle with two driven wheels and a caster, seen from above, in a room with people.

    command --> write --> wheels (lag) --> traction.py --> speeds --> ground_vehicle.py: contacts, pose

Speeds of wheels are means over the step, of a lag of first order exactly, so on a floor without walls the way is exact,
but for the chord that stands for a small arc: a share of (turning * step)^2 / 24.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from snr_sim.plants.ground.explorer import DriveStart, Explorer
from snr_sim.plants.ground.ground_shapes import explorer_shapes, person_shapes, room_shapes
from snr_sim.plants.ground.ground_vehicle import STEP_S, GroundVehicle
from snr_sim.plants.ground.room import Point, Room, cells_along
from snr_sim.plants.ground.traction import Traction
from snr_sim.prelude.errors import UnknownNameError, suggest
from snr_sim.prelude.signals import EchoReading, MotorCommand, TouchReading, WheelReading

PERCENT = 100.0
ECHO_RAYS = 9  # over the cone
LOOK_S = 0.2  # how often the floor in view is noted
MANNERS_M = 0.3  # people stop at this distance from a robot that is in front of them


class DriveState(NamedTuple):
    """Full state. Defaults: a start."""

    position_m: Point
    heading_rad: float
    speeds: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the centre of mass, world frame, and of turning
    treads_mps: tuple[float, float] = (0.0, 0.0)  # of the wheels, left and right
    wheels_rad: tuple[float, float] = (0.0, 0.0)  # how far they have turned
    goals_mps: tuple[float, float] = (0.0, 0.0)
    people_m: tuple[float, ...] = ()  # how far each has walked, there and back
    seen: frozenset[tuple[int, int]] = frozenset()  # squares of the floor
    hit_mps: float = 0.0
    way_m: float = 0.0
    steps: int = 0


class DiffDrive2D(GroundVehicle[DriveState]):
    """The vehicle. Implements `Plant`; see `GroundVehicle`. `seed` is that of the first run."""

    inputs: tuple[str, ...] = ("motors",)
    outputs: tuple[str, ...] = ("range", "touch", "wheels")

    def __init__(
        self,
        explorer: Explorer,
        start_of: Callable[[int], tuple[DriveStart, Room]],
        seed: int = 0,
        step_s: float = STEP_S,
    ) -> None:
        self.explorer: Explorer = explorer
        self._traction = Traction(explorer, step_s)
        spread = explorer.echo_half_angle_rad
        self._ray_angles = [spread * (2.0 * i / (ECHO_RAYS - 1) - 1.0) for i in range(ECHO_RAYS)]
        self._look_steps = max(1, round(LOOK_S / step_s))
        self._reach_m = 0.5 * math.hypot(*explorer.size_m)
        super().__init__(explorer, start_of, step_s)
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Put the vehicle at the start that belongs to this seed, at rest."""
        start, room = self._start(seed, DriveStart, Room)
        state = DriveState(tuple(start.position_m), start.heading_rad, people_m=(0.0,) * len(room.walkers))
        self._begin(seed, room, state, self.explorer.bar_m)
        self._look()

    treads_mps: tuple[float, float]
    wheels_rad: tuple[float, float]
    people_m: tuple[float, ...]
    seen: frozenset[tuple[int, int]]

    @property
    def seen_share(self) -> float:
        """Share of the floor that has been in view of the ultrasonic sensor, nearer than its echo."""
        return len(self.seen) / len(self.room.floor_cells)

    def write(self, name: str, command: MotorCommand) -> None:
        """Set the speeds of both motors, clamped to full speed."""
        self._check_command(name, command, command.a, command.d)
        per_percent = self.explorer.full_speed_mps / PERCENT
        self._set_goals(per_percent * command.a, per_percent * command.d)

    def step(self, dt_s: float) -> None:
        """Advance by one step."""
        self._count_step(dt_s)
        speeds = self._traction.drive(self.heading_rad, self.speeds, *self._turn_wheels())
        if self.people_m:
            self._walk()
        self._move(speeds)
        if self.steps % self._look_steps == 0:
            self._look()

    def _turn_wheels(self) -> tuple[float, float]:
        """Let the wheels follow their commands for a step; return their mean speeds in it."""
        self.treads_mps, means = self._lag.advance(self.treads_mps, self.goals_mps)
        per_step = self.step_s / self.explorer.wheel_radius_m
        left_rad, right_rad = self.wheels_rad
        self.wheels_rad = left_rad + per_step * means[0], right_rad + per_step * means[1]
        return means

    def _walk(self) -> None:
        """Let people walk for a step, but for those who have the vehicle in front of them."""
        x, y = self.position_m
        moved = []
        for along_m, walker in zip(self.people_m, self.room.walkers, strict=True):
            at_x, at_y = walker.place_m(along_m)
            next_m = (along_m + self.step_s * walker.speed_mps) % (2.0 * walker.way_m)
            to_x, to_y = walker.place_m(next_m)
            is_near = math.dist((x, y), (at_x, at_y)) < self._reach_m + walker.radius_m + MANNERS_M
            is_ahead = (x - at_x) * (to_x - at_x) + (y - at_y) * (to_y - at_y) > 0.0
            moved.append(along_m if is_near and is_ahead else next_m)
        self.people_m = tuple(moved)

    def _place(self) -> None:
        super()._place()
        if self.people_m:
            walked = zip(self.people_m, self.room.walkers, strict=True)
            self._space.put_people([walker.place_m(along_m) for along_m, walker in walked])

    def read(self, name: str) -> EchoReading | TouchReading | WheelReading:
        """Return the reading of a sensor without errors."""
        if name == "range":
            self._place()
            distance = min(self._echoes(), default=None)
            if distance is None:
                return EchoReading(self.explorer.echo_range_m, 0.0, self.time_s)
            return EchoReading(distance, 1.0, self.time_s)
        if name == "touch":
            if self._contacts.is_clear:
                return TouchReading(False, False, self.time_s)
            self._place()
            left, right = self._space.pressed_bars()
            return TouchReading(left, right, self.time_s)
        if name == "wheels":
            return WheelReading(list(self.wheels_rad), self.time_s)
        raise UnknownNameError(f"This plant has no output '{name}'.", fix=suggest(name, self.outputs))

    def _rays(self) -> list[tuple[Point, Point, Point]]:
        """Return origin, direction and end of the rays of the ultrasonic sensor."""
        (x, y), heading = self.position_m, self.heading_rad
        front, reach = 0.5 * self.explorer.size_m[0], self.explorer.echo_range_m
        origin = x + front * math.cos(heading), y + front * math.sin(heading)
        rays = []
        for angle in self._ray_angles:
            cos, sin = math.cos(heading + angle), math.sin(heading + angle)
            rays.append((origin, (cos, sin), (origin[0] + reach * cos, origin[1] + reach * sin)))
        return rays

    def _echoes(self) -> list[float]:
        """Return the distances of the rays that hit something [m]."""
        hits = (self._space.plane.distance_m(origin, end) for origin, _, end in self._rays())
        return [hit for hit in hits if hit is not None]

    def _look(self) -> None:
        """Note the floor in view, up to the nearest echo."""
        self._place()
        reach = min(self._echoes(), default=self.explorer.echo_range_m)
        new = set[tuple[int, int]]().union(*(cells_along(origin, along, reach) for origin, along, _ in self._rays()))
        new &= self.room.floor_cells
        if not new <= self.seen:
            self.seen |= new

    def scene(self) -> dict[str, Any]:
        """Return the room of this run, and the shapes of the vehicle and of people."""
        people = {f"person_{i}": person_shapes(one.radius_m) for i, one in enumerate(self.room.walkers)}
        return {"statics": room_shapes(self.room), "bodies": {"explorer": explorer_shapes(self.explorer), **people}}

    def truth(self) -> dict[str, Any]:
        """Return the true state for the recorder."""
        (x, y), (vx, vy, turn) = self.position_m, self.speeds
        half = 0.5 * self.heading_rad
        poses = {"explorer": [x, y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half)]}
        for i, (along_m, walker) in enumerate(zip(self.people_m, self.room.walkers, strict=True)):
            poses[f"person_{i}"] = [*walker.place_m(along_m), 0.0, 0.0, 0.0, 0.0, 1.0]
        values = {
            "speed_mps": math.cos(self.heading_rad) * vx + math.sin(self.heading_rad) * vy,
            "turn_radps": turn,
            "hit_mps": self.hit_mps,
            "way_m": self.way_m,
            "seen_percent": PERCENT * self.seen_share,
        }
        return {"poses": poses, "vectors": {}, "values": values}
