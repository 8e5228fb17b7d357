"""Many landers in the plane in flight, step by step as `plants/lander/lander_2d.py` computes each of them.

The scheme and the steps are the plant's own, in arrays, so a flight is the same but for rounding. Contact with the
ground is not simulated here: `met` returns which landers reach it, and `state_of` hands their state to the plant.
(`plane_batch.py`, which learning uses, takes steps ten times as long, and is accurate to some centimetres.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from snr_sim.plants.lander.lander import CEILING_M, EDGE_M, THROTTLE_TOLERANCE, LanderState
from snr_sim.plants.lander.legs import FEET_M, MAX_CONTACT_RADIUS_M, BodyPose
from snr_sim.plants.lander.module import LunarModule, PlaneStart
from snr_sim.plants.lander.module_shapes import HULL_M, NOZZLE_BELOW_M
from snr_sim.plants.lander.terrain import HALF_WIDTH_M, ROOF_REACH_M, SPACING_M, Terrain
from snr_sim.prelude.signals import InertialReading

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.int64]

CORNERS_M = np.array([*FEET_M, *HULL_M])  # what can touch the ground
REACH_FIELDS = int(ROOF_REACH_M / SPACING_M)
FAST_MPS = 40.0  # sideways: beyond it the ground is looked at wherever it is
SPARE_M = 0.1  # more than an engine that points up adds to the descent within a period


class PlaneFlight:
    """The state of all, each number an array of the shape (count,). `step_s` is that of the plant.

    What a module's own numbers give for a step is kept for each, as they may differ.

    Attributes:
        numbers: all that changes, shape (10, count); each row has a name as well:
        x, z, attitude, vx, vz, rate: as pymunk holds them: positions half a step ahead, and the next step's fall in vz.
        mass, fuel, throttle, gimbal: at this moment.
    """

    x: Floats
    z: Floats
    attitude: Floats
    vx: Floats
    vz: Floats
    rate: Floats
    mass: Floats
    fuel: Floats
    throttle: Floats
    gimbal: Floats

    def __init__(self, step_s: float, count: int) -> None:
        self._step_s = step_s
        self._laws = np.ones((7, count))
        (self._lag_left, self._lag_steps, self._fall, self._max_turn, self._flow, self._exhaust,
         self._gyration) = self._laws  # fmt: skip
        self._all = np.arange(count)
        self.numbers: Floats = np.ones((10, count))
        self._side, self._up, self._twist = np.zeros((3, count))  # what engine and jets gave in the last step
        (self.x, self.z, self.attitude, self.vx, self.vz, self.rate, self.mass, self.fuel, self.throttle,
         self.gimbal) = self.numbers  # fmt: skip
        fields = round(2.0 * HALF_WIDTH_M / SPACING_M)
        self._heights, self._roofs = np.zeros((count, fields + 1)), np.zeros((count, fields))

    def put(self, which: Indices, begun: Sequence[tuple[PlaneStart, Terrain]], modules: Sequence[LunarModule]) -> None:
        """Put some of them at starts, each with its module, engine off."""
        self._laws[:, which] = np.array([self._laws_of(module) for module in modules]).T
        numbers = [
            (*self._held(i, *start.position_m, start.attitude_rad, *start.velocity_mps, start.rate_radps),
             start.mass_kg, start.fuel_kg, 0.0, 0.0)
            for i, (start, _) in zip(which.tolist(), begun, strict=True)
        ]  # fmt: skip
        self.numbers[:, which] = np.array(numbers).T
        heights = np.array([terrain.heights_m for _, terrain in begun])
        self._heights[which] = heights
        # As `Terrain.roof_m`, for each field.
        ends = np.pad(heights, ((0, 0), (REACH_FIELDS, REACH_FIELDS)), constant_values=-np.inf)
        fields = heights.shape[1] - 1
        self._roofs[which] = np.max([ends[:, k : k + fields] for k in range(2 * REACH_FIELDS + 2)], axis=0)

    def _laws_of(self, module: LunarModule) -> tuple[float, ...]:
        """Return the rows of `_laws` of a module."""
        lag_s, step_s = module.throttle_lag_s, self._step_s
        lag = (math.exp(-step_s / lag_s), lag_s / step_s) if lag_s > 0.0 else (0.0, 0.0)
        flow = module.thrust_n / module.exhaust_mps * step_s
        fall, max_turn = module.gravity_mps2 * step_s, module.gimbal_rate_radps * step_s
        return (*lag, fall, max_turn, flow, module.exhaust_mps, module.gyration_m**2)

    def _held(
        self, i: int, x: float, z: float, attitude: float, vx: float, vz: float, rate: float
    ) -> tuple[float, ...]:
        """Return a motion as pymunk holds it."""
        half_s = 0.5 * self._step_s
        return x + half_s * vx, z + half_s * vz, attitude + half_s * rate, vx, vz - float(self._fall[i]), rate

    def pose(self) -> tuple[Floats, ...]:
        """Return x, z, attitude, vx, vz and rate at one moment."""
        vz, half_s = self.vz + self._fall, 0.5 * self._step_s
        x, z = self.x - half_s * self.vx, self.z - half_s * vz
        return x, z, self.attitude - half_s * self.rate, self.vx, vz, self.rate

    def midway(self, i: int) -> BodyPose:
        """Return how one moves in the middle of the step that `push` began: where it is held, and before `move`."""
        cos, sin = math.cos(self.attitude[i]), math.sin(self.attitude[i])
        x, z, attitude, vx, vz, rate = self.numbers[:6, i].tolist()
        side, up, twist = float(self._side[i]), float(self._up[i]), float(self._twist[i])
        vx, vz = vx - 0.5 * (cos * side - sin * up), vz - 0.5 * (sin * side + cos * up - float(self._fall[i]))
        return BodyPose(x, z, attitude, vx, vz, rate - 0.5 * twist / float(self._gyration[i]))

    def heights_m(self) -> Floats:
        """Return the height of the ground straight below each."""
        return self._ground(self._all, self.x - 0.5 * self._step_s * self.vx)

    @staticmethod
    def state_of(numbers: Floats, i: int, terrain: Terrain, steps: int) -> LanderState:
        """Return what the plant needs to fly one of them on from where `numbers` were."""
        *body, mass, fuel, throttle, gimbal = numbers[:, i].tolist()
        return LanderState(BodyPose(*body), mass, fuel, terrain, steps=steps, throttle=throttle, gimbal_rad=gimbal)

    def near(self, period_s: float) -> Indices:
        """Return which landers may meet the ground within a time."""
        over_m = self.z - MAX_CONTACT_RADIUS_M - self._roofs[self._all, self._fields(self.x)]
        falls_m = np.minimum(0.0, self.vz - 10.0 * self._fall) * period_s
        return np.flatnonzero((over_m + falls_m < SPARE_M) | (np.abs(self.vx) > FAST_MPS))

    def lost(self) -> Bools:
        """Return which landers have left the region."""
        lost: Bools = (np.abs(self.x) > EDGE_M) | (self.z > CEILING_M)
        return lost

    def met(self, which: Indices) -> Indices:
        """Return which of some have a foot or a corner of the hull in the ground."""
        cos, sin = np.cos(self.attitude[which]), np.sin(self.attitude[which])
        out, up = CORNERS_M[:, :1], CORNERS_M[:, 1:]
        x, z = self.x[which] + cos * out - sin * up, self.z[which] + sin * out + cos * up
        under = self._ground(which, x) > z
        found: Indices = which[under.any(axis=0)]
        return found

    def push(self, throttle_goal: Floats, gimbal_goal: Floats, jets_nm: Floats) -> None:
        """Let engine and jets of all push for one step of the plant; `met` and `midway` come next, and then `move`.

        Args:
            throttle_goal: commanded, fractions that the engine can run at; becomes 0 where the tank is dry.
            gimbal_goal: commanded [rad].
            jets_nm: couple of the attitude jets.
        """
        step_s, max_turn = self._step_s, self._max_turn
        throttle, fuel, mass = self.throttle, self.fuel, self.mass
        mean = throttle.copy()
        throttle -= throttle_goal
        throttle *= self._lag_left
        throttle += throttle_goal
        np.copyto(throttle, throttle_goal, where=np.abs(throttle - throttle_goal) < THROTTLE_TOLERANCE)
        mean -= throttle
        mean *= self._lag_steps
        mean += throttle_goal
        turned = np.minimum(max_turn, np.maximum(-max_turn, gimbal_goal - self.gimbal))
        self.gimbal += turned
        gimbal = self.gimbal - 0.5 * turned * np.abs(turned) / max_turn
        burned = mean * self._flow
        dry = burned >= fuel
        if dry.any():
            burned = np.where(dry, fuel, burned)
            throttle[dry] = throttle_goal[dry] = 0.0
        fuel -= burned
        mass -= burned
        mean_mass = mass + 0.5 * burned
        push = burned * self._exhaust / mean_mass
        np.multiply(push, np.sin(gimbal), out=self._side)
        np.multiply(push, np.cos(gimbal), out=self._up)
        np.add(jets_nm * step_s / mean_mass, NOZZLE_BELOW_M * self._side, out=self._twist)
        cos, sin = np.cos(self.attitude), np.sin(self.attitude)
        self.vx += cos * self._side - sin * self._up
        self.vz += sin * self._side + cos * self._up
        self.rate += self._twist / self._gyration

    def move(self) -> None:
        """Move all on by one step of the plant."""
        self.x += self.vx * self._step_s
        self.z += self.vz * self._step_s
        self.attitude += self.rate * self._step_s
        self.vz -= self._fall

    def take(self, i: int, reading: InertialReading, mass_kg: float) -> None:
        """Copy the state of one lander back from the plant."""
        (x, z), (vx, vz) = reading.position_m, reading.velocity_mps
        body = self._held(i, x, z, reading.attitude_rad, vx, vz, reading.rate_radps)
        self.numbers[:, i] = (*body, mass_kg, reading.fuel_kg, 0.0, 0.0)

    def _fields(self, x: Floats) -> Indices:
        along = ((x + HALF_WIDTH_M) / SPACING_M).astype(np.int64)
        fields: Indices = np.clip(along, 0, self._roofs.shape[1] - 1)
        return fields

    def _ground(self, which: Indices, x: Floats) -> Floats:
        """Return the height of the ground, as `Terrain.ground`."""
        i = self._fields(x)
        left = self._heights[which, i]
        height: Floats = left + (self._heights[which, i + 1] - left) * ((x + HALF_WIDTH_M) / SPACING_M - i)
        return height
