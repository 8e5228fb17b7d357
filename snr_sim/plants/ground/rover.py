"""A rover on wheels with motors, on smooth ground with rocks, under MuJoCo.

    command --> write --> rover_motors.py <-- battery
                              | torques
    ground, soil --> wheel_contacts.py: a plane under each wheel, its friction --> MuJoCo --> pose, loads, rates

Why planes and soft contacts: see `rover_mjcf.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from snr_sim.plants.ground.height_map import PLACE_M, HeightMap
from snr_sim.plants.ground.manipulator import MujocoManipulator
from snr_sim.plants.ground.motor_faults import MotorFault
from snr_sim.plants.ground.rocks import Obstacle
from snr_sim.plants.ground.rover_instruments import RoverInstruments
from snr_sim.plants.ground.rover_mjcf import rover_mjcf
from snr_sim.plants.ground.rover_motors import MujocoAxles, RoverMotors
from snr_sim.plants.ground.rover_shapes import rover_scene
from snr_sim.plants.ground.rover_vehicle import RoverVehicle
from snr_sim.plants.ground.terramechanics import Coulomb, Ground
from snr_sim.plants.ground.wheel_contacts import SoilAt, WheelContacts
from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.plants.parameter_limits import LIMITS, Record, check_number, check_valid
from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest
from snr_sim.prelude.ground_signals import ArmCommand, DriveCommand
from snr_sim.prelude.sums import dot_product

STEP_S = 0.002
SETTLE_S = 1.0  # until rockers and bogies have found their angles
PRESS_STEPS = 30  # of bisection, to a tenth of a nanometre


@dataclass(frozen=True)
class RoverStart(Record, who="The rover's start's "):
    """Where a run begins: standing on the ground.

    Args:
        position_m: x and y.
        heading_rad: from east to north.
        charge: of the battery.
        faults: motors that break in the run.
    """

    position_m: Annotated[tuple[float, float], PLACE_M, ("x", "y")] = (0.0, 0.0)
    heading_rad: Annotated[float, LIMITS["angle_rad"]] = 0.0
    charge: Annotated[float, LIMITS["share"]] = 1.0
    faults: Annotated[tuple[MotorFault, ...], "MotorFault(...)"] = ()


def checked_soil(vehicle: RoverVehicle, ground: HeightMap, soil: Ground | SoilAt | None, step_s: float) -> SoilAt:
    """Return what the ground is made of at a place, of a world that is valid for these wheels and steps."""
    check_number("The rover's step_s", step_s, LIMITS["flight_step_s"])
    for wheel in vehicle.wheels:
        ground.check_rolls(wheel.radius_m, f"wheel {wheel.name}")
    everywhere = soil or Coulomb()
    return everywhere if callable(everywhere) else lambda x_m, y_m: everywhere


def checked_start(start_of: Callable[[int], RoverStart], seed: int) -> RoverStart:
    """Return the start of a seed; raise a ParameterError if it is something else."""
    start = start_of(seed)
    check_valid(isinstance(start, RoverStart), f"The start of seed {seed}", start, "return a RoverStart.")
    return start


class RoverState(NamedTuple):
    """Full state."""

    steps: int
    mujoco: bytes
    motors: tuple[Any, ...]
    contacts: tuple[Any, ...]
    measured: bytes  # rates and forces of the last step, which readings show
    arm_rad: tuple[float, ...] = ()  # where its joints go to


class Rover:
    """The vehicle. Implements `Plant`.

    Args:
        vehicle: its numbers.
        ground: heights.
        start_of: returns the start that belongs to a seed.
        soil: what the ground is made of: the same everywhere, or a function of x and y.
        obstacles: what lies on the ground.
        seed: of the first run.
        step_s: of integration.

    Raises:
        ParameterError: a number is out of range, or the ground is too rough for the wheels.
        MissingExtraError: MuJoCo is not installed.

    Attributes:
        seed: of the run.
        motors, contacts: their state, for judges and tests.
    """

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
        soil_at = checked_soil(vehicle, ground, soil, step_s)
        self.vehicle: RoverVehicle = vehicle
        self.ground: HeightMap = ground
        self.obstacles: tuple[Obstacle, ...] = tuple(obstacles)
        self.start_of: Callable[[int], RoverStart] = start_of
        self.step_s: float = step_s
        self._world = world = MujocoWorld(rover_mjcf(vehicle, obstacles), step_s, ("chassis",), "the rover's MJCF")
        self.engine: str = world.engine
        self._model, self._data, mujoco = world.model, world.data, world.mujoco
        self._velocities = self._data.qvel
        self._step_world, self._kinematics = mujoco.mj_step, mujoco.mj_kinematics
        self._kind = mujoco.mjtState.mjSTATE_INTEGRATION
        self._size = int(mujoco.mj_stateSize(self._model, self._kind))
        self.contacts: WheelContacts = WheelContacts(vehicle, world, ground, soil_at)
        axles = MujocoAxles(vehicle, world)
        self._dofs = axles.dofs
        self.motors: RoverMotors = RoverMotors(vehicle, axles)
        self._instruments = RoverInstruments(vehicle, world, self.motors, self.contacts)
        self._arm = MujocoManipulator(vehicle.arm, world) if vehicle.arm else None
        self.inputs: tuple[str, ...] = (*self.motors.inputs, "arm") if self._arm else self.motors.inputs
        self._readers = self._instruments.readers()
        if self._arm:
            self._readers["arm"] = self._arm.reading
        self.outputs: tuple[str, ...] = tuple(self._readers)
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Put the rover at the start of this seed, at rest on the ground."""
        start = checked_start(self.start_of, seed)
        self._world.mujoco.mj_resetData(self._model, self._data)
        self.steps: int = 0
        self.seed: int = seed
        self._stand(start)
        if self._arm:
            self._arm.reset()
        self.motors.reset(start.charge)
        self.motors.neutral()
        self._kinematics(self._model, self._data)
        self.contacts.reset()
        self._press()
        self._settle()
        self.contacts.reset()
        self.motors.reset(start.charge, start.faults)
        self.motors.neutral()

    def _stand(self, start: RoverStart) -> None:
        """Put the chassis onto the ground, upright to the slope under its middle."""
        (x, y), heading = start.position_m, start.heading_rad
        height, slope_x, slope_y = self.ground.at(x, y)
        up = np.array([-slope_x, -slope_y, 1.0]) / math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
        left = np.cross(up, [math.cos(heading), math.sin(heading), 0.0])
        left /= math.sqrt(dot_product(left.tolist(), left.tolist()))
        quat = np.zeros(4)
        self._world.mujoco.mju_mat2Quat(quat, np.stack([np.cross(left, up), left, up], axis=1).reshape(9))
        self._data.qpos[:7] = [x, y, height, *quat.tolist()]

    def _press(self) -> None:
        """Find the height at which the tyres carry the chassis."""
        mujoco, data, middle_m = self._world.mujoco, self._data, float(self._data.qpos[2])
        reach_m = min(wheel.radius_m for wheel in self.vehicle.wheels)
        low, high = middle_m - reach_m, middle_m + reach_m
        for _ in range(PRESS_STEPS):
            data.qpos[2] = middle_m = 0.5 * (low + high)
            mujoco.mj_forward(self._model, data)
            low, high = (middle_m, high) if float(data.qacc[2]) > 0.0 else (low, middle_m)

    def _settle(self) -> None:
        """Let it come to rest with brakes on, so that a run begins without a jolt."""
        for _ in range(round(SETTLE_S / self.step_s)):
            self._advance()
        self._data.qvel[:] = 0.0
        self._data.time = 0.0
        self._kinematics(self._model, self._data)
        self.contacts.lay_planes()
        self._world.mujoco.mj_forward(self._model, self._data)

    @property
    def speed_mps(self) -> float:
        """Speed of the chassis' origin."""
        vx, vy, vz = self._data.qvel[:3].tolist()
        return math.sqrt(vx * vx + vy * vy + vz * vz)

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset: a count, so that nothing adds up."""
        return self.steps * self.step_s

    @property
    def hit_n(self) -> float:
        """Return the largest pressure of an obstacle so far."""
        return self.contacts.hit_n

    def write(self, name: str, command: DriveCommand | ArmCommand) -> None:
        """Set what the motors do: all by "drive", or one by "motor_<wheel>"; see `RoverMotors.order`; or "arm"."""
        if isinstance(command, ArmCommand):
            if self._arm is None or name != "arm":
                raise UnknownNameError(f"The input '{name}' is not an arm.", fix=suggest(name, self.inputs))
            self._arm.order(command, self.time_s)
        else:
            self.motors.order(name, command, self.time_s)

    def step(self, dt_s: float) -> None:
        """Advance by one step."""
        step_s = self.step_s
        if dt_s != step_s and not abs(dt_s - step_s) <= 1e-9:  # also NaN
            raise ParameterError(f"This plant moves in steps of {step_s} s, not {dt_s} s.", fix="use plant.step_s.")
        if self.time_s >= self.motors.until_s:
            self.motors.expire(self.time_s)
        rates = self._advance()
        if self._arm:
            self.motors.draw(rates, step_s, self._arm.advance(step_s))
        else:
            self.motors.draw(rates, step_s)
        self.steps += 1
        if self.steps * step_s >= self.motors.faults.next_s:
            self.motors.break_due(self.time_s)

    def _advance(self) -> list[float]:
        """Advance ground, motors and bodies by a step; return the rates of the motors' wheels before it."""
        model, data, contacts = self._model, self._data, self.contacts
        self._kinematics(model, data)
        contacts.before_step(self.steps)
        velocities = self._velocities.tolist()
        total = sum(velocities)  # decides no run: only whether it is finite
        if total - total != 0.0:
            self._world.check_finite()
        rates = [velocities[dof] for dof in self._dofs]
        self.motors.limit(rates)
        self._step_world(model, data)
        contacts.after_step(velocities)
        return rates

    def read(self, name: str) -> Any:
        """Return an output: "motor_<wheel>", "imu", "pose", "power" or, if it has one, "arm".

        See `MotorReading`, `ArmReading` and `plants/outputs.py`.
        """
        if name not in self._readers:
            raise UnknownNameError(f"This plant has no output '{name}'.", fix=suggest(name, self.outputs))
        return self._readers[name](self.time_s)

    def snapshot(self) -> RoverState:
        """Return the full state; the returned object is immutable."""
        buffer = np.zeros(self._size)
        self._world.mujoco.mj_getState(self._model, self._data, buffer, self._kind)
        measured = np.concatenate([self._data.sensordata, self._data.actuator_force]).tobytes()
        goals_rad = self._arm.goals_rad if self._arm else ()
        motors, contacts = self.motors.snapshot(), self.contacts.snapshot()
        return RoverState(self.steps, buffer.tobytes(), motors, contacts, measured, goals_rad)

    def restore(self, snapshot: RoverState) -> None:
        """Put back what `snapshot` returned."""
        self.steps = snapshot.steps
        self.motors.restore(snapshot.motors)  # before MuJoCo's state, which holds what motors are commanded
        self.contacts.restore(snapshot.contacts)
        if self._arm:
            self._arm.goals_rad = snapshot.arm_rad
        data = self._data
        self._world.mujoco.mj_setState(self._model, data, np.frombuffer(snapshot.mujoco), self._kind)
        self._kinematics(self._model, data)
        count = len(data.sensordata)
        measured = np.frombuffer(snapshot.measured)
        data.sensordata[:], data.actuator_force[:] = measured[:count], measured[count:]

    def scene(self) -> dict[str, Any]:
        """Return ground, obstacles and the shapes of the rover."""
        return rover_scene(self.vehicle, self.ground, self.obstacles)

    def truth(self) -> dict[str, Any]:
        """Return the true state for the recorder: poses of all bodies, loads of the wheels."""
        return self._instruments.truth()
