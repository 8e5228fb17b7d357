"""What all vehicles on a floor share: a start in a room, a state that can be put back, contacts, and how they move.

    write --> goals --> DriveLag --> wheels or tracks (of the subclass) --> speeds --> pose
                                               walls --> wall_contacts.py --^     room_space.py: pymunk finds contacts

A step is a kick, then a drift: wheels, soil and walls change the speeds, then the body moves with them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from snr_sim.plants.ground.dozer import Dozer
from snr_sim.plants.ground.explorer import Explorer
from snr_sim.plants.ground.room import Point, Room
from snr_sim.plants.ground.room_space import RoomSpace
from snr_sim.plants.ground.wall_contacts import Speeds, WallContacts
from snr_sim.plants.parameter_limits import LIMITS, check_number, check_valid
from snr_sim.plants.pymunk_engine import pymunk_module
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownNameError, suggest

STEP_S = 0.005
SAME_MPS = 1e-6  # a speed that is as near as rounding allows has arrived
Pair = tuple[float, float]  # left and right

StateT = TypeVar("StateT", bound=Any)  # a NamedTuple of the attributes that are the full state


class GroundVehicle(Generic[StateT]):
    """Base of plants that drive on a floor.

    `start_of` returns the start and the room of a seed, and what else there is.

    Raises:
        ParameterError: a number is out of range, or a start is not on the floor or touches something.

    Attributes:
        hit_mps: the largest speed at which it met something, towards it: of the parts that met, not of the centre.
        way_m: how far its centre has moved.
    """

    inputs: tuple[str, ...]
    room: Room
    position_m: Point
    heading_rad: float
    speeds: Speeds  # of the centre of mass, world frame, and of turning
    goals_mps: Pair  # of wheels or tracks, left and right
    hit_mps: float
    way_m: float
    steps: int

    def __init__(self, vehicle: Explorer | Dozer, start_of: Callable[[int], Any], step_s: float) -> None:
        self._name = type(vehicle).__name__.lower()
        check_number(f"The {self._name}'s step_s", step_s, LIMITS["flight_step_s"])
        self.start_of: Callable[[int], Any] = start_of
        self.step_s: float = step_s
        self.engine: str = f"pymunk {pymunk_module().version}"
        self._vehicle = vehicle
        self._lag = DriveLag(vehicle.lag_s, step_s)

    def _start(self, seed: int, *types: type) -> Any:
        given = self.start_of(seed)
        is_start = isinstance(given, tuple) and tuple(map(type, given)) == types
        *others, last = (f"a {one.__name__}" for one in types)
        check_valid(is_start, f"The start of seed {seed}", given, f"return {', '.join(others)} and {last}.")
        return given

    def _begin(self, seed: int, room: Room, state: StateT, bar_m: float = 0.0) -> None:
        """Begin in a room, with the state of a start; touch bars stand out by `bar_m`."""
        vehicle, self.room = self._vehicle, room
        self._space = RoomSpace(room, vehicle.size_m, bar_m)
        fastest_mps = 2.0 * vehicle.full_speed_mps + max((one.speed_mps for one in room.walkers), default=0.0)
        numbers = vehicle.mass_kg, vehicle.inertia_kgm2, vehicle.wall_friction
        self._contacts = WallContacts(*numbers, fastest_mps, self.step_s)
        self._state_type: Any = type(state)
        self.restore(state)
        self._place()
        if not room.is_floor(*self.position_m) or self._space.plane.contacts():
            x, y = self.position_m
            raise ParameterError(
                f"The start of seed {seed} is at ({x:g}, {y:g}) m, where the {self._name} has no room.",
                fix="start it farther from walls, furniture and people.",
            )

    def snapshot(self) -> StateT:
        """Return the full state; the returned object is immutable."""
        state: StateT = self._state_type(**{name: getattr(self, name) for name in self._state_type._fields})
        return state

    def restore(self, snapshot: StateT) -> None:
        """Put back what `snapshot` returned, in the room of the last reset."""
        for name, value in zip(self._state_type._fields, snapshot, strict=True):
            setattr(self, name, value)
        self._contacts.restart()

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset: a count, so that nothing adds up."""
        return self.steps * self.step_s

    def _check_command(self, name: str, command: Any, *values: float) -> None:
        if name not in self.inputs:
            raise UnknownNameError(f"This plant has no input '{name}'.", fix=suggest(name, self.inputs))
        if not all(map(math.isfinite, values)):
            raise PlantError(
                f"At {self.time_s:g} s the command of the {name} is not finite: {command}.", fix="send finite numbers."
            )

    def _set_goals(self, left_mps: float, right_mps: float) -> None:
        """Set the speeds of both sides, clamped to full speed."""
        full = self._vehicle.full_speed_mps
        self.goals_mps = min(full, max(-full, left_mps)), min(full, max(-full, right_mps))

    def _count_step(self, dt_s: float) -> None:
        """Check the length of a step, and count it."""
        step_s = self.step_s
        if dt_s != step_s and not abs(dt_s - step_s) <= 1e-9:  # also NaN
            raise ParameterError(f"This plant moves in steps of {step_s} s, not {dt_s} s.", fix="use plant.step_s.")
        self.steps += 1

    def _move(self, speeds: Speeds) -> None:
        """Move for a step, with the speeds after a kick; contacts change them first."""
        step_s, (x, y) = self.step_s, self.position_m
        if self._contacts.is_due():
            if not all(map(math.isfinite, (x, y, self.heading_rad, *speeds))):
                raise PlantError(
                    f"At {self.time_s:g} s the state is no longer finite.", fix="look at the last commands."
                )
            self._place()
            speeds, hit_mps = self._contacts.resolve(self._space.plane, speeds)
            self.hit_mps = max(self.hit_mps, hit_mps)
        vx, vy, turn = self.speeds = speeds
        self.position_m = x + step_s * vx, y + step_s * vy
        self.heading_rad += step_s * turn
        self.way_m += step_s * math.sqrt(vx * vx + vy * vy)

    def _place(self) -> None:
        self._space.plane.put_body(*self.position_m, self.heading_rad)


class DriveLag:
    """Lag of first order with which wheels or tracks follow the speeds they are commanded, exact for any step.

    Args:
        lag_s: time after which 63 % of a change is reached.
        step_s: of integration.
    """

    def __init__(self, lag_s: float, step_s: float) -> None:
        self._left, self._steps = (math.exp(-step_s / lag_s), lag_s / step_s) if lag_s > 0.0 else (0.0, 0.0)

    def advance(self, now_mps: Pair, goals_mps: Pair) -> tuple[Pair, Pair]:
        """Return the speeds at the end of a step [m/s], and their means in it."""
        if now_mps == goals_mps:
            return now_mps, now_mps
        news = [goal + (now - goal) * self._left for now, goal in zip(now_mps, goals_mps, strict=True)]
        mean_left, mean_right = (
            goal + (now - new) * self._steps for now, new, goal in zip(now_mps, news, goals_mps, strict=True)
        )
        left, right = (goal if abs(new - goal) < SAME_MPS else new for new, goal in zip(news, goals_mps, strict=True))
        return (left, right), (mean_left, mean_right)
