"""The underwater vehicle in the plane of surge, heave and pitch, under pymunk: from the same numbers, with the same
inputs and outputs as the one in space (`urov.py`), which it checks and which checks it.

How a step goes:

    drift     pymunk: half a step at the old velocity, and what the vehicle then touches       (pool_2d.py)
    forces    as in space: thrusters, tether, buoyancy of what is wet; what lies in the plane counts
    water     ours: the new velocity, by momentum in the world's frame                          (water_2d.py)
    contacts  ours: impulses on a body with another mass in every direction                     (impulses_2d.py)
    drift     pymunk: the other half at the new velocity

pymunk's own integration of velocities is not used, for it has one mass for all directions; nor is its gravity, which
buoyancy nearly takes away. What would lead out of the plane is left out: sway, roll and yaw are held at 0, as by rails
without friction. So the vehicle heads east, whichever way it heads in space.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from snr_sim.plants.attitude import rotation_of
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.impulses_2d import stopped
from snr_sim.plants.urov.pool import FRICTION, Pool
from snr_sim.plants.urov.pool_2d import Pool2D
from snr_sim.plants.urov.urov import STEP_S, Urov
from snr_sim.plants.urov.urov_forces import SLOWING_ROUNDS
from snr_sim.plants.urov.urov_state import State, Thrusters
from snr_sim.plants.urov.vehicle import Vector, Vehicle
from snr_sim.plants.urov.water_2d import Three, Water2D


class Urov2D(Urov):
    """The underwater vehicle in the plane. Keeps the promise of Plant.

    Args:
        vehicle: its numbers; it is trimmed in the pool's water.
        pool: where it swims.
        start_of: gives the dive that belongs to a seed; `in_plane` says what of it counts.
        thrusters: turn pulses into forces; without any, the input is a wrench.
        seed: of the first run.
        step_s: of integration.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        pool: Pool,
        start_of: Callable[[int], Dive],
        thrusters: Thrusters | None = None,
        seed: int = 0,
        step_s: float = STEP_S,
    ) -> None:
        super().__init__(vehicle, pool, lambda number: in_plane(start_of(number)), thrusters, seed, step_s)

    def _build(self, mjcf: str | None) -> Pool2D:
        """Builds the world."""
        self._plane = Pool2D(self.pool, self.vehicle)
        self._water = Water2D(self.vehicle)
        return self._plane

    def _engine_state(self) -> Any:
        """Returns the state in the plane, to the bit: our attitude is pitch by another name."""
        return self._plane.snapshot()

    def scene(self) -> dict[str, Any]:
        """Returns what the vehicle in space shows, and that it stays in its plane."""
        return {**super().scene(), "is_planar": True}

    def restore(self, snapshot: State) -> None:
        """Puts back what `snapshot` returned."""
        super().restore(snapshot)
        self._pitch = self._plane.where()[2]

    def _set_wet(self, share: float) -> None:
        super()._set_wet(share)
        self._water.set_mass(self._hydro.mass, share)

    def _advance(self) -> None:
        """Moves on by one step."""
        step_s, plane, water, flotation = self.step_s, self._plane, self._water, self._flotation
        (vx, _, vz), (cx, _, cz), pitch_rate = self._velocity, self._current, self._rate[1]
        push = self._around(self._thrust(), self.through_water, step_s)
        through = vx - cx, vz - cz, pitch_rate
        if self._slam is not None:
            through = water.less(through, self._pitch, (self._slam[0], self._slam[2], self._slam[4]))
            plane.move_at((through[0] + cx, through[1] + cz, through[2]))
        plane.drift(0.5 * step_s)
        arm_x, _, arm_z = flotation.arm
        rx, rz, rate = water.advance(
            through, self._pitch, (push[0], push[2], push[4]), flotation.net_n, (arm_x, arm_z), step_s
        )
        motion, self._contact_n = (rx + cx, rz + cz, rate), None
        touches = plane.touches()
        if touches:
            mobility = water.mobility(self._pitch + 0.5 * step_s * pitch_rate)
            motion, (along_x, along_z) = stopped(motion, touches, mobility, FRICTION, step_s)
            self._contact_n = (along_x / step_s, 0.0, along_z / step_s)
            self._taken = self._wet
        plane.move_at(motion)
        plane.drift(0.5 * step_s)
        if self._taken > self._wet:
            x, z, rate = self._slowed_in_plane((motion[0] - cx, motion[1] - cz, motion[2]), plane.where()[2])
            motion = x + cx, z + cz, rate
            plane.move_at(motion)
        self._steps += 1
        self._take_over(motion)

    def _slowed_in_plane(self, through: Three, pitch: float) -> Three:
        """Returns the velocity at a step's end, as `_slowed` does in space."""
        share = self._taken - self._wet
        cos, sin = math.cos(pitch), math.sin(pitch)
        x, z, rate = through
        for _ in range(SLOWING_ROUNDS):
            surge, _, heave, _, turn, _ = self._added_momentum(
                cos * x - sin * z, 0.0, sin * x + cos * z, 0.0, rate, 0.0
            )
            x, z, rate = self._water.less(through, pitch, (share * surge, share * heave, share * turn))
        return x, z, rate

    def _take_over(self, motion: tuple[float, float, float]) -> None:
        """Takes over where the step led to."""
        (vx, _, vz), y = self._velocity, self._place[1]
        x, z, pitch = self._plane.where()
        self._pitch = pitch
        self._place, self._attitude = (x, y, z), (math.cos(0.5 * pitch), 0.0, math.sin(0.5 * pitch), 0.0)
        self._rotation = rotation_of(self._attitude)
        self._velocity, self._rate = (motion[0], 0.0, motion[1]), (0.0, motion[2], 0.0)
        self._gained = ((motion[0] - vx) / self.step_s, 0.0, (motion[1] - vz) / self.step_s)


def in_plane(dive: Dive) -> Dive:
    """Returns what of a dive lies in the plane: the vehicle heads east, and nothing pulls to the side."""
    y = dive.position_m[1]
    tether = dive.tether
    return replace(
        dive,
        attitude_rad=(0.0, dive.attitude_rad[1], 0.0),
        velocity_mps=_flat(dive.velocity_mps),
        rate_radps=(0.0, dive.rate_radps[1], 0.0),
        currents=tuple(replace(one, velocity_mps=_flat(one.velocity_mps)) for one in dive.currents),
        loads=tuple(replace(one, place_m=_flat(one.place_m)) for one in dive.loads),
        leak=dive.leak and replace(dive.leak, place_m=_flat(dive.leak.place_m)),
        tether=tether
        and replace(tether, anchor_m=(tether.anchor_m[0], y, tether.anchor_m[2]), place_m=_flat(tether.place_m)),
    )


def _flat(vector: Vector) -> Vector:
    return vector[0], 0.0, vector[2]
