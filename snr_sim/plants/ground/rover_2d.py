"""The rover seen from above: body and obstacles in the plane under pymunk, slopes only as a force.

    command --> write --> rover_motors.py <-- battery
                              | lines
    loads of the last step's forces --> wheel_friction_2d.py --> speeds, rates --> pose
                                        obstacles --> wall_contacts.py --^

Along a slope it drives as on level ground with a force downhill; suspension and hops are not there. What is lower than
a third of a wheel's radius is driven over and not felt; the ground must be as smooth as for `Rover`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from snr_sim.plants.ground.body_space import ANY, HIGH, LOW, BodySpace, box_corners
from snr_sim.plants.ground.height_map import HeightMap
from snr_sim.plants.ground.rocks import Obstacle
from snr_sim.plants.ground.rover import STEP_S, RoverStart, checked_soil, checked_start
from snr_sim.plants.ground.rover_2d_instruments import PlanarInstruments, PlanarState
from snr_sim.plants.ground.rover_loads import RoverLoads
from snr_sim.plants.ground.rover_motors import RoverMotors
from snr_sim.plants.ground.rover_shapes import rover_scene
from snr_sim.plants.ground.rover_vehicle import NO_MOTOR, OWN_MOTOR, RoverVehicle
from snr_sim.plants.ground.terramechanics import Coulomb, Ground, slip_of
from snr_sim.plants.ground.traction import GRAVITY_MPS2
from snr_sim.plants.ground.wall_contacts import Speeds, WallContacts
from snr_sim.plants.ground.wheel_contacts import CREEP_MPS, SOIL_STEPS, SoilAt
from snr_sim.plants.ground.wheel_friction_2d import WheelFriction2D
from snr_sim.plants.parameter_limits import check_valid
from snr_sim.plants.pymunk_engine import pymunk_module
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownNameError, suggest
from snr_sim.prelude.ground_signals import DriveCommand

DEFLECTION = 9.0 / 130.0  # of tyres at rest, a share of the radius, as of the contacts in `rover_mjcf.py`
LOW_SHARE = 0.3  # of a wheel's radius: what is lower is driven over
OBSTACLE_FRICTION = 0.8
FASTEST = 3.0  # times the speed of wheels without load: no slope makes it faster


class Rover2DState(NamedTuple):
    """Full state."""

    motion: PlanarState
    motors: tuple[Any, ...]
    torques_nm: tuple[float, ...]


class Rover2D:
    """The vehicle in the plane. Implements `Plant`; arguments and errors are those of `Rover`.

    Attributes:
        seed: of the run.
        motors: their state, for judges and tests.
        state: where it is and how it moves.
    """

    state: PlanarState

    def __init__(
        self,
        vehicle: RoverVehicle,
        ground: HeightMap,
        start_of: Callable[[int], RoverStart],
        soil: Ground | SoilAt | None = None,
        obstacles: Sequence[Obstacle] = (),
        seed: int = 0,
        step_s: float = STEP_S,
    ) -> None:
        self._soil_at = checked_soil(vehicle, ground, soil, step_s)
        chained = [wheel.name for wheel in vehicle.wheels if wheel.motor not in (OWN_MOTOR, NO_MOTOR)]
        check_valid(not chained, "What the motors of others turn", chained, "in the plane, use Dozer2D or Rover.")
        check_valid(vehicle.arm is None, "The rover's arm in the plane", vehicle.arm, "leave it out, or use Rover.")
        self.vehicle: RoverVehicle = vehicle
        self.ground: HeightMap = ground
        self.obstacles: tuple[Obstacle, ...] = tuple(obstacles)
        self.start_of: Callable[[int], RoverStart] = start_of
        self.step_s: float = step_s
        self.engine: str = f"pymunk {pymunk_module().version}"
        self._loads = loads = RoverLoads(vehicle)
        self._rolling_m = [(1.0 - 0.5 * DEFLECTION) * wheel.radius_m for wheel in vehicle.wheels]
        self._none = [0.0] * len(vehicle.wheels)
        self._soils: tuple[Ground, ...] = ()
        self._frictions: list[float] = []
        self._friction = WheelFriction2D(vehicle, loads, self._rolling_m, step_s)
        self.motors: RoverMotors = RoverMotors(vehicle, self._friction)
        self._space = obstacle_space(vehicle, ground, obstacles, loads.center_m)
        top_mps = max(wheel.radius_m for wheel in vehicle.wheels) * vehicle.motor.top_radps(self.motors.voltage_v)
        self._contacts = WallContacts(loads.mass_kg, loads.yaw_kgm2, OBSTACLE_FRICTION, FASTEST * top_mps, step_s)
        self._instruments = PlanarInstruments(vehicle, ground, loads, self.motors, step_s)
        self.inputs: tuple[str, ...] = self.motors.inputs
        self._readers = self._instruments.readers()
        self.outputs: tuple[str, ...] = tuple(self._readers)
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Put the rover at the start of this seed, at rest."""
        start = checked_start(self.start_of, seed)
        self.seed: int = seed
        (x, y), heading = start.position_m, start.heading_rad
        (ahead, left), cos, sin = self._loads.center_m, math.cos(heading), math.sin(heading)
        none = (0.0,) * len(self.vehicle.wheels)
        self.motors.reset(start.charge, start.faults)
        self.motors.neutral()
        self._friction.restore(none)
        self._contacts.restart()
        center = x + cos * ahead - sin * left, y + sin * ahead + cos * left
        self.state = PlanarState(center, heading, none, none, none)
        self._space.put_body(*center, heading)
        if self._space.contacts():
            raise ParameterError(
                f"The start of seed {seed} is at ({x:g}, {y:g}) m, where the rover touches an obstacle.",
                fix="start it farther away.",
            )

    def snapshot(self) -> Rover2DState:
        """Return the full state; the returned object is immutable."""
        return Rover2DState(self.state, self.motors.snapshot(), self._friction.snapshot())

    def restore(self, snapshot: Rover2DState) -> None:
        """Put back what `snapshot` returned."""
        self.state, motors, torques = snapshot
        self.motors.restore(motors)
        self._friction.restore(torques)
        self._contacts.restart()

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset: a count, so that nothing adds up."""
        return self.state.steps * self.step_s

    @property
    def speed_mps(self) -> float:
        """Speed of the center of mass."""
        vx, vy, _ = self.state.speeds
        return math.sqrt(vx * vx + vy * vy)

    @property
    def hit_n(self) -> float:
        """Return the largest pressure of an obstacle so far, the mean of a step."""
        return self.state.hit_n

    @property
    def loads_n(self) -> list[float]:
        """Return the pressure of the ground on each wheel."""
        return self._instruments.loads_n(self.state)

    def write(self, name: str, command: DriveCommand) -> None:
        """Set what the motors do: all by "drive", or one by "motor_<wheel>"; see `RoverMotors.order`."""
        self.motors.order(name, command, self.time_s)

    def step(self, dt_s: float) -> None:
        """Advance by one step."""
        step_s, old = self.step_s, self.state
        if dt_s != step_s and not abs(dt_s - step_s) <= 1e-9:  # also NaN
            raise ParameterError(f"This plant moves in steps of {step_s} s, not {dt_s} s.", fix="use plant.step_s.")
        if self.time_s >= self.motors.until_s:
            self.motors.expire(self.time_s)
        old_rates = old.rates
        motor_rates = [old_rates[i] for i in self._friction.driven]
        self.motors.limit(motor_rates)
        speeds, rates, drives_n, side_n, soils = self._drive(old)
        hits = old.hit_n, old.hits, old.is_touching
        if self._contacts.is_due():
            speeds, hits = self._touch(speeds, old)
        (x, y), (vx, vy, turn), (old_vx, old_vy, old_turn) = old.position_m, speeds, old.speeds
        self.state = PlanarState(
            (x + step_s * vx, y + step_s * vy),
            old.heading_rad + step_s * turn,
            tuple(rates),
            tuple([a + step_s * rate for a, rate in zip(old.turned_rad, rates, strict=True)]),
            tuple(drives_n),
            soils,
            side_n,
            speeds,
            ((vx - old_vx) / step_s, (vy - old_vy) / step_s, (turn - old_turn) / step_s),
            *hits,
            old.steps + 1,
        )
        self.motors.draw(motor_rates, step_s)
        if self.time_s >= self.motors.faults.next_s:
            self.motors.break_due(self.time_s)

    def _drive(self, state: PlanarState) -> tuple[Speeds, list[float], list[float], float, tuple[Ground, ...]]:
        """Return speeds, rates and forces after a step with gravity, motors and friction, without obstacles.

        Forces are those of the ground on each wheel ahead and on all to the left; last is the soil under each wheel.
        """
        step_s, (vx, vy, turn) = self.step_s, state.speeds
        soils = self._find_soils(state) if state.steps % SOIL_STEPS == 0 else state.soils
        if soils != self._soils:
            self._note_soils(soils)
        _, slope_x, slope_y = self.ground.at(*state.position_m)
        down = GRAVITY_MPS2 / math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)  # across the ground
        kick_x, kick_y = -step_s * down * slope_x, -step_s * down * slope_y
        middle = state.heading_rad + 0.5 * step_s * turn  # the chord of an arc has the heading of its middle
        cos, sin = math.cos(middle), math.sin(middle)
        body = cos * vx + sin * vy, cos * vy - sin * vx, turn
        kick = cos * kick_x + sin * kick_y, cos * kick_y - sin * kick_x
        loads = self._loads.shared(down, state.drives_n, state.side_n)
        if self._frictions:
            grips, drags = [friction * load for friction, load in zip(self._frictions, loads, strict=True)], self._none
        else:
            grips, drags = self._soil_forces(body, state.rates, loads)
        (ahead, left, turn), rates, drives, side_n = self._friction.advance(body, kick, state.rates, grips, drags)
        return (cos * ahead - sin * left, sin * ahead + cos * left, turn), rates, drives, side_n, soils

    def _find_soils(self, state: PlanarState) -> tuple[Ground, ...]:
        """Find the kind of ground under each wheel."""
        (x, y), cos, sin = (
            state.origin_m(self._loads.center_m),
            math.cos(state.heading_rad),
            math.sin(state.heading_rad),
        )
        places = (wheel.position_m for wheel in self.vehicle.wheels)
        return tuple(self._soil_at(x + cos * a - sin * b, y + sin * a + cos * b) for a, b, _ in places)

    def _note_soils(self, soils: tuple[Ground, ...]) -> None:
        """Compute what is constant on these soils: the friction of each wheel if all is firm, and none if not."""
        self._soils, wheels = soils, self.vehicle.wheels
        each = list(zip(wheels, soils, strict=True))
        is_firm = all(isinstance(soil, Coulomb) for soil in soils)
        self._frictions = [
            one.friction_scale * soil.friction for one, soil in each if is_firm and isinstance(soil, Coulomb)
        ]
        (x, y), rolling_m = self._loads.center_m, self._rolling_m
        self._on_soil = [
            (one.position_m[0] - x, one.position_m[1] - y, m, one.friction_scale, soil.under(one.radius_m, one.width_m))
            for (one, soil), m in zip(each, rolling_m, strict=True)
        ]

    def _soil_forces(
        self, speeds: Speeds, rates: Sequence[float], loads: Sequence[float]
    ) -> tuple[list[float], list[float]]:
        """Return the largest friction of each wheel [N], and the resistance of its soil [N s/m]."""
        ahead, left, turn = speeds
        grips, drags = [], []
        for (x, y, rolling_m, scale, forces), load_n, rate in zip(self._on_soil, loads, rates, strict=True):
            along, across = ahead - turn * y, left + turn * x
            friction, back_n = forces(slip_of(rate * rolling_m, along, across), load_n)
            grips.append(scale * friction * load_n)
            drags.append(back_n / math.sqrt(along * along + across * across + CREEP_MPS * CREEP_MPS))
        return grips, drags

    def _touch(self, before: Speeds, state: PlanarState) -> tuple[Speeds, tuple[float, int, bool]]:
        """Return speeds after contacts with obstacles, and what has been felt so far.

        Args:
            before: speeds without contacts.
            state: at the beginning of the step.
        """
        vx, vy, turn = before
        if not math.isfinite(vx + vy + turn):
            raise PlantError(f"At {self.time_s:g} s the state is no longer finite.", fix="look at the last commands.")
        self._space.put_body(*state.position_m, state.heading_rad)
        speeds, hit_mps = self._contacts.resolve(self._space, before)
        is_touching = hit_mps != 0.0
        hit_n = self._loads.mass_kg * math.hypot(speeds[0] - vx, speeds[1] - vy) / self.step_s
        hits = state.hits + (is_touching and not state.is_touching)
        return speeds, (max(state.hit_n, hit_n), hits, is_touching)

    def read(self, name: str) -> Any:
        """Return an output: "motor_<wheel>" (a `MotorReading`), "imu", "pose" or "power" (`plants/outputs.py`)."""
        if name not in self._readers:
            raise UnknownNameError(f"This plant has no output '{name}'.", fix=suggest(name, self.outputs))
        return self._readers[name](self.state)

    def scene(self) -> dict[str, Any]:
        """Return the ground with its obstacles, and the shapes of the rover."""
        return rover_scene(self.vehicle, self.ground, self.obstacles)

    def truth(self) -> dict[str, Any]:
        """Return the true state for the recorder."""
        return self._instruments.truth(self.state)


def obstacle_space(
    vehicle: RoverVehicle, ground: HeightMap, obstacles: Sequence[Obstacle], center_m: tuple[float, float]
) -> BodySpace:
    """Return what a rover, whose center of mass is at `center_m`, can touch.

    Its wheels touch whatever they cannot drive over, its chassis only what reaches up to it.
    """
    space = BodySpace()
    x, y = center_m
    for wheel in vehicle.wheels:
        a, b, _ = wheel.position_m
        space.add_outline(box_corners(wheel.radius_m, 0.5 * wheel.width_m, (a - x, b - y)))
    (length, width, height), (a, b, middle_m) = vehicle.size_m, vehicle.center_m
    space.add_outline(box_corners(0.5 * length, 0.5 * width, (a - x, b - y)), HIGH)
    radius_m = min(wheel.radius_m for wheel in vehicle.wheels)
    for obstacle in obstacles:
        floor_m = ground.at(*obstacle.center_m[:2])[0]
        top_m = obstacle.top_m - floor_m
        if top_m > LOW_SHARE * radius_m:
            layers = ANY if top_m > middle_m - 0.5 * height else LOW
            space.add_thing(obstacle.outline(floor_m, space.space.static_body), layers)
    return space
