"""A vehicle with two driven wheels and a caster, seen from above, in a room with people.

    command --> write --> wheels (lag) --> traction.py --> speeds --> pose
                                             walls --> impulses_2d.py --^       room_space.py: pymunk finds contacts

A step is a kick, then a drift: wheels and walls change the speeds, then the body moves with them. Speeds of wheels are
means over the step, of a lag of first order exactly, so on a floor without walls the way is exact, but for the chord
that stands for a small arc: a share of (turning * step)^2 / 24.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from snr_sim.plants.ground.drive_lag import DriveLag
from snr_sim.plants.ground.explorer import DriveStart, Explorer
from snr_sim.plants.ground.ground_shapes import explorer_shapes, person_shapes, room_shapes
from snr_sim.plants.ground.room import Point, Room, cell_at
from snr_sim.plants.ground.room_space import RoomSpace
from snr_sim.plants.ground.traction import Traction
from snr_sim.plants.ground.wall_contacts import WallContacts
from snr_sim.plants.parameter_limits import LIMITS, check_number, check_valid
from snr_sim.plants.pymunk_engine import pymunk_module
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownNameError, suggest
from snr_sim.prelude.signals import EchoReading, MotorCommand, TouchReading, WheelReading

STEP_S = 0.005
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


class DiffDrive2D:
    """The vehicle. Implements `Plant`.

    Args:
        explorer: its numbers.
        start_of: returns the start and the room of a seed.
        seed: of the first run.
        step_s: of integration.

    Raises:
        ParameterError: a number is out of range, or a start is not on the floor or touches something.

    Attributes:
        hit_mps: the largest speed at which it met something, towards it: of the parts that met, not of the centre.
        way_m: how far its centre has moved.
    """

    inputs: tuple[str, ...] = ("motors",)
    outputs: tuple[str, ...] = ("range", "touch", "wheels")

    def __init__(
        self,
        explorer: Explorer,
        start_of: Callable[[int], tuple[DriveStart, Room]],
        seed: int = 0,
        step_s: float = STEP_S,
    ) -> None:
        check_number("The explorer's step_s", step_s, LIMITS["flight_step_s"])
        self.explorer: Explorer = explorer
        self.start_of: Callable[[int], tuple[DriveStart, Room]] = start_of
        self.step_s: float = step_s
        self.engine: str = f"pymunk {pymunk_module().version}"
        self._lag = DriveLag(explorer.lag_s, step_s)
        self._traction = Traction(explorer, step_s)
        spread = explorer.echo_half_angle_rad
        self._ray_angles = [spread * (2.0 * i / (ECHO_RAYS - 1) - 1.0) for i in range(ECHO_RAYS)]
        self._look_steps = max(1, round(LOOK_S / step_s))
        self._reach_m = 0.5 * math.hypot(*explorer.size_m)
        self.room: Room
        self.reset(seed)

    # -- start, and being put back ------------------------------------------------------------------------------------

    def reset(self, seed: int) -> None:
        """Put the vehicle at the start that belongs to this seed, at rest."""
        given = self.start_of(seed)
        is_start = isinstance(given, tuple) and tuple(map(type, given)) == (DriveStart, Room)
        check_valid(is_start, f"The start of seed {seed}", given, "return a DriveStart and a Room.")
        start, self.room = given
        explorer, walkers = self.explorer, self.room.walkers
        self._space = RoomSpace(self.room, explorer.size_m, explorer.bar_m)
        fastest_mps = 2.0 * explorer.full_speed_mps + max((one.speed_mps for one in walkers), default=0.0)
        self._contacts = WallContacts(
            explorer.mass_kg, explorer.inertia_kgm2, explorer.wall_friction, fastest_mps, self.step_s
        )
        x, y = start.position_m
        self.restore(DriveState((x, y), start.heading_rad, people_m=(0.0,) * len(walkers)))
        self._place_all()
        if not self.room.is_floor(x, y) or self._space.contacts():
            raise ParameterError(
                f"The start of seed {seed} is at ({x:g}, {y:g}) m, where the explorer has no room.",
                fix="start it farther from walls, furniture and people.",
            )
        self._look()

    def snapshot(self) -> DriveState:
        """Return the full state; the returned object is immutable."""
        return DriveState(**{name: getattr(self, name) for name in DriveState._fields})

    def restore(self, snapshot: DriveState) -> None:
        """Put back what `snapshot` returned, in the room of the last reset."""
        for name, value in zip(DriveState._fields, snapshot, strict=True):
            setattr(self, name, value)
        self._contacts.restart()

    position_m: Point
    heading_rad: float
    speeds: tuple[float, float, float]
    treads_mps: tuple[float, float]
    wheels_rad: tuple[float, float]
    goals_mps: tuple[float, float]
    people_m: tuple[float, ...]
    seen: frozenset[tuple[int, int]]
    hit_mps: float
    way_m: float
    steps: int

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset: a count, so that nothing adds up."""
        return self.steps * self.step_s

    @property
    def seen_share(self) -> float:
        """Share of the floor that has been in view of the ultrasonic sensor, nearer than its echo."""
        return len(self.seen) / len(self.room.floor_cells)

    # -- moving -------------------------------------------------------------------------------------------------------

    def write(self, name: str, command: MotorCommand) -> None:
        """Set the speeds of both motors, clamped to full speed."""
        if name != "motors":
            raise UnknownNameError(f"This plant has no input '{name}'.", fix=suggest(name, self.inputs))
        if not math.isfinite(command.a + command.d):
            raise PlantError(
                f"At {self.time_s:g} s the command of the motors is not finite: {command}.", fix="send finite numbers."
            )
        full = self.explorer.full_speed_mps / PERCENT
        left, right = (full * min(PERCENT, max(-PERCENT, one)) for one in (command.a, command.d))
        self.goals_mps = left, right

    def step(self, dt_s: float) -> None:
        """Advance by one step."""
        step_s = self.step_s
        if dt_s != step_s and not abs(dt_s - step_s) <= 1e-9:  # also NaN
            raise ParameterError(f"This plant moves in steps of {step_s} s, not {dt_s} s.", fix="use plant.step_s.")
        self.steps += 1
        left, right = self._turn_wheels()
        speeds = self._traction.drive(self.heading_rad, self.speeds, left, right)
        if self.people_m:
            self._walk()
        if self._contacts.is_due():
            speeds = self._resolve_contacts(speeds)
        vx, vy, turn = self.speeds = speeds
        x, y = self.position_m
        self.position_m = x + step_s * vx, y + step_s * vy
        self.heading_rad += step_s * turn
        self.way_m += step_s * math.sqrt(vx * vx + vy * vy)
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

    def _place_all(self) -> None:
        """Put the body and people in the space of queries where they are."""
        if self.people_m:
            walked = zip(self.people_m, self.room.walkers, strict=True)
            self._space.put_people([walker.place_m(along_m) for along_m, walker in walked])
        self._space.put_body(*self.position_m, self.heading_rad)

    def _resolve_contacts(self, speeds: tuple[float, float, float]) -> tuple[float, float, float]:
        """Return the speeds after contacts with walls, furniture and people."""
        if not all(map(math.isfinite, (*self.position_m, self.heading_rad, *speeds))):
            raise PlantError(f"At {self.time_s:g} s the state is no longer finite.", fix="look at the last commands.")
        self._place_all()
        speeds, hit_mps = self._contacts.resolve(self._space, speeds)
        self.hit_mps = max(self.hit_mps, hit_mps)
        return speeds

    # -- being measured -----------------------------------------------------------------------------------------------

    def read(self, name: str) -> EchoReading | TouchReading | WheelReading:
        """Return the reading of a sensor without errors."""
        if name == "range":
            self._place_all()
            distance = min(self._echoes(), default=None)
            if distance is None:
                return EchoReading(self.explorer.echo_range_m, 0.0, self.time_s)
            return EchoReading(distance, 1.0, self.time_s)
        if name == "touch":
            self._place_all()
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
        hits = (self._space.distance_m(origin, end) for origin, _, end in self._rays())
        return [hit for hit in hits if hit is not None]

    def _look(self) -> None:
        """Note the floor in view, up to the nearest echo."""
        self._place_all()
        reach = min(self._echoes(), default=self.explorer.echo_range_m)
        new = set()
        for (x, y), (cos, sin), _ in self._rays():
            for i in range(int(reach / 0.05) + 1):
                new.add(cell_at(x + 0.05 * i * cos, y + 0.05 * i * sin))
        self.seen |= new & self.room.floor_cells

    # -- being shown --------------------------------------------------------------------------------------------------

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
