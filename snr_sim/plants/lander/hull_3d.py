"""The lunar module as MuJoCo moves it: a hull free in six directions, and four feet that give way on springs.

The hull hangs on no guide: that it stays in the x-z plane is a result. A foot slides against the hull along x, y and z,
all with one stiffness and one damping, and meets the ground as a small ball with friction. So a leg is as stiff along
the ground as into it, whichever way the ground slopes, and two legs side by side are one leg of the plane
(`legs.py`). Unlike there a foot weighs something, and takes a moment to spring back when it has left the ground.

The ground is the line of `terrain.py`, extruded sideways.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from snr_sim.plants.lander.module import LunarModule
from snr_sim.plants.lander.module_shapes import PADS_BELOW_M, PADS_M, hull_corners
from snr_sim.plants.lander.terrain import HALF_WIDTH_M, Terrain
from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.prelude.errors import ParameterError, PlantError
from snr_sim.prelude.sums import ordered_sum

FOOT_KG = 20.0  # own choice: small relative to the module, large enough to be integrated in steps of 5 ms
FOOT_RADIUS_M = 0.1
GROUND_HALF_DEPTH_M = 30.0
GROUND_DEEP_M = 20.0  # below its lowest point: nothing falls through, however fast
NOMINAL_KG = 7000.0  # MuJoCo computes for a module of this mass how softly to treat contacts: they give 0.1 mm

# All feet together: mass, and their moments about the module's centre of mass.
_FEET_KG = len(PADS_M) * FOOT_KG
_FEET_BELOW_M = PADS_BELOW_M - FOOT_RADIUS_M
_FOOT_INERTIA = 0.4 * FOOT_KG * FOOT_RADIUS_M**2
_FEET_XX = ordered_sum(FOOT_KG * (y * y + _FEET_BELOW_M**2) + _FOOT_INERTIA for _, y in PADS_M.values())
_FEET_YY = ordered_sum(FOOT_KG * (x * x + _FEET_BELOW_M**2) + _FOOT_INERTIA for x, _ in PADS_M.values())
_FEET_ZZ = ordered_sum(FOOT_KG * (x * x + y * y) + _FOOT_INERTIA for x, y in PADS_M.values())

GROUND, HULL = "ground", "hull"

Vector: TypeAlias = tuple[float, float, float]


class Hull3D:
    """The module over ground, in a world of its own."""

    # Of the centre of mass [m], attitude of the module (quaternion w, x, y, z), then how far each foot has given way
    # along the body's axes [m].
    coordinates: list[float]
    motion: list[float]  # velocity [m/s] in the world's frame, rate [rad/s] in the body's, then that of each foot
    axes: list[float]  # the matrix whose columns are the body's axes in the world's frame, row by row
    contacts: frozenset[str]  # what touches the ground: names of legs, and `HULL`

    def __init__(self, module: LunarModule, terrain: Terrain, step_s: float) -> None:
        world = MujocoWorld(_mjcf(module, terrain), step_s, (HULL, *PADS_M), "the lunar module's MJCF")
        mujoco, model, data = world.mujoco, world.model, world.data
        self.engine: str = world.engine
        self.terrain: Terrain = terrain
        self._world, self._model, self._data = world, model, data
        self._begin_step, self._end_step = mujoco.mj_step1, mujoco.mj_step2
        self._gyration2 = module.gyration_m**2
        body = world.body_id(HULL)
        # Views into MuJoCo's memory, looked up once: they are read and written at every step.
        self._qpos, self._qvel, self._xmat = data.qpos, data.qvel, data.xmat[body]
        self._force = data.qfrc_applied[:6]
        self._masses, self._subtree, self._hull = model.body_mass, model.body_subtreemass, body
        self._offset, self._inertia = model.body_ipos[body], model.body_inertia[body]
        names = {body: HULL, **{world.body_id(name): name for name in PADS_M}}
        self._part_of = [names.get(int(number), GROUND) for number in model.geom_bodyid]

    def put(self, coordinates: tuple[float, ...], motion: tuple[float, ...]) -> None:
        """Set the module's pose with its legs at rest; then take its `state`."""
        self._world.mujoco.mj_resetData(self._model, self._data)
        self._qpos[:7], self._qvel[:6] = coordinates, motion

    def state(self) -> tuple[float, ...]:
        """Return all that MuJoCo carries from one step to the next."""
        mujoco = self._world.mujoco
        values = np.empty(mujoco.mj_stateSize(self._model, mujoco.mjtState.mjSTATE_INTEGRATION))
        mujoco.mj_getState(self._model, self._data, values, mujoco.mjtState.mjSTATE_INTEGRATION)
        return tuple(values.tolist())

    def put_state(self, state: tuple[float, ...]) -> None:
        """Put back what `state` returned; then `set_mass` and `update`."""
        mujoco = self._world.mujoco
        mujoco.mj_setState(self._model, self._data, np.array(state), mujoco.mjtState.mjSTATE_INTEGRATION)

    def update(self) -> None:
        """Work out where everything is, and what touches; raise a PlantError if the state is not finite."""
        self.coordinates, self.motion = self._qpos.tolist(), self._qvel.tolist()
        if not math.isfinite(math.hypot(*self.coordinates, *self.motion)):
            self._world.check_finite()
        self._begin_step(self._model, self._data)
        self.axes, self.contacts = self._xmat.tolist(), frozenset()
        if self._data.ncon:
            part_of = self._part_of
            self.contacts = frozenset(part_of[a] for pair in self._data.contact.geom.tolist() for a in pair) - {GROUND}

    def set_mass(self, mass_kg: float) -> None:
        """Tell MuJoCo the mass of the module with its feet; the centre of mass and the gyration radius stay."""
        mass, offset, inertia = _hull_of(mass_kg, self._gyration2)
        self._masses[self._hull], self._offset[2], self._inertia[:] = mass, offset, inertia
        self._subtree[: self._hull + 1] = mass_kg

    def push(self, force: Vector, torque: Vector) -> None:
        """Set force [N] at the centre of mass, world frame, and torque [N m], body frame, until they are set again.

        One that is not finite raises a PlantError here, because MuJoCo would write a log file.
        """
        if not math.isfinite(math.hypot(*force, *torque)):
            raise PlantError(
                f"At {self._data.time:g} s the force on the module is {force} N, the torque {torque} N m.",
                fix="look at the module's numbers: a thrust or a couple that is infinite, a mass of 0?",
            )
        self._force[:] = *force, *torque

    def move(self) -> None:
        """Advance by one step; then `set_mass`, `update` and `push`."""
        self._end_step(self._model, self._data)

    def stop(self) -> None:
        """Set all velocities of module and feet to 0, and clear all forces."""
        self._qvel[:] = 0.0
        self._force[:] = 0.0
        self.motion = self._qvel.tolist()

    def deflection_m(self, name: str) -> Vector:
        """Return how far a foot has given way along the body's axes."""
        first = 7 + 3 * list(PADS_M).index(name)
        x, y, z = self.coordinates[first : first + 3]
        return x, y, z


