"""An underwater vehicle with six degrees of freedom, made of parts that can be read one by one:

    write --> Drive --wrench--> Mover --> Motion --> Instruments --> read, truth, scene
              drive.py            |  ^     motion.py   instruments.py
              propulsion.py       v  |
                             WaterForces, by what is wet, tether and loads      (water_forces.py)

In space MuJoCo moves the body, with the water that MuJoCo does not have (`space_mover.py`); in the plane pymunk does
(`urov_2d.py`). What happens by the clock is the dive's (`dive.py`).
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Self

import numpy as np

from snr_sim.plants.attitude import Quaternion, rotation_of
from snr_sim.plants.mujoco_body import MujocoBody
from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.drive import Drive
from snr_sim.plants.urov.instruments import Instruments
from snr_sim.plants.urov.mjcf_check import check_mass, check_mjcf
from snr_sim.plants.urov.motion import Motion
from snr_sim.plants.urov.pool import BODY, Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.space_mover import SpaceMover, parts_of
from snr_sim.plants.urov.urov_start import check_clearance, check_parts, check_start
from snr_sim.plants.urov.urov_state import Body, Mover, UrovState
from snr_sim.plants.urov.vehicle import Matrix, Six, Vector, Vehicle
from snr_sim.plants.urov.water_forces import WaterForces, world_acceleration
from snr_sim.prelude.angles import quaternion_of
from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest

STEP_S = 0.005  # the table in robots/urov/PHYSICS.md shows what 2 and 10 ms would change


class Urov:
    """The underwater vehicle. Implements `Plant`.

    Args:
        vehicle: its numbers; it is trimmed in the pool's water.
        pool: where it is.
        start_of: returns the dive that belongs to a seed.
        thrusters: turn pulses into forces; without any, the input is a wrench.
        seed: of the first run.
        step_s: of integration; see `STEP_S`.
        mjcf: another world than the pool's, with a body 'vehicle' on a free joint, whose mass and inertia are then used
            without trim; `mjcf_check.py` says what it must leave to the plant.

    Raises:
        ParameterError: vehicle, thrusters, dive and world are not compatible.

    Attributes:
        vehicle: as trimmed.
        dive: of this run.
    """

    # For `scaled`, of the vehicle.
    SCALABLE = ("added_mass", "linear_damping", "quadratic_damping", "net_buoyancy_n")

    dive: Dive

    def __init__(
        self,
        vehicle: Vehicle,
        pool: Pool,
        start_of: Callable[[int], Dive],
        thrusters: Propulsion | None = None,
        seed: int = 0,
        step_s: float = STEP_S,
        mjcf: str | None = None,
    ) -> None:
        check_parts(vehicle, pool, start_of, thrusters, step_s)
        vehicle = vehicle.trimmed(pool.density_kgm3, pool.gravity_mps2)
        self.vehicle: Vehicle = vehicle
        self.pool: Pool = pool
        self.start_of: Callable[[int], Dive] = start_of
        self.thrusters: Propulsion | None = thrusters
        self._is_in_pool = mjcf is None
        self.step_s: float = step_s
        self._motion = motion = Motion(step_s)
        self._body, self._water, self._mover = self._build(mjcf)
        self._drive = Drive(vehicle, thrusters, self._water.surface, motion)
        self._instruments = Instruments(vehicle, pool, thrusters, self._body, motion, self._water, self._mover)
        self._readers = self._instruments.readers()
        # Which attributes of which part are fields of the state.
        self._parts: tuple[tuple[Any, tuple[str, ...]], ...] = (
            (motion, ("position", "attitude", "velocity", "rate", "steps", "acceleration_world")),
            (self._mover, ("acceleration", "guess", "contact_n", "pressed_n")),
            (self._water, ("wet", "entrained_fraction", "water_l", "tether_n")),
            (self._drive, ("wrench", "pulses", "until_s")),
        )
        self.engine: str = self._body.engine
        self.inputs: tuple[str, ...] = self._drive.inputs
        power = () if thrusters is None else ("power",)
        self.outputs: tuple[str, ...] = ("depth", "imu", "altitude", "leak", "pose", *power)
        self.reset(seed)

    def _build(self, mjcf: str | None) -> tuple[Body, WaterForces, Mover]:
        vehicle, pool, part_s = self.vehicle, self.pool, self.step_s / parts_of(self.step_s)
        if mjcf is None:
            body = MujocoBody(MujocoWorld(pool.mjcf(vehicle), part_s, (BODY,), "the pool"), BODY)
        else:
            world = MujocoWorld(mjcf, part_s, (BODY,))
            check_mjcf(world, mjcf, BODY, pool, self.step_s)
            body = MujocoBody(world, BODY)
            check_mass(vehicle, float(body.rigid[0, 0]))
        water = WaterForces(vehicle, pool, body, self._motion)
        half_m = 0.5 * math.hypot(*vehicle.size_m)
        return body, water, SpaceMover(body, self._motion, water, pool if mjcf is None else None, half_m)

    def scaled(self, factors: Mapping[str, float]) -> Self:
        """Return a vehicle of which some numbers, those in `SCALABLE`, are multiplied, in the same pool.

        Raises a ParameterError in a world of its own, or if a scaled number is out of range.
        """
        if not self._is_in_pool:
            raise ParameterError("A vehicle in an MJCF world cannot be scaled.", fix="scale it in the file.")
        numbers = {name: getattr(self.vehicle, name) for name in factors}
        scaled = {name: (np.asarray(number) * factors[name]).tolist() for name, number in numbers.items()}
        return type(self)(replace(self.vehicle, **scaled), self.pool, self.start_of, self.thrusters, seed=0)

    # -- start, and being put back ------------------------------------------------------------------------------------

    def reset(self, seed: int) -> None:
        """Put the vehicle at the start that belongs to this seed, with its thrusters off."""
        dive, thrusters = self.start_of(seed), self.thrusters
        check_start(dive, seed, self.vehicle, self.pool, thrusters is not None, self.step_s)
        self._body.clear()
        attitude = quaternion_of(*dive.attitude_rad)
        self._body.put([*dive.position_m, *attitude], [*dive.velocity_mps, *dive.rate_radps])
        if thrusters is not None:
            thrusters.reset()
        start = UrovState(
            dive,
            dive.position_m,
            attitude,
            dive.velocity_mps,
            dive.rate_radps,
            self._body.snapshot(),
            None if thrusters is None else thrusters.snapshot(),
            pulses=[None] * len(self.vehicle.thrusters),
        )
        self.restore(start)
        check_clearance(dive, *self._body.deepest(), self.vehicle, self.pool)
        self._apply_events()
        # Sensors may ask before the first step: the acceleration that it begins with.
        mover, motion = self._mover, self._motion
        mover.acceleration = mover.guess = change = self._water.acceleration_at_start()
        motion.acceleration_world = world_acceleration(motion, change)

    def snapshot(self) -> UrovState:
        """Return all of the state; it never changes afterwards."""
        thrusters = None if self.thrusters is None else self.thrusters.snapshot()
        engine = self._mover.engine_state()
        parts = {name: getattr(part, name) for part, names in self._parts for name in names}
        return UrovState(self.dive, mujoco=engine, thrusters=thrusters, event_count=self._event_count, **parts)

    def restore(self, snapshot: UrovState) -> None:
        """Put back what `snapshot` returned."""
        dive = self.dive = self._instruments.dive = snapshot.dive
        self._body.restore(snapshot.mujoco)
        if self.thrusters is not None:
            self.thrusters.restore(snapshot.thrusters)
        for part, names in self._parts:
            for name in names:
                setattr(part, name, getattr(snapshot, name))
        self._motion.rotation = rotation_of(snapshot.attitude)
        self._mover.invalidate()
        self._water.begin(dive)
        self._event_times_s, self._event_count = dive.times_s(), snapshot.event_count
        begun_s = self._event_times_s[: snapshot.event_count]
        self._apply_current_and_loads(begun_s[-1] if begun_s else -math.inf)

    # -- moving -------------------------------------------------------------------------------------------------------

    def write(self, name: str, command: Any) -> None:
        """Set pulses or wrench, which hold until they are set again."""
        self._drive.write(name, command)

    def step(self, dt_s: float) -> None:
        """Advance by one step."""
        step_s, motion = self.step_s, self._motion
        if dt_s != step_s and not abs(dt_s - step_s) <= 1e-9:  # also NaN
            raise ParameterError(f"This plant moves in steps of {step_s} s, not {dt_s} s.", fix="use plant.step_s.")
        now_s = motion.steps * step_s
        if now_s >= self._next_s:
            self._apply_events()
        if self.dive.leak is not None:
            self._water.leak()
        self._mover.advance(self._drive.advance(now_s))
        motion.steps += 1

    def _apply_events(self) -> None:
        """Let happen what the dive has until now."""
        now_s = self.time_s + 1e-9
        before, self._event_count = self._event_count, bisect.bisect_right(self._event_times_s, now_s)
        if self._event_count > before:
            moments = set(self._event_times_s[before : self._event_count])
            names = [thruster.name for thruster in self.vehicle.thrusters]
            for fault in self.dive.faults:
                if fault.at_s in moments and self.thrusters is not None:
                    self.thrusters.fail(fault.number_in(names), fault.fault, fault.effectiveness)
            self._apply_current_and_loads(self._event_times_s[self._event_count - 1])

    def _apply_current_and_loads(self, time_s: float) -> None:
        """Set current and loads to what they are from a moment on."""
        self._motion.current = self.dive.current_at(time_s)
        following = self._event_times_s[self._event_count :]
        self._next_s = following[0] - 1e-9 if following else math.inf
        self._water.attach_loads(self.dive.loads_at(time_s))

    # -- being looked at ----------------------------------------------------------------------------------------------

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset."""
        return self._motion.time_s

    @property
    def through_water(self) -> Six:
        """Velocity relative to the water, body frame: along x, y, z [m/s], about x, y, z [rad/s]."""
        return self._motion.through_water()

    @property
    def position_m(self) -> Vector:
        """Of the vehicle's origin, world frame."""
        return self._motion.position

    @property
    def attitude(self) -> Quaternion:
        """Unit quaternion (w, x, y, z) from the body's frame to the world's."""
        return self._motion.attitude

    @property
    def velocity_mps(self) -> Vector:
        """Of the vehicle's origin, world frame."""
        return self._motion.velocity

    @property
    def rate_radps(self) -> Vector:
        """Angular velocity, body frame."""
        return self._motion.rate

    @property
    def mass_matrix(self) -> Matrix:
        """6 x 6: vehicle, what hangs at it, and the water that moves with it, body frame."""
        water = self._water
        return water.hydro.mass + (water.entrained_fraction - water.wet) * self.vehicle.added_mass

    @property
    def kinetic_energy_j(self) -> float:
        """Of vehicle and water, seen from water that moves with the current."""
        nu = np.array(self.through_water)
        return float(0.5 * nu @ self.mass_matrix @ nu)  # decides no run: for tests

    @property
    def contact_n(self) -> Vector | None:
        """What floor, walls and gates pushed in the last step, world frame; None if nothing was in reach."""
        return self._mover.contact_n

    def read(self, name: str) -> Any:
        """Return the reading of a sensor without errors; all of them are at the origin but the echo sounder."""
        if name not in self.outputs:
            raise UnknownNameError(f"This plant has no output '{name}'.", fix=suggest(name, self.outputs))
        return self._readers[name]()

    def scene(self) -> dict[str, Any]:
        """Return water, floor, walls and gates, and the shape of the vehicle."""
        return self._instruments.scene()

    def truth(self) -> dict[str, Any]:
        """Return the true state for the recorder."""
        return self._instruments.truth()
