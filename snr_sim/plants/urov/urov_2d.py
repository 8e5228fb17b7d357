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
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from snr_sim.plants.attitude import rotation_of
from snr_sim.plants.impulses_2d import resolve_contacts
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.motion import Motion
from snr_sim.plants.urov.pool import FRICTION, Pool
from snr_sim.plants.urov.pool_2d import Pool2D
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.urov import STEP_S, Urov
from snr_sim.plants.urov.urov_state import Body, Mover
from snr_sim.plants.urov.vehicle import Matrix, Vector, Vehicle
from snr_sim.plants.urov.water_2d import Three, Water2D
from snr_sim.plants.urov.water_forces import SLOWING_ITERATIONS, WaterForces


class Urov2D(Urov):
    """The vehicle in the plane. Implements `Plant`; `in_plane` documents which parts of a dive are used."""

    def __init__(
        self,
        vehicle: Vehicle,
        pool: Pool,
        start_of: Callable[[int], Dive],
        thrusters: Propulsion | None = None,
        seed: int = 0,
        step_s: float = STEP_S,
    ) -> None:
        super().__init__(vehicle, pool, lambda number: in_plane(start_of(number)), thrusters, seed, step_s)

    def _build(self, mjcf: str | None) -> tuple[Body, WaterForces, Mover]:
        """Build the world, and what moves the vehicle in it."""
        plane = Pool2D(self.pool, self.vehicle)
        water = WaterForces(self.vehicle, self.pool, plane, self._motion)
        return plane, water, PlaneMover(plane, self._motion, water, Water2D(self.vehicle))

    def scene(self) -> dict[str, Any]:
        """Return what the vehicle in space shows, and that it stays in its plane."""
        return {**super().scene(), "is_planar": True}


class PlaneMover(Mover):
    """Three degrees of freedom: surge, heave and pitch. Writes `motion`."""

    def __init__(self, plane: Pool2D, motion: Motion, water: WaterForces, equation: Water2D) -> None:
        self._plane, self._motion, self._water, self._equation = plane, motion, water, equation
        self._known_mass: tuple[Matrix | None, float] = (None, 1.0)

    def engine_state(self) -> Any:
        """Return the state in the plane, to the bit: our attitude is pitch by another name."""
        return self._plane.snapshot()

    def invalidate(self) -> None:
        """Take over the pitch that the vehicle was put at."""
        self._pitch = self._plane.plane_pose()[2]

    def _follow_mass(self) -> None:
        mass, wet = self._water.hydro.mass, self._water.wet
        if self._known_mass[0] is not mass or self._known_mass[1] != wet:
            self._known_mass = mass, wet
            self._equation.set_mass(mass, wet)

    def advance(self, wrench: Sequence[float]) -> None:
        """Advance by one step."""
        motion, plane, water, equation = self._motion, self._plane, self._water, self._equation
        step_s, flotation = motion.step_s, water.flotation
        (vx, _, vz), (cx, _, cz), pitch_rate = motion.velocity, motion.current, motion.rate[1]
        wrench = water.add_water_forces(wrench, motion.through_water(), step_s)
        self._follow_mass()
        through = vx - cx, vz - cz, pitch_rate
        if water.impact_impulse is not None:
            through = equation.subtract_impulse(
                through, self._pitch, (water.impact_impulse[0], water.impact_impulse[2], water.impact_impulse[4])
            )
            plane.move_at((through[0] + cx, through[1] + cz, through[2]))
        plane.drift(0.5 * step_s)
        arm_x, _, arm_z = flotation.static_moment_nm
        rx, rz, rate = equation.advance(
            through, self._pitch, (wrench[0], wrench[2], wrench[4]), flotation.net_n, (arm_x, arm_z), step_s
        )
        after, self.contact_n = (rx + cx, rz + cz, rate), None
        contacts = plane.contacts()
        if contacts:
            mobility = equation.mobility(self._pitch + 0.5 * step_s * pitch_rate)
            after, (along_x, along_z) = resolve_contacts(after, contacts, mobility, FRICTION, step_s)
            self.contact_n = (along_x / step_s, 0.0, along_z / step_s)
            water.entrained_fraction = water.wet
        plane.move_at(after)
        plane.drift(0.5 * step_s)
        if water.entrained_fraction > water.wet:
            x, z, rate = self._velocity_after_entrainment(
                (after[0] - cx, after[1] - cz, after[2]), plane.plane_pose()[2]
            )
            after = x + cx, z + cz, rate
            plane.move_at(after)
        self._take_over(after)

    def _velocity_after_entrainment(self, through: Three, pitch: float) -> Three:
        """Return the velocity at a step's end, as `WaterForces.velocity_after_entrainment` does in space."""
        cos, sin = math.cos(pitch), math.sin(pitch)
        x, z, rate = through
        for _ in range(SLOWING_ITERATIONS):
            late = self._water.late_momentum((cos * x - sin * z, 0.0, sin * x + cos * z, 0.0, rate, 0.0))
            x, z, rate = self._equation.subtract_impulse(through, pitch, (late[0], late[2], late[4]))
        return x, z, rate

    def _take_over(self, after: Three) -> None:
        motion = self._motion
        (vx, _, vz), (_, y, _) = motion.velocity, motion.position
        x, z, pitch = self._plane.plane_pose()
        self._pitch = pitch
        motion.position, motion.attitude = (x, y, z), (math.cos(0.5 * pitch), 0.0, math.sin(0.5 * pitch), 0.0)
        motion.rotation = rotation_of(motion.attitude)
        motion.velocity, motion.rate = (after[0], 0.0, after[1]), (0.0, after[2], 0.0)
        motion.acceleration_world = ((after[0] - vx) / motion.step_s, 0.0, (after[1] - vz) / motion.step_s)


def in_plane(dive: Dive) -> Dive:
    """Return what of a dive lies in the plane: the vehicle heads east, and nothing pulls to the side."""
    y = dive.position_m[1]
    tether = dive.tether
    return replace(
        dive,
        attitude_rad=(0.0, dive.attitude_rad[1], 0.0),
        velocity_mps=_flat(dive.velocity_mps),
        rate_radps=(0.0, dive.rate_radps[1], 0.0),
        currents=tuple(replace(one, velocity_mps=_flat(one.velocity_mps)) for one in dive.currents),
        loads=tuple(replace(one, position_m=_flat(one.position_m)) for one in dive.loads),
        leak=dive.leak and replace(dive.leak, position_m=_flat(dive.leak.position_m)),
        tether=tether
        and replace(
            tether, anchor_m=(tether.anchor_m[0], y, tether.anchor_m[2]), attachment_m=_flat(tether.attachment_m)
        ),
    )


def _flat(vector: Vector) -> Vector:
    return vector[0], 0.0, vector[2]