def _hull_of(mass_kg: float, gyration2: float) -> tuple[float, float, Vector]:
    """Return mass, height of its centre [m] and moments of the hull alone, so that with its feet it is the module.

    Raises a ParameterError if there is no such hull, as the feet alone are heavier or farther out.
    """
    rest = mass_kg - _FEET_KG
    raised = _FEET_KG * _FEET_BELOW_M
    whole = mass_kg * gyration2
    level = raised * raised / rest if rest > 0.0 else 0.0
    inertia = whole - _FEET_XX - level, whole - _FEET_YY - level, whole - _FEET_ZZ
    if rest <= 0.0 or min(inertia) <= 0.0:
        raise ParameterError(
            f"A module of {mass_kg:g} kg with a radius of gyration of {gyration2**0.5:g} m has no room for "
            f"{len(PADS_M)} feet of {FOOT_KG:g} kg.",
            fix="give it more of either, or fly it in the plane: --engine pymunk.",
        )
    return rest, raised / rest, inertia


def _mjcf(module: LunarModule, terrain: Terrain) -> str:
    """Return module and ground for MuJoCo; mass and moments are set before every step."""
    heights = terrain.heights_m
    low, span = min(heights), max(heights) - min(heights) or 1.0
    size = f"{HALF_WIDTH_M} {GROUND_HALF_DEPTH_M} {span:.9g} {GROUND_DEEP_M}"
    row = " ".join(f"{height:.9g}" for height in heights)
    mass, offset, inertia = _hull_of(NOMINAL_KG, module.gyration_m**2)
    corners = "  ".join(f"{x:g} {y:g} {z:g}" for x, y, z in hull_corners())
    leg = module.leg
    # Two legs of space for one of the plane.
    spring = f'type="slide" stiffness="{0.5 * leg.spring_npm:.17g}" damping="{0.5 * leg.damper_nspm:.17g}"'
    feet = "".join(
        f"""
      <body name="{name}" pos="{x} {y} {-_FEET_BELOW_M}">
        <inertial pos="0 0 0" mass="{FOOT_KG}" diaginertia="{_FOOT_INERTIA} {_FOOT_INERTIA} {_FOOT_INERTIA}"/>
        <joint name="{name}_x" axis="1 0 0" {spring}/>
        <joint name="{name}_y" axis="0 1 0" {spring}/>
        <joint name="{name}_z" axis="0 0 1" {spring}/>
        <geom class="module" type="sphere" size="{FOOT_RADIUS_M}"/>
      </body>"""
        for name, (x, y) in PADS_M.items()
    )
    # The integrator "discrete": under Euler's and the implicit ones, contacts are computed without the dampers of the
    # legs, which in a step of 5 ms count three times a foot's mass, and a module at rest never stops vibrating. Flight
    # is equal. Contacts are as stiff as the step allows: the compliance is in the legs. An elliptic cone, and friction
    # solved ten times as stiffly as the rest, so that a module on a slope does not creep.
    return f"""
<mujoco model="lunar module">
  <option gravity="0 0 {-module.gravity_mps2:.17g}" integrator="discrete" cone="elliptic" impratio="10">
    <flag autoreset="disable"/>
  </option>
  <default>
    <geom friction="{leg.friction} 0 0" condim="3" solref=".01 1" solimp=".99 .999 .001"/>
    <default class="module"><geom contype="1" conaffinity="2"/></default>
  </default>
  <asset>
    <hfield name="{GROUND}" nrow="2" ncol="{len(heights)}" size="{size}" elevation="{row} {row}"/>
    <mesh name="{HULL}" vertex="{corners}"/>
  </asset>
  <worldbody>
    <geom name="{GROUND}" type="hfield" hfield="{GROUND}" pos="0 0 {low:.9g}" contype="2" conaffinity="1"/>
    <body name="{HULL}">
      <freejoint name="{HULL}"/>
      <inertial pos="0 0 {offset}" mass="{mass}" diaginertia="{inertia[0]} {inertia[1]} {inertia[2]}"/>
      <geom class="module" type="mesh" mesh="{HULL}"/>{feet}
    </body>
  </worldbody>
</mujoco>"""
